//! Parameters of a direct solver, and its errors.

use crate::system::Symmetry;

/// Parameters of a factorisation.
#[derive(Clone, Copy, Debug)]
pub struct DirectParams {
    /// Cholesky for `Symmetric`, LU for `Unsymmetric`.
    pub symmetry: Symmetry,
    /// A pivot smaller than this fraction of its original diagonal entry is an error.
    ///
    /// Free bodies leave round-off, up to 6e-13 of the diagonal in the tests below; a cantilever fifty times as long
    /// as it is wide has 1e-6, the blocks and plates there 1e-1 and more. Round-off above the bound shows in the residual.
    pub smallest_pivot: f64,
    /// Refuses a factorisation that is predicted to need more bytes.
    pub memory_limit: Option<u64>,
}

impl Default for DirectParams {
    fn default() -> Self {
        DirectParams {
            symmetry: Symmetry::Unsymmetric,
            smallest_pivot: 1e-11,
            memory_limit: None,
        }
    }
}

/// Failure of a factorisation.
#[derive(Debug, thiserror::Error)]
pub enum DirectError {
    /// The factors would not fit.
    #[error(
        "the factors need {:.1} GB, {:.1} GB are allowed; use the krylov method, or coarsen the model",
        *bytes as f64 * 1e-9, *limit as f64 * 1e-9
    )]
    TooLarge {
        /// Predicted peak bytes.
        bytes: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// Cholesky met a pivot that is not positive: the matrix is not positive definite.
    #[error(
        "site {site} has a pivot that is not positive; the matrix is not positive definite, factorise it by LU"
    )]
    NotPositive {
        /// Site of the pivot.
        site: usize,
    },
    /// A pivot is zero to round-off: the matrix is singular.
    #[error(
        "site {site} has a pivot {ratio:.1e} of its diagonal; the matrix is singular, support the site"
    )]
    Singular {
        /// Site of the pivot.
        site: usize,
        /// Pivot over original diagonal.
        ratio: f64,
    },
}
