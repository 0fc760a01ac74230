//! Preconditioned conjugate gradients and restarted GMRES.
//!
//! All reductions run over fixed chunks, so that results have the same bits on any number of threads.

use crate::{parallel, progress::Progress};
use rayon::prelude::*;

/// A linear map `y = A x` on vectors of one length.
pub trait LinearMap: Sync {
    /// Overwrites `y` by `A x`.
    fn apply_into(&self, x: &[f64], y: &mut [f64]);
}

/// The map that changes nothing: no preconditioner.
#[derive(Clone, Copy, Debug, Default)]
pub struct Identity;

impl LinearMap for Identity {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(x);
    }
}

/// Stopping criteria of an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KrylovParams {
    /// Relative residual `‖b − A x‖₂ / ‖b‖₂` to be reached.
    pub tolerance: f64,
    /// Limit of iterations.
    pub max_iterations: usize,
    /// Iterations of GMRES between restarts; each keeps one vector.
    pub restart: usize,
}

impl Default for KrylovParams {
    fn default() -> Self {
        // 60 vectors are less than the matrix of a 2D horizon of three spacings; multigrid takes 10 to 30 iterations
        KrylovParams {
            tolerance: 1e-10,
            max_iterations: 1000,
            restart: 60,
        }
    }
}

/// Summary of an iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct KrylovInfo {
    /// Applications of the preconditioned operator.
    pub iterations: usize,
    /// Relative residual by the recurrence.
    pub relative_residual: f64,
}

/// Reason why an iteration stopped short.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum KrylovError {
    /// A direction with `p·A p ≤ 0`, or a preconditioner with `r·M r ≤ 0`.
    #[error(
        "conjugate gradients met a direction of no or negative energy at iteration {iteration}; the matrix is not \
         symmetric positive definite"
    )]
    Indefinite {
        /// Iteration at which it was met.
        iteration: usize,
    },
    /// The tolerance was not reached.
    #[error("the relative residual is {residual:.1e} after {iterations} iterations")]
    NotConverged {
        /// Relative residual reached.
        residual: f64,
        /// Iterations done.
        iterations: usize,
    },
    /// The listener asked for the end.
    #[error("interrupted at iteration {iteration}")]
    Interrupted {
        /// Iteration at which it was.
        iteration: usize,
    },
}

/// Entries per chunk of a reduction.
const CHUNK: usize = 8192;

/// `a·b`, summed by fixed chunks.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let partial: Vec<f64> = a
        .par_chunks(CHUNK)
        .zip(b.par_chunks(CHUNK))
        .map(|(a, b)| a.iter().zip(b).map(|(x, y)| x * y).sum())
        .collect();
    partial.iter().sum()
}

/// `‖a‖₂`, also of numbers whose squares are too large or too small for a number.
pub fn norm(a: &[f64]) -> f64 {
    let squares = dot(a, a);
    if squares > 1e-200 && squares < 1e300 {
        return squares.sqrt();
    }
    let largest = a.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    if largest == 0.0 || !largest.is_finite() {
        // a sum of squares that is no number stays none
        return squares.sqrt();
    }
    let scaled: Vec<f64> = a.iter().map(|v| v / largest).collect();
    largest * dot(&scaled, &scaled).sqrt()
}

/// `y ← y + s x`.
pub(crate) fn add_scaled(s: f64, x: &[f64], y: &mut [f64]) {
    y.par_chunks_mut(CHUNK)
        .zip(x.par_chunks(CHUNK))
        .for_each(|(y, x)| y.iter_mut().zip(x).for_each(|(y, x)| *y += s * x));
}

