//! The smallest weighted change that meets linear conditions: the core of all bond weights.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Eigenvalues of the scaled normal equations below this fraction of the largest count as zero.
const RANK_TOLERANCE: f64 = 1e-12;

/// Conditions count as met when they miss by at most this fraction of the sum of magnitudes of their terms.
const MET_TOLERANCE: f64 = 1e-13;

/// Steps of the dual Newton method; unbounded problems need two or three, bounded ones up to 8 on 60 one-sided families, where
/// feasibility and optimum agreed with those of a linear program and a bounded least-squares solver.
const MOST_STEPS: usize = 60;

/// Whether the fitted factors are bounded from below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// Any sign.
    Free,
    /// At least this value (below 1).
    AtLeast(f64),
}

/// What stopped [`least_change`].
#[derive(Debug)]
pub(super) struct NotMet {
    /// Independent conditions.
    pub(super) rank: usize,
    /// Whether they can be met without the bound.
    pub(super) unbounded_met: bool,
}

/// Minimises `½ Σ d Δ²` subject to `Σ_k b_ck d_k Δ_k = missing_c` and `1 + Δ ≥ bound`; `rows` holds b, `shares` d.
///
/// The dual is smooth: `Δ_k = max(l, Σ_c b_ck μ_c)`. Newton's method with the normal equations of the bonds off the bound and a step
/// halved until the dual falls; without a bound its first step solves, the second is the refinement that restores lost digits.
pub(super) fn least_change(
    rows: &DMatrix<f64>,
    shares: &[f64],
    missing: &DVector<f64>,
    bound: Bound,
) -> Result<Vec<f64>, NotMet> {
    let conditions = rows.nrows();
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
    // A condition is judged against the magnitude of its own terms.
    let scales = DVector::from_fn(conditions, |c, _| {
        let terms: f64 = shares
            .iter()
            .enumerate()
            .map(|(k, d)| d * rows[(c, k)].abs())
            .sum();
        terms.max(missing[c].abs()).max(f64::MIN_POSITIVE)
    });
    let mut mu = DVector::zeros(conditions);
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut full_rank = 0;
    for step in 0..MOST_STEPS {
        let mut change = vec![0.0; shares.len()];
        let mut residual = missing.clone();
        let mut normal = DMatrix::zeros(conditions, conditions);
        for (k, &d) in shares.iter().enumerate() {
            if d == 0.0 {
                continue;
            }
            let t = free_change(&mu, k);
            change[k] = t.max(limit);
            let b = rows.column(k);
            residual.axpy(-d * change[k], &b, 1.0);
            if t > limit {
                normal.ger(d, &b, &b, 1.0);
            }
        }
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
        let (direction, rank) = solve_normal(&normal, &residual);
        if step == 0 {
            full_rank = rank;
        }
        let slope = residual.dot(&direction);
        let start = dual(&mu);
        let mut length = 1.0;
        if bound != Bound::Free && miss > 1e-8 {
            while length > 1e-6
                && dual(&(&mu + &direction * length)) > start - 1e-4 * length * slope
            {
                length *= 0.5;
            }
        }
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

/// The least-squares solution of least norm of the symmetric positive semi-definite `normal · x = rhs`, and its rank.
fn solve_normal(normal: &DMatrix<f64>, rhs: &DVector<f64>) -> (DVector<f64>, usize) {
    let n = rhs.len();
    if n == 0 {
        return (DVector::zeros(0), 0);
    }
    // Unit diagonal, so that the rank does not hang on the units of a condition.
    let scale = DVector::from_fn(n, |c, _| {
        let d = normal[(c, c)];
        if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }
    });
    let scaled = DMatrix::from_fn(n, n, |a, b| normal[(a, b)] * scale[a] * scale[b]);
    let eigen = SymmetricEigen::new(scaled);
    let largest = eigen.eigenvalues.amax();
    let mut x = DVector::zeros(n);
    let mut rank = 0;
    let projected = eigen.eigenvectors.tr_mul(&rhs.component_mul(&scale));
    for (e, &value) in eigen.eigenvalues.iter().enumerate() {
        if value > RANK_TOLERANCE * largest {
            rank += 1;
            x.axpy(projected[e] / value, &eigen.eigenvectors.column(e), 1.0);
        }
    }
    (x.component_mul(&scale), rank)
}
