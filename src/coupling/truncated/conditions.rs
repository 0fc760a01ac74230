//! Conditions on changes of a seam, as a sparse matrix.

/// Most iterations with factors, times the number of conditions: the cost of an iteration grows with it, to 0.6 s at 57 630 conditions.
const MOST_LED_CONDITIONS: usize = 10_000_000;

/// The same in the last attempt: 64 192 conditions have needed 250 iterations.
const MOST_LED_LAST: usize = 50_000_000;

/// Most iterations of the search for the residual that bounded changes cannot remove.
const MOST_GRADIENTS: usize = 20_000;

/// That search ends when its lower bound is this fraction of the residual.
const CLOSED: f64 = 0.98;

/// Conditions on changes, one column per change.
#[derive(Clone)]
pub(super) struct Conditions {
    pub(super) count: usize,
    pub(super) offsets: Vec<usize>,
    pub(super) rows: Vec<u32>,
    pub(super) values: Vec<f64>,
    /// First column whose change has no floor.
    pub(super) free: usize,
    /// Most iterations with factors, times the number of conditions.
    pub(super) most_led: usize,
}

impl Conditions {
    /// For so many conditions, without a change yet.
    pub fn new(count: usize) -> Self {
        Self {
            count,
            offsets: vec![0],
            rows: Vec::new(),
            values: Vec::new(),
            free: usize::MAX,
            most_led: MOST_LED_CONDITIONS,
        }
    }

    /// Sets all columns that follow to have no floor.
    pub fn free_from_here(&mut self) {
        self.free = self.changes();
    }

    /// Allows a longer search, in the last attempt.
    pub fn last(&mut self) {
        self.most_led = MOST_LED_LAST;
    }

    /// Adds what a change of 1 adds to one condition; belongs to the column that [`Conditions::close`] ends.
    pub fn add(&mut self, row: usize, value: f64) {
        self.rows.push(row as u32);
        self.values.push(value);
    }

    /// Ends a column.
    pub fn close(&mut self) {
        self.offsets.push(self.rows.len());
    }

    /// Number of conditions.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number of changes.
    pub fn changes(&self) -> usize {
        self.offsets.len() - 1
    }

    pub(super) fn column(&self, k: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.offsets[k]..self.offsets[k + 1];
        self.rows[range.clone()]
            .iter()
            .map(|&r| r as usize)
            .zip(self.values[range].iter().copied())
    }

    /// Returns the contribution of changes to every condition.
    pub fn sum(&self, change: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; self.count];
        for (k, &x) in change.iter().enumerate() {
            if x != 0.0 {
                for (r, v) in self.column(k) {
                    sum[r] += v * x;
                }
            }
        }
        sum
    }

    /// Returns the factors that bring every row to the norm 1; zero for rows of zeros.
    pub(super) fn row_scale(&self) -> Vec<f64> {
        let mut size = vec![0.0f64; self.count];
        for (&r, v) in self.rows.iter().zip(&self.values) {
            size[r as usize] += v * v;
        }
        let scale = |&s: &f64| if s > 0.0 { 1.0 / s.sqrt() } else { 0.0 };
        size.iter().map(scale).collect()
    }

    /// The same conditions with all rows brought to the same size, and what is wanted of them.
    pub(super) fn scaled(&self, target: &[f64]) -> (Self, Vec<f64>) {
        let scale = self.row_scale();
        let mut scaled = self.clone();
        for (&r, v) in self.rows.iter().zip(scaled.values.iter_mut()) {
            *v *= scale[r as usize];
        }
        let target = target.iter().zip(&scale).map(|(t, s)| t * s);
        (scaled, target.collect())
    }

    /// Returns the residual of the target under changes.
    pub(super) fn left(&self, target: &[f64], change: &[f64]) -> Vec<f64> {
        let sum = self.sum(change);
        target.iter().zip(sum).map(|(t, s)| t - s).collect()
    }

    /// The rank of the conditions, and the part of `target` that no change at all can reach: the norm of what is left, over that of the target. Rows are scaled to the same size.
    ///
    /// From all eigenvectors of `A Aᵀ`, so for some thousand conditions at most; singular values below 3e-7 of the largest count as zero.
    pub fn rank(&self, target: &[f64]) -> (usize, f64) {
        let scale = self.row_scale();
        let mut square = faer::Mat::<f64>::zeros(self.count, self.count);
        for k in 0..self.changes() {
            for (r, v) in self.column(k) {
                for (s, w) in self.column(k) {
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
        let target: Vec<f64> = target.iter().zip(&scale).map(|(t, s)| t * s).collect();
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

    /// A part of `target` that no change between `floor` and `most` can reach, a bound from below of the norm of what is left over that of the target; zero if none is found. Rows are scaled to the same size.
    ///
    /// For any `r`, `|t − A x| ≥ r·(t − A x)/|r|`, and `(Aᵀ r)·x` is largest with every `x` at one of its ends (Farkas' lemma). The `r` of the least squares is the best one; accelerated gradients, which restart when they
    /// overshoot, go there.
    pub fn out_of_reach(&self, target: &[f64], floor: f64, most: f64) -> f64 {
        let (scaled, target) = self.scaled(target);
        let whole = norm(&target).max(f64::MIN_POSITIVE);
        let left = |x: &[f64]| scaled.left(&target, x);
        // the largest eigenvalue of the normal equations is at most the largest sum of sizes along a row times that along a column
        let mut along = vec![0.0f64; self.count];
        let mut across = 0.0f64;
        for k in 0..self.changes() {
            let sizes = scaled.column(k).map(|(r, v)| {
                along[r] += v.abs();
                v.abs()
            });
            across = across.max(sizes.sum());
        }
        let curvature = across * along.iter().copied().fold(0.0, f64::max);
        let mut x = vec![0.0f64.clamp(floor, most); self.changes()];
        let (mut ahead, mut pace) = (x.clone(), 1.0f64);
        let (mut best, mut was) = (0.0f64, f64::INFINITY);
        for _ in 0..MOST_GRADIENTS {
            let gap = left(&ahead);
            let slope = scaled.transposed(&gap);
            let ends = slope
                .iter()
                .map(|g| g * if *g > 0.0 { most } else { floor });
            let size = norm(&gap);
            best = best.max((dot(&gap, &target) - ends.sum::<f64>()) / size);
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

pub(super) fn norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
