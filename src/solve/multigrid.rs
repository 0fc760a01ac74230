//! Smoothed-aggregation algebraic multigrid on block rows, with rigid-body modes \[Vanek1996\].
//!
//! Every non-zero block is a strong connection, so that a wide PD stencil is aggregated over its whole row. The
//! prolongation is smoothed by `ω = 4/(3 λ_max)`, the restriction is its transpose (also for unsymmetric operators),
//! the smoother is a Chebyshev polynomial of block-Jacobi, the coarsest level is factorised.

use crate::progress::Silent;
use crate::solve::aggregation::{
    Aggregates, Prolongation, coarse_matrix, rigid_near_null_space, smoothed,
};
use crate::solve::direct::{Analysis, Factor};
use crate::solve::direct_params::{DirectError, DirectParams};
use crate::solve::krylov::{LinearMap, add_scaled};
use crate::solve::ordering::{Ordering, OrderingError};
use crate::solve::smoother::{BlockJacobi, Chebyshev, Residual};
use crate::solve::{FreeDofs, FreeOperator};
use crate::system::BlockCsr;

/// Parameters of a hierarchy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MultigridParams {
    /// A level with at most this many dofs is factorised.
    pub coarsest: usize,
    /// Limit of levels.
    pub max_levels: usize,
    /// Degree of the Chebyshev smoother.
    pub degree: usize,
    /// The smoother damps eigenvalues of `D⁻¹K` from `λ_max / smoothed_range` to `λ_max`.
    pub smoothed_range: f64,
}

impl Default for MultigridParams {
    fn default() -> Self {
        MultigridParams {
            coarsest: 3000,
            max_levels: 20,
            degree: 2,
            smoothed_range: 6.0,
        }
    }
}

/// Sizes of a hierarchy.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct MultigridInfo {
    /// Dofs of each level, the finest first.
    pub dofs: Vec<usize>,
    /// Scalars in the matrices of all levels over those of the finest.
    pub operator_complexity: f64,
}

/// Failure of the setup of a hierarchy.
#[derive(Debug, thiserror::Error)]
pub enum MultigridError {
    /// The diagonal block of a site cannot be inverted.
    #[error(
        "the diagonal block of site {site} is singular; support the site or use the direct method"
    )]
    SingularBlock {
        /// The site, on the finest level.
        site: usize,
    },
    /// The coarsest level could not be factorised.
    #[error("the coarsest level could not be factorised: {0}; use the direct method")]
    Coarsest(#[from] DirectError),
    /// The coarsest level could not be ordered.
    #[error(transparent)]
    Ordering(#[from] OrderingError),
}

/// A hierarchy of matrices, applied as one V-cycle from a zero guess.
#[derive(Debug)]
pub struct Multigrid<'a> {
    finest: &'a BlockCsr,
    free: &'a FreeDofs,
    levels: Vec<Level>,
    coarsest: Factor,
}

/// One level above the coarsest.
#[derive(Debug)]
struct Level {
    /// The matrix of the level; `None` on the finest, which is borrowed.
    matrix: Option<BlockCsr>,
    smoother: Chebyshev,
    prolongation: Prolongation,
}

impl<'a> Multigrid<'a> {
    /// Builds the hierarchy of the free part of `matrix`.
    ///
    /// Shapes: `positions` has one entry per site. `matrix.block` is the dimension, so that there are 1, 3 or 6
    /// rigid-body modes.
    ///
    /// # Errors
    /// [`MultigridError`] if a diagonal block or the coarsest matrix is singular.
    pub fn new(
        matrix: &'a BlockCsr,
        free: &'a FreeDofs,
        positions: &[[f64; 3]],
        params: &MultigridParams,
    ) -> Result<(Multigrid<'a>, MultigridInfo), MultigridError> {
        let mut info = MultigridInfo {
            dofs: vec![free.count()],
            operator_complexity: 1.0,
        };
        let mut near_null = rigid_near_null_space(positions, free);
        let mut places = positions.to_vec();
        let mut levels: Vec<Level> = Vec::new();
        let mut current: Option<BlockCsr> = None;
        let mut all = None;
        loop {
            let a = current.as_ref().unwrap_or(matrix);
            let mask = all.as_ref().unwrap_or(free);
            if mask.count() <= params.coarsest || levels.len() + 1 >= params.max_levels {
                break;
            }
            let aggregates = Aggregates::new(a, mask);
            if 10 * aggregates.count >= 9 * mask.sites_with_free_dofs() {
                // nothing left to gather: bodies too small to coarsen
                break;
            }
            let jacobi =
                BlockJacobi::new(a, mask).map_err(|site| MultigridError::SingularBlock { site })?;
            let largest = jacobi.largest_eigenvalue(&FreeOperator::new(a, mask));
            let (tentative, coarse_null) = aggregates.tentative(mask, &near_null);
            let prolongation = smoothed(
                a,
                mask,
                &jacobi,
                4.0 / (3.0 * largest),
                &aggregates,
                &tentative,
                coarse_null.modes,
            );
            let coarse = coarse_matrix(a, mask, &prolongation);
            places = aggregates.centres(&places);
            near_null = coarse_null;
            info.dofs.push(coarse.dofs());
            info.operator_complexity += coarse.nonzeros() as f64 / matrix.nonzeros() as f64;
            all = Some(FreeDofs::all(coarse.rows(), coarse.block));
            let smoother = Chebyshev::new(jacobi, largest, params.smoothed_range, params.degree);
            levels.push(Level {
                matrix: current.take(),
                smoother,
                prolongation,
            });
            current = Some(coarse);
        }
        let (a, mask) = (
            current.as_ref().unwrap_or(matrix),
            all.as_ref().unwrap_or(free),
        );
        let analysis = Analysis::new(a, mask, &places, Ordering::CoordinateNestedDissection)?;
        // a small pivot is the business of the outer iteration, which sees the true residual
        let exact = DirectParams {
            smallest_pivot: 0.0,
            ..DirectParams::default()
        };
        let (coarsest, _) = Factor::new(a, mask, analysis, &exact, &Silent)?;
        Ok((
            Multigrid {
                finest: matrix,
                free,
                levels,
                coarsest,
            },
            info,
        ))
    }