/// Solves `A x = b` for a symmetric positive definite `A`, from `x = 0`.
///
/// `preconditioner` must be symmetric positive definite too.
///
/// # Errors
/// [`KrylovError::Indefinite`] if `A` or the preconditioner is found not to be positive definite,
/// [`KrylovError::NotConverged`] with the residual reached, [`KrylovError::Interrupted`] where `progress` asks to end.
pub fn conjugate_gradients(
    operator: &dyn LinearMap,
    preconditioner: &dyn LinearMap,
    rhs: &[f64],
    params: &KrylovParams,
    progress: &dyn Progress,
) -> Result<(Vec<f64>, KrylovInfo), KrylovError> {
    let n = rhs.len();
    let mut x = vec![0.0; n];
    let scale = norm(rhs);
    if scale == 0.0 {
        return Ok((
            x,
            KrylovInfo {
                iterations: 0,
                relative_residual: 0.0,
            },
        ));
    }
    let mut r = rhs.to_vec();
    let (mut z, mut q) = (vec![0.0; n], vec![0.0; n]);
    preconditioner.apply_into(&r, &mut z);
    let mut p = z.clone();
    let mut rz = dot(&r, &z);
    let mut residual = 1.0;
    for iteration in 1..=params.max_iterations {
        operator.apply_into(&p, &mut q);
        let energy = dot(&p, &q);
        if !(energy > 0.0 && rz > 0.0) {
            return Err(KrylovError::Indefinite { iteration });
        }
        let step = rz / energy;
        add_scaled(step, &p, &mut x);
        add_scaled(-step, &q, &mut r);
        residual = norm(&r) / scale;
        progress.advance(1);
        goes_on(progress, iteration)?;
        if residual <= params.tolerance {
            return Ok((
                x,
                KrylovInfo {
                    iterations: iteration,
                    relative_residual: residual,
                },
            ));
        }
        preconditioner.apply_into(&r, &mut z);
        let next = dot(&r, &z);
        let ratio = next / rz;
        rz = next;
        p.par_chunks_mut(CHUNK)
            .zip(z.par_chunks(CHUNK))
            .for_each(|(p, z)| p.iter_mut().zip(z).for_each(|(p, z)| *p = z + ratio * *p));
    }
    Err(KrylovError::NotConverged {
        residual,
        iterations: params.max_iterations,
    })
}

/// Takes the directions of a basis out of `w`; how much of each was in it, with a place for what is left.
fn orthogonalise(basis: &[Vec<f64>], w: &mut [f64]) -> Vec<f64> {
    let k = basis.len() - 1;
    let mut column = vec![0.0; k + 2];
    // twice is enough [Giraud2005], and once is not for nearly dependent vectors
    for _ in 0..2 {
        for (h, v) in column.iter_mut().zip(basis) {
            let c = dot(v, w);
            *h += c;
            add_scaled(-c, v, w);
        }
    }
    column
}

/// Fails if the listener asks for the end of the run.
fn goes_on(progress: &dyn Progress, iteration: usize) -> Result<(), KrylovError> {
    match progress.asks_to_end() {
        true => Err(KrylovError::Interrupted { iteration }),
        false => Ok(()),
    }
}

