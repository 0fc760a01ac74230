//! Rank and reach of the conditions on the energies of a seam.

use bondline::coupling::truncated::SeamConditions;
use rayon::prelude::*;

/// Iterations of the search for what bounded changes cannot reach.
const MOST_GRADIENTS: usize = 20_000;

/// That search ends when its bound is this near to what it has reached.
const CLOSED: f64 = 0.98;

/// Conditions on changes, one column per change.
#[derive(Clone)]
pub struct Conditions {
    target: Vec<f64>,
    columns: Vec<Vec<(usize, f64)>>,
}

impl Conditions {
    /// Those of a seam.
    pub fn of(seam: SeamConditions) -> Self {
        let SeamConditions {
            target, columns, ..
        } = seam;
        Self { target, columns }
    }

    /// Returns the factors that bring every row to the norm 1; zero for rows of zeros.
    fn row_scale(&self) -> Vec<f64> {
        let mut size = vec![0.0f64; self.target.len()];
        for &(r, v) in self.columns.iter().flatten() {
            size[r] += v * v;
        }
        let scale = |&s: &f64| if s > 0.0 { 1.0 / s.sqrt() } else { 0.0 };
        size.iter().map(scale).collect()
    }

    /// The same conditions with all rows brought to the same size.
    fn scaled(&self) -> Self {
        let scale = self.row_scale();
        let mut scaled = self.clone();
        for (r, v) in scaled.columns.iter_mut().flatten() {
            *v *= scale[*r];
        }
        let target = self.target.iter().zip(&scale);
        scaled.target = target.map(|(t, s)| t * s).collect();
        scaled
    }

