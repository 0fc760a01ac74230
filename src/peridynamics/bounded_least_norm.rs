//! The smallest weighted change that meets linear conditions: the core of all bond weights.

use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

use crate::tensor::Vector;

/// Eigenvalues of the scaled normal equations below this fraction of the largest count as zero.
const RANK_TOLERANCE: f64 = 1e-12;

/// Conditions count as met when they miss by at most this fraction of the sum of magnitudes of their terms.
const MET_TOLERANCE: f64 = 1e-13;

/// Steps of the dual Newton method; unbounded problems need two or three, bounded ones up to 8 on 60 one-sided families, where
/// feasibility and optimum agreed with those of a linear program and a bounded least-squares solver.
const MOST_STEPS: usize = 60;

/// Lower bound of the fitted factors, if any.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// Any sign.
    Free,
    /// At least this value (below 1).
    AtLeast(f64),
}

/// Failure of [`least_change`] to meet the conditions.
#[derive(Debug)]
pub struct NotMet {
    /// Independent conditions.
    pub(crate) rank: usize,
    /// True if they can be met without the bound.
    pub(crate) unbounded_met: bool,
}

/// The step along a `direction` of the given slope, halved until the dual falls enough.
fn step_length(
    dual: &dyn Fn(&DVector<f64>) -> f64,
    mu: &DVector<f64>,
    direction: &DVector<f64>,
    slope: f64,
) -> f64 {
    let mut length = 1.0;
    let start = dual(mu);
    while length > 1e-6 && dual(&(mu + direction * length)) > start - 1e-4 * length * slope {
        length *= 0.5;
    }
    length
}

/// The magnitude of the terms of each condition, that it is judged against.
fn scales(rows: &DMatrix<f64>, shares: &[f64], missing: &DVector<f64>) -> DVector<f64> {
    DVector::from_fn(rows.nrows(), |c, _| {
        let terms: f64 = shares
            .iter()
            .enumerate()
            .map(|(k, d)| d * rows[(c, k)].abs())
            .sum();
        terms.max(missing[c].abs()).max(f64::MIN_POSITIVE)
    })
}

/// Trial solution at given multipliers.
struct Trial {
    /// The change of each bond.
    change: Vec<f64>,
    /// Residual of each condition.
    residual: DVector<f64>,
    /// Bonds that are off the bound.
    off: Vec<bool>,
}

impl Trial {
    /// At the multipliers `mu`, with changes no lower than the limit.
    fn at(
        mu: &DVector<f64>,
        rows: &DMatrix<f64>,
        shares: &[f64],
        missing: &DVector<f64>,
        limit: f64,
    ) -> Self {
        let mut change = vec![0.0; shares.len()];
        let mut residual = missing.clone();
        let mut off = vec![false; shares.len()];
        for (k, &d) in shares.iter().enumerate() {
            if d == 0.0 {
                continue;
            }
            let t = rows.column(k).dot(mu);
            change[k] = t.max(limit);
            let b = rows.column(k);
            residual.axpy(-d * change[k], &b, 1.0);
            off[k] = t > limit;
        }
        Self {
            change,
            residual,
            off,
        }
    }
}

/// Weights of places at `arms` from a place, exact for affine fields there and none of them negative, that are nearest to `prior`; none where the place does not lie among them.
pub(crate) fn positive_weights<const D: usize>(
    arms: &[Vector<D>],
    prior: &[f64],
) -> Option<Vec<f64>> {
    let sum: f64 = prior.iter().sum();
    let prior: Vec<f64> = prior.iter().map(|w| w / sum).collect();
    let rows = DMatrix::from_fn(1 + D, arms.len(), |r, k| match r {
        0 => 1.0,
        _ => arms[k][r - 1],
    });
    let mut missing = DVector::zeros(1 + D);
    missing[0] = 1.0;
    missing -= &rows * DVector::from_column_slice(&prior);
    let change = least_change(&rows, &prior, &missing, Bound::AtLeast(0.0)).ok()?;
    let weights = prior.iter().zip(change).map(|(w, c)| w * (1.0 + c));
    Some(weights.map(|w| w.max(0.0)).collect())
}