/// Solves `A x = b` by GMRES with the preconditioner on the right, restarted, from `x = 0`.
///
/// The residual of the recurrence is the residual of the system itself (right preconditioning). Any fixed linear
/// preconditioner will do.
///
/// # Errors
/// [`KrylovError::NotConverged`] with the residual reached, [`KrylovError::Interrupted`] where `progress` asks to end.
pub fn gmres(
    operator: &dyn LinearMap,
    preconditioner: &dyn LinearMap,
    rhs: &[f64],
    params: &KrylovParams,
    progress: &dyn Progress,
) -> Result<(Vec<f64>, KrylovInfo), KrylovError> {
    let n = rhs.len();
    let mut x = vec![0.0; n];
    let scale = norm(rhs);
    if scale == 0.0 {
        return Ok((x, KrylovInfo::default()));
    }
    let mut r = rhs.to_vec();
    let mut z = vec![0.0; n];
    let mut iterations = 0;
    let mut residual = 1.0;
    while iterations < params.max_iterations {
        let beta = norm(&r);
        let mut basis = vec![r.iter().map(|v| v / beta).collect::<Vec<f64>>()];
        let mut least = LeastSquares::new(beta);
        while least.columns() < params.restart.max(1) && iterations < params.max_iterations {
            let k = least.columns();
            preconditioner.apply_into(&basis[k], &mut z);
            let mut w = vec![0.0; n];
            operator.apply_into(&z, &mut w);
            let before = norm(&w);
            let mut column = orthogonalise(&basis, &mut w);
            let size = norm(&w);
            column[k + 1] = size;
            residual = least.push(column) / scale;
            iterations += 1;
            progress.advance(1);
            goes_on(progress, iterations)?;
            // a vanishing new direction means that the solution lies in the space already spanned
            if residual <= params.tolerance || size <= 1e-14 * before {
                break;
            }
            parallel::for_each_chunk(&mut w, CHUNK, 1, |_, w| {
                w.iter_mut().for_each(|w| *w /= size)
            });
            basis.push(w);
        }
        let mut combination = vec![0.0; n];
        for (c, v) in least.solve().iter().zip(&basis) {
            add_scaled(*c, v, &mut combination);
        }
        preconditioner.apply_into(&combination, &mut z);
        add_scaled(1.0, &z, &mut x);
        operator.apply_into(&x, &mut z);
        r.iter_mut()
            .zip(rhs)
            .zip(&z)
            .for_each(|((r, b), z)| *r = b - z);
        let true_residual = norm(&r) / scale;
        if true_residual <= params.tolerance {
            return Ok((
                x,
                KrylovInfo {
                    iterations,
                    relative_residual: true_residual,
                },
            ));
        }
        // no progress within a whole cycle: round-off or stagnation, and another cycle would repeat it
        let stagnant = true_residual > 0.999 * beta / scale;
        residual = true_residual;
        if stagnant || !true_residual.is_finite() {
            break;
        }
    }
    Err(KrylovError::NotConverged {
        residual,
        iterations,
    })
}

/// The Hessenberg least-squares problem of GMRES, updated by Givens rotations.
struct LeastSquares {
    triangle: Vec<Vec<f64>>,
    rotations: Vec<(f64, f64)>,
    rhs: Vec<f64>,
}

impl LeastSquares {
    fn new(beta: f64) -> LeastSquares {
        LeastSquares {
            triangle: Vec::new(),
            rotations: Vec::new(),
            rhs: vec![beta],
        }
    }

    fn columns(&self) -> usize {
        self.triangle.len()
    }

    /// Adds a column of the Hessenberg matrix; returns the norm of the residual.
    fn push(&mut self, mut column: Vec<f64>) -> f64 {
        let k = self.triangle.len();
        for (i, &(c, s)) in self.rotations.iter().enumerate() {
            let (a, b) = (column[i], column[i + 1]);
            column[i] = c * a + s * b;
            column[i + 1] = c * b - s * a;
        }
        let length = column[k].hypot(column[k + 1]);
        let (c, s) = if length > 0.0 {
            (column[k] / length, column[k + 1] / length)
        } else {
            (1.0, 0.0)
        };
        column[k] = length;
        column.truncate(k + 1);
        self.triangle.push(column);
        self.rotations.push((c, s));
        let last = self.rhs[k];
        self.rhs[k] = c * last;
        self.rhs.push(-s * last);
        self.rhs[k + 1].abs()
    }