    /// One V-cycle for `A x = b` on `level`, from `x = 0`.
    fn cycle(&self, level: usize, b: &[f64]) -> Vec<f64> {
        let Some(here) = self.levels.get(level) else {
            return self.coarsest.solve(b);
        };
        let everything;
        let operator = match &here.matrix {
            Some(matrix) => {
                everything = FreeDofs::all(matrix.rows(), matrix.block);
                FreeOperator::new(matrix, &everything)
            }
            None => FreeOperator::new(self.finest, self.free),
        };
        let mut x = vec![0.0; b.len()];
        let mut r = b.to_vec();
        here.smoother
            .smooth(&operator, &mut x, &mut r, Residual::Update);
        let coarse = self.cycle(level + 1, &here.prolongation.restrict(&r));
        let step = here.prolongation.prolong(&coarse);
        let mut product = vec![0.0; b.len()];
        operator.apply_into(&step, &mut product);
        add_scaled(1.0, &step, &mut x);
        add_scaled(-1.0, &product, &mut r);
        here.smoother
            .smooth(&operator, &mut x, &mut r, Residual::Forget);
        x
    }
}

impl LinearMap for Multigrid<'_> {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(&self.cycle(0, x));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::krylov::{KrylovParams, conjugate_gradients, dot};
    use crate::solve::stencils::StencilGrid;

    fn held(lattice: &StencilGrid) -> FreeDofs {
        let d = lattice.dimension;
        let x = lattice.positions();
        let prescribed: Vec<Option<f64>> = (0..lattice.len() * d)
            .map(|k| {
                let [x, y, _] = x[k / d];
                // a roller along the edge x = 0 and a pin in its corner
                (x == 0.0 && (k % d == 0 || y == 0.0)).then_some(0.0)
            })
            .collect();
        FreeDofs::from_prescribed(&prescribed, d)
    }

    fn vector(free: &FreeDofs, seed: usize) -> Vec<f64> {
        let mut x: Vec<f64> = (0..free.sites() * free.block())
            .map(|k| ((k * 131 + seed * 17) % 101) as f64 / 101.0 - 0.5)
            .collect();
        free.clear_prescribed(&mut x);
        x
    }

    #[test]
    fn the_cycle_is_symmetric_and_positive_for_a_symmetric_matrix() {
        // conjugate gradients need both
        let lattice = StencilGrid::rectangle(40, 30);
        for matrix in [lattice.elements(), lattice.bonds(2)] {
            let free = held(&lattice);
            let params = MultigridParams {
                coarsest: 100,
                ..MultigridParams::default()
            };
            let (multigrid, info) =
                Multigrid::new(&matrix, &free, &lattice.positions(), &params).expect("hierarchy");
            assert!(info.dofs.len() >= 3, "{info:?}");
            let (x, y) = (vector(&free, 1), vector(&free, 2));
            let (mut mx, mut my) = (x.clone(), y.clone());
            multigrid.apply_into(&x, &mut mx);
            multigrid.apply_into(&y, &mut my);
            let scale = dot(&mx, &mx).sqrt() * dot(&y, &y).sqrt();
            assert!((dot(&mx, &y) - dot(&my, &x)).abs() < 1e-12 * scale);
            assert!(dot(&mx, &x) > 0.0);
        }
    }

    #[test]
    fn iterations_hardly_grow_with_the_size() {
        let count = |n: usize| {
            let lattice = StencilGrid::rectangle(n, n);
            let (matrix, free) = (lattice.elements(), held(&lattice));
            let params = MultigridParams {
                coarsest: 100,
                ..MultigridParams::default()
            };
            let (multigrid, _) =
                Multigrid::new(&matrix, &free, &lattice.positions(), &params).expect("hierarchy");
            let operator = FreeOperator::new(&matrix, &free);
            let b = vector(&free, 3);
            conjugate_gradients(&operator, &multigrid, &b, &KrylovParams::default(), &Silent)
                .expect("solved")
                .1
                .iterations
        };
        let (small, large) = (count(24), count(96));
        // block-Jacobi would take four times as many on the finer lattice
        assert!(
            large <= small + 6 && large < 25,
            "{small} and {large} iterations"
        );
    }

    #[test]
    fn a_site_without_stiffness_is_named() {
        let lattice = StencilGrid::rectangle(60, 40);
        let mut matrix = lattice.elements();
        let (a, b) = (matrix.row_offsets[77], matrix.row_offsets[78]);
        matrix.values[4 * a..4 * b].fill(0.0);
        let free = held(&lattice);
        let params = MultigridParams {
            coarsest: 100,
            ..MultigridParams::default()
        };
        let error =
            Multigrid::new(&matrix, &free, &lattice.positions(), &params).expect_err("singular");
        assert!(error.to_string().contains("site 77"), "{error}");
    }
}