/// Minimises `½ Σ d Δ²` subject to `Σ_k b_ck d_k Δ_k = missing_c` and `1 + Δ ≥ bound`; `rows` holds b, `shares` d.
///
/// The dual is smooth: `Δ_k = max(l, Σ_c b_ck μ_c)`. Newton's method with the normal equations of the bonds off the bound and a step
/// halved until the dual falls; without a bound its first step solves, the second is the refinement that restores lost digits.
pub fn least_change(
    rows: &DMatrix<f64>,
    shares: &[f64],
    missing: &DVector<f64>,
    bound: Bound,
) -> Result<Vec<f64>, NotMet> {
    let limit = match bound {
        Bound::Free => f64::NEG_INFINITY,
        Bound::AtLeast(least) => least - 1.0,
    };
    let free_change = |mu: &DVector<f64>, k: usize| rows.column(k).dot(mu);
    let dual = |mu: &DVector<f64>| {
        let sum: f64 = shares
            .iter()
            .enumerate()
            .map(|(k, d)| {
                let t = free_change(mu, k);
                d * if t >= limit {
                    0.5 * t * t
                } else {
                    limit * (t - 0.5 * limit)
                }
            })
            .sum();
        sum - mu.dot(missing)
    };
    let scales = scales(rows, shares, missing);
    let mut mu = DVector::zeros(rows.nrows());
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut full_rank = 0;
    // The normal equations, kept while the same bonds are off the bound.
    let mut solved_for: Option<(Vec<bool>, Normal)> = None;
    for step in 0..MOST_STEPS {
        let Trial {
            change,
            residual,
            off,
        } = Trial::at(&mu, rows, shares, missing, limit);
        let miss = residual.component_div(&scales).amax();
        let previous = best.as_ref().map(|(m, _)| *m);
        if best.is_none() || previous.is_some_and(|m| miss < m) {
            best = Some((miss, change));
        }
        // At round-off, one more step that gains nothing ends the refinement.
        let stalled = previous.is_some_and(|m| m <= MET_TOLERANCE && miss > 0.5 * m);
        if miss == 0.0 || stalled {
            break;
        }
        if solved_for.as_ref().is_none_or(|(o, _)| *o != off) {
            let Some(normal) = Normal::new(rows, shares, &off) else {
                break;
            };
            if step == 0 {
                full_rank = normal.rank();
            }
            solved_for = Some((off, normal));
        }
        let Some((_, normal)) = &solved_for else {
            break;
        };
        let direction = normal.solve(&residual);
        // Near the solution rounding hides the fall of the dual, and the full step is right.
        let length = match bound != Bound::Free && miss > 1e-8 {
            true => step_length(&dual, &mu, &direction, residual.dot(&direction)),
            false => 1.0,
        };
        mu.axpy(length, &direction, 1.0);
        if bound == Bound::Free && step >= 3 {
            break;
        }
    }
    match best {
        Some((miss, change)) if miss <= MET_TOLERANCE => Ok(change),
        _ => Err(NotMet {
            rank: full_rank,
            unbounded_met: bound != Bound::Free
                && least_change(rows, shares, missing, Bound::Free).is_ok(),
        }),
    }
}

/// The pseudo-inverse of the symmetric positive semi-definite normal equations `Σ d b bᵀ` of the bonds off the bound.
struct Normal {
    /// Makes the diagonal one, so that the rank does not hang on the units of a condition.
    scale: DVector<f64>,
    eigen: SymmetricEigen<f64, Dyn>,
    /// Below this, an eigenvalue counts as zero.
    least: f64,
}

/// Size from which the blocked eigenvalue solver is the faster one.
const LARGE: usize = 64;

/// `None` if the iteration does not converge.
fn eigen(matrix: DMatrix<f64>) -> Option<SymmetricEigen<f64, Dyn>> {
    let n = matrix.nrows();
    if n < LARGE {
        return Some(SymmetricEigen::new(matrix));
    }
    let of = faer::Mat::from_fn(n, n, |r, c| matrix[(r, c)]);
    let of = of.self_adjoint_eigen(faer::Side::Lower).ok()?;
    let values = of.S().column_vector();
    Some(SymmetricEigen {
        eigenvalues: DVector::from_fn(n, |k, _| values[k]),
        eigenvectors: DMatrix::from_fn(n, n, |r, c| of.U()[(r, c)]),
    })
}

impl Normal {
    /// `None` if a bond's share or row overflows, or eigenvalues cannot be found.
    fn new(rows: &DMatrix<f64>, shares: &[f64], off: &[bool]) -> Option<Self> {
        let n = rows.nrows();
        let mut normal = DMatrix::<f64>::zeros(n, n);
        for (k, &d) in shares.iter().enumerate() {
            if off[k] {
                // in large problems a bond takes part in few conditions
                let terms = rows.column(k).into_iter().copied().enumerate();
                let terms: Vec<(usize, f64)> = terms.filter(|t| t.1 != 0.0).collect();
                for &(c, b) in &terms {
                    for &(r, a) in &terms {
                        normal[(r, c)] += a * b * d;
                    }
                }
            }
        }
        let scale = DVector::from_fn(n, |c, _| {
            let d = normal[(c, c)];
            if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }
        });
        let scaled = DMatrix::from_fn(n, n, |a, b| normal[(a, b)] * scale[a] * scale[b]);
        if !scaled.iter().all(|v| v.is_finite()) {
            return None;
        }
        let eigen = eigen(scaled)?;
        let least = RANK_TOLERANCE * eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
        Some(Self {
            scale,
            eigen,
            least,
        })
    }

    /// Number of independent conditions.
    fn rank(&self) -> usize {
        self.eigen
            .eigenvalues
            .iter()
            .filter(|v| **v > self.least)
            .count()
    }

    /// The least-squares solution of least norm.
    fn solve(&self, rhs: &DVector<f64>) -> DVector<f64> {
        let projected = self
            .eigen
            .eigenvectors
            .tr_mul(&rhs.component_mul(&self.scale));
        let mut x = DVector::zeros(rhs.len());
        for (e, &value) in self.eigen.eigenvalues.iter().enumerate() {
            if value > self.least {
                x.axpy(
                    projected[e] / value,
                    &self.eigen.eigenvectors.column(e),
                    1.0,
                );
            }
        }
        x.component_mul(&self.scale)
    }
}