    /// The coefficients of the basis vectors.
    fn solve(&self) -> Vec<f64> {
        let n = self.triangle.len();
        let mut y = self.rhs[..n].to_vec();
        for k in (0..n).rev() {
            let pivot = self.triangle[k][k];
            y[k] = if pivot == 0.0 { 0.0 } else { y[k] / pivot };
            for i in 0..k {
                y[i] -= self.triangle[k][i] * y[k];
            }
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use nalgebra::{DMatrix, DVector};

    struct Dense(DMatrix<f64>);

    impl LinearMap for Dense {
        fn apply_into(&self, x: &[f64], y: &mut [f64]) {
            y.copy_from_slice((&self.0 * DVector::from_column_slice(x)).as_slice());
        }
    }

    /// An advection-diffusion matrix: symmetric positive definite for `wind = 0`.
    fn transport(n: usize, wind: f64) -> DMatrix<f64> {
        DMatrix::from_fn(n, n, |i, j| match j as isize - i as isize {
            0 => 2.1,
            1 => -1.0 + wind,
            -1 => -1.0 - wind,
            _ => 0.0,
        })
    }

    fn rhs(n: usize) -> Vec<f64> {
        (0..n).map(|k| ((k * 5) % 7) as f64 - 2.5).collect()
    }

    fn error(a: &DMatrix<f64>, x: &[f64], b: &[f64]) -> f64 {
        let exact = a
            .clone()
            .lu()
            .solve(&DVector::from_column_slice(b))
            .expect("regular");
        (DVector::from_column_slice(x) - &exact).norm() / exact.norm()
    }

    #[test]
    fn both_methods_agree_with_dense_lu() {
        let (n, params) = (
            60,
            KrylovParams {
                tolerance: 1e-12,
                ..KrylovParams::default()
            },
        );
        let b = rhs(n);
        let a = transport(n, 0.0);
        let (x, info) = conjugate_gradients(&Dense(a.clone()), &Identity, &b, &params, &Silent)
            .expect("solved");
        assert!(error(&a, &x, &b) < 1e-10 && info.iterations <= n);
        for wind in [0.0, 0.4, 0.9] {
            let a = transport(n, wind);
            let (x, info) =
                gmres(&Dense(a.clone()), &Identity, &b, &params, &Silent).expect("solved");
            assert!(
                error(&a, &x, &b) < 1e-10 && info.iterations <= n,
                "wind {wind}: {info:?}"
            );
        }
    }

    #[test]
    fn restarts_and_preconditioning_on_the_right_leave_the_true_residual() {
        let (n, a) = (80, transport(80, 0.3));
        let b = rhs(n);
        let params = KrylovParams {
            tolerance: 1e-11,
            max_iterations: 2000,
            restart: 7,
        };
        // a poor but regular preconditioner with uneven scales
        let uneven = Dense(DMatrix::from_diagonal(&DVector::from_fn(n, |k, _| {
            1.0 + (k % 3) as f64
        })));
        let (x, info) = gmres(&Dense(a.clone()), &uneven, &b, &params, &Silent).expect("solved");
        let residual =
            (DVector::from_column_slice(&b) - &a * DVector::from_column_slice(&x)).norm();
        assert!(
            (residual / norm(&b) - info.relative_residual).abs() < 1e-15 && info.iterations > 7
        );
        assert!(error(&a, &x, &b) < 1e-9);
    }

    #[test]
    fn trouble_is_reported() {
        let n = 20;
        let mut a = transport(n, 0.0);
        a[(3, 3)] = -4.0;
        let b = rhs(n);
        let params = KrylovParams::default();
        let wrong = conjugate_gradients(&Dense(a), &Identity, &b, &params, &Silent);
        assert!(
            matches!(wrong, Err(KrylovError::Indefinite { .. })),
            "{wrong:?}"
        );
        let few = KrylovParams {
            max_iterations: 3,
            ..params
        };
        let short = gmres(&Dense(transport(n, 0.5)), &Identity, &b, &few, &Silent);
        assert!(
            matches!(short, Err(KrylovError::NotConverged { iterations: 3, .. })),
            "{short:?}"
        );
        // a singular matrix with a load outside its range
        let mut singular = transport(n, 0.0);
        singular.row_mut(4).fill(0.0);
        let never = gmres(&Dense(singular), &Identity, &b, &params, &Silent);
        assert!(
            matches!(never, Err(KrylovError::NotConverged { .. })),
            "{never:?}"
        );
    }
}