    /// Returns the residual of the target under changes.
    fn left(&self, change: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; self.target.len()];
        for (column, &x) in self.columns.iter().zip(change) {
            if x != 0.0 {
                for &(r, v) in column {
                    sum[r] += v * x;
                }
            }
        }
        self.target.iter().zip(sum).map(|(t, s)| t - s).collect()
    }

    fn transposed(&self, multiplier: &[f64]) -> Vec<f64> {
        let columns = self.columns.par_iter().with_min_len(512);
        let product = columns.map(|column| column.iter().map(|&(r, v)| v * multiplier[r]).sum());
        product.collect()
    }

    /// The rank of the conditions, and the part of the target that no change at all can reach: the norm of what is left, over that of the target. Rows are scaled to the same size.
    ///
    /// From all eigenvectors of `A Aᵀ`, so for some thousand conditions at most; singular values below 3e-7 of the largest count as zero.
    pub fn rank(&self) -> (usize, f64) {
        let scale = self.row_scale();
        let count = self.target.len();
        let mut square = faer::Mat::<f64>::zeros(count, count);
        for column in &self.columns {
            for &(r, v) in column {
                for &(s, w) in column {
                    square[(r, s)] += scale[r] * v * scale[s] * w;
                }
            }
        }
        // an eigenvalue problem that does not converge has no rank
        let Ok(of) = square.self_adjoint_eigen(faer::Side::Lower) else {
            return (0, f64::NAN);
        };
        let values: Vec<f64> = of.S().column_vector().iter().copied().collect();
        let largest = values.iter().copied().fold(0.0, f64::max);
        let target: Vec<f64> = self.target.iter().zip(&scale).map(|(t, s)| t * s).collect();
        let mut rank = 0;
        let mut left = 0.0;
        for (k, value) in values.iter().enumerate() {
            if *value > 1e-13 * largest {
                rank += 1;
            } else {
                let vector = of.U().col(k);
                let along: f64 = vector.iter().zip(&target).map(|(v, t)| v * t).sum();
                left += along * along;
            }
        }
        let norm: f64 = target.iter().map(|t| t * t).sum();
        (rank, (left / norm.max(f64::MIN_POSITIVE)).sqrt())
    }

    /// A part of the target that no change between `floor` and `most` can reach, a bound from below of the norm of what is left over that of the target; zero if none is found. Rows are scaled to the same size.
    ///
    /// For any `r`, `|t − A x| ≥ r·(t − A x)/|r|`, and `(Aᵀ r)·x` is largest with every `x` at one of its ends (Farkas' lemma). The `r` of the least squares is the best one; accelerated gradients, which restart when they
    /// overshoot, go there.
    pub fn out_of_reach(&self, floor: f64, most: f64) -> f64 {
        let scaled = self.scaled();
        let target = &scaled.target;
        let whole = norm(target).max(f64::MIN_POSITIVE);
        let left = |x: &[f64]| scaled.left(x);
        // the largest eigenvalue of the normal equations is at most the largest sum of sizes along a row times that along a column
        let mut along = vec![0.0f64; target.len()];
        let mut across = 0.0f64;
        for column in &scaled.columns {
            let sizes = column.iter().map(|&(r, v)| {
                along[r] += v.abs();
                v.abs()
            });
            across = across.max(sizes.sum());
        }
        let curvature = across * along.iter().copied().fold(0.0, f64::max);
        let mut x = vec![0.0f64.clamp(floor, most); self.columns.len()];
        let (mut ahead, mut pace) = (x.clone(), 1.0f64);
        let (mut best, mut was) = (0.0f64, f64::INFINITY);
        for _ in 0..MOST_GRADIENTS {
            let gap = left(&ahead);
            let slope = scaled.transposed(&gap);
            let ends = slope
                .iter()
                .map(|g| g * if *g > 0.0 { most } else { floor });
            let size = norm(&gap);
            best = best.max((dot(&gap, target) - ends.sum::<f64>()) / size);
            if best >= CLOSED * size || size <= 1e-9 * whole {
                break;
            }
            let next: Vec<f64> = ahead
                .iter()
                .zip(&slope)
                .map(|(x, g)| (x + g / curvature).clamp(floor, most))
                .collect();
            let faster = 0.5 * (1.0 + (1.0 + 4.0 * pace * pace).sqrt());
            let push = if size > was {
                0.0
            } else {
                (pace - 1.0) / faster
            };
            pace = if size > was { 1.0 } else { faster };
            was = size;
            ahead = next
                .iter()
                .zip(&x)
                .map(|(n, x)| (n + push * (n - x)).clamp(floor, most))
                .collect();
            x = next;
        }
        best / whole
    }
}

fn norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn conditions(rows: &[&[f64]], target: &[f64]) -> Conditions {
        let column = |k: usize| rows.iter().map(|row| row[k]).enumerate().collect();
        Conditions {
            target: target.to_vec(),
            columns: (0..rows[0].len()).map(column).collect(),
        }
    }

    #[test]
    fn what_bounded_changes_cannot_reach() {
        // x + y = -3 with a floor of -0.9 leaves 1.2 of 3, and so does the same condition at any scale
        for size in [1.0, 1e5] {
            let c = |sum: f64| conditions(&[&[size, size]], &[sum * size]);
            let bound = c(-3.0).out_of_reach(-0.9, 1e3);
            assert!((0.39..=0.4 + 1e-12).contains(&bound), "{bound}");
            assert_eq!(c(3.0).out_of_reach(-0.9, 1e3), 0.0);
            // from above: 2 + 2 of 5
            let bound = c(5.0).out_of_reach(-0.9, 2.0);
            assert!((0.19..=0.2 + 1e-12).contains(&bound), "{bound}");
        }
        // two conditions against each other: 1 and 2 by the same number leave (1, -1)/2 of (1, 2)
        let c = conditions(&[&[1.0], &[1.0]], &[1.0, 2.0]);
        let bound = c.out_of_reach(-9.0, 9.0);
        assert!((0.3..=0.1f64.sqrt() + 1e-12).contains(&bound), "{bound}");
    }
}
