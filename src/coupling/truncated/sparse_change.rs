//! The smallest change that meets many sparse linear conditions.

use faer::prelude::Solve;
use faer::sparse::linalg::solvers::Llt;
use faer::sparse::{SparseColMat, Triplet};
use rayon::prelude::*;

/// Steps of the dual Newton method.
const MOST_STEPS: usize = 20;

/// A step that leaves more than this part of the gap, without a floor in the way, shows conditions that contradict each other.
const STALLED: f64 = 0.5;

/// Iterations of the search for what bounded changes cannot reach.
const MOST_GRADIENTS: usize = 20_000;

/// That search ends when its bound is this near to what it has reached.
const CLOSED: f64 = 0.98;

/// Conditions from which on their normal equations are factorised: conjugate gradients alone take as many iterations as a long seam has points.
const FACTORISED: usize = 1000;

/// What is added to the diagonal of those, whose entries are 1: conditions may follow from each other.
const REGULAR: f64 = 1e-8;

/// Corrections by the factors after the last step, each of which has to leave less than [`STALLED`] of the gap.
const MOST_CORRECTIONS: usize = 10;

/// Iterations of conjugate gradients within a step.
const MOST_ITERATIONS: usize = 4000;

/// Conditions on changes, one column per change.
#[derive(Clone)]
pub(super) struct Conditions {
    count: usize,
    offsets: Vec<usize>,
    rows: Vec<u32>,
    values: Vec<f64>,
}

impl Conditions {
    /// For so many conditions, without a change yet.
    pub fn new(count: usize) -> Self {
        Self {
            count,
            offsets: vec![0],
            rows: Vec::new(),
            values: Vec::new(),
        }
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

    /// Number of changes.
    pub fn changes(&self) -> usize {
        self.offsets.len() - 1
    }

    fn column(&self, k: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.offsets[k]..self.offsets[k + 1];
        self.rows[range.clone()]
            .iter()
            .map(|&r| r as usize)
            .zip(self.values[range].iter().copied())
    }

    /// What changes add to every condition.
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

    /// What brings every row to the norm 1; nothing to rows of zeros.
    fn row_scale(&self) -> Vec<f64> {
        let mut size = vec![0.0f64; self.count];
        for (&r, v) in self.rows.iter().zip(&self.values) {
            size[r as usize] += v * v;
        }
        let scale = |&s: &f64| if s > 0.0 { 1.0 / s.sqrt() } else { 0.0 };
        size.iter().map(scale).collect()
    }

    /// The same conditions with all rows brought to the same size, and what is wanted of them.
    fn scaled(&self, target: &[f64]) -> (Self, Vec<f64>) {
        let scale = self.row_scale();
        let mut scaled = self.clone();
        for (&r, v) in self.rows.iter().zip(scaled.values.iter_mut()) {
            *v *= scale[r as usize];
        }
        let target = target.iter().zip(&scale).map(|(t, s)| t * s);
        (scaled, target.collect())
    }

    /// What changes leave of what is wanted.
    fn left(&self, target: &[f64], change: &[f64]) -> Vec<f64> {
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

    fn transposed(&self, multiplier: &[f64]) -> Vec<f64> {
        (0..self.changes())
            .into_par_iter()
            .with_min_len(512)
            .map(|k| self.column(k).map(|(r, v)| v * multiplier[r]).sum())
            .collect()
    }

    /// Minimises `½ Σ x²` subject to `A x = missing` and `x ≥ floor`.
    ///
    /// As for the weights of a family the dual is smooth, `x = max(floor, Aᵀ λ)`; Newton's method, its steps by conjugate gradients with the normal equations of the changes off
    /// the floor, led by the factors of those of all changes. What these leave is made up for by the factors alone, in `Aᵀ λ` itself. Where the conditions contradict each other or the floor, the change that came nearest is returned: the caller looks at what is still missing.
    pub fn least_change(&self, missing: &[f64], floor: f64) -> Vec<f64> {
        // all rows to the same size, or conjugate gradients take ages
        let (scaled, target) = self.scaled(missing);
        let goal = 1e-15 * norm(&target);
        let lifted = |z: &[f64]| -> Vec<f64> { z.iter().map(|z| z.max(floor)).collect() };
        let left = |x: &[f64]| scaled.left(&target, x);
        // the dual, to be made large
        let dual = |multiplier: &[f64], z: &[f64]| -> f64 {
            let penalty: f64 = z
                .iter()
                .map(|&z| {
                    if z >= floor {
                        0.5 * z * z
                    } else {
                        floor * (z - 0.5 * floor)
                    }
                })
                .sum();
            dot(multiplier, &target) - penalty
        };
        let mut multiplier = vec![0.0; self.count];
        let mut z = vec![0.0; self.changes()];
        let mut gap = left(&lifted(&z));
        let mut best = (norm(&gap), z.clone());
        let factors = scaled.factors();
        for _ in 0..MOST_STEPS {
            if best.0 <= goal {
                break;
            }
            let direction = scaled.newton_step(&gap, &z, floor, factors.as_ref());
            let rise = dot(&gap, &direction);
            if rise <= 0.0 {
                // conjugate gradients found nothing that leaves less
                break;
            }
            let (here, was) = (dual(&multiplier, &z), norm(&gap));
            let mut step = 1.0;
            let mut moved = false;
            while step > 1e-4 {
                let trial: Vec<f64> = multiplier
                    .iter()
                    .zip(&direction)
                    .map(|(m, d)| m + step * d)
                    .collect();
                let next = scaled.transposed(&trial);
                let changed = lifted(&next);
                let remaining = left(&changed);
                // near the end the dual is flat to round-off, the gap is not
                if norm(&remaining) < 0.9 * was || dual(&trial, &next) > here + 1e-4 * step * rise {
                    (multiplier, z, gap) = (trial, next, remaining);
                    moved = true;
                    break;
                }
                step *= 0.5;
            }
            if !moved {
                break;
            }
            let reached = norm(&gap);
            if reached < best.0 {
                best = (reached, z.clone());
            }
            if floor == f64::NEG_INFINITY && reached > STALLED * was {
                break;
            }
        }
        let (mut reached, mut z) = best;
        if let Some(factors) = &factors {
            for _ in 0..MOST_CORRECTIONS {
                let correction = scaled.transposed(&solved(factors, &left(&lifted(&z))));
                let next: Vec<f64> = z.iter().zip(correction).map(|(z, c)| z + c).collect();
                let remaining = norm(&left(&lifted(&next)));
                if remaining < STALLED * reached {
                    (reached, z) = (remaining, next);
                } else {
                    break;
                }
            }
        }
        lifted(&z)
    }

    /// The factors of the normal equations of all changes, if there are many; rows are those of norm 1.
    fn factors(&self) -> Option<Llt<usize, f64>> {
        if self.count < FACTORISED {
            return None;
        }
        let mut entries: Vec<Triplet<usize, usize, f64>> = (0..self.count)
            .map(|r| Triplet::new(r, r, REGULAR))
            .collect();
        for k in 0..self.changes() {
            for (r, v) in self.column(k) {
                let lower = self.column(k).filter(|&(s, _)| s <= r);
                entries.extend(lower.map(|(s, w)| Triplet::new(r, s, v * w)));
            }
        }
        // without factors all goes as before, and takes longer
        let normal = SparseColMat::try_new_from_triplets(self.count, self.count, &entries).ok()?;
        normal.sp_cholesky(faer::Side::Lower).ok()
    }

    /// Solves the normal equations of the changes off the floor as far as their residual falls; `factors` of those of all changes, where there are some, make that a matter of few iterations.
    fn newton_step(
        &self,
        gap: &[f64],
        z: &[f64],
        floor: f64,
        factors: Option<&Llt<usize, f64>>,
    ) -> Vec<f64> {
        let lead = |residual: &[f64]| match factors {
            Some(factors) => solved(factors, residual),
            None => residual.to_vec(),
        };
        let apply = |v: &[f64]| {
            let mut t = self.transposed(v);
            for (t, &z) in t.iter_mut().zip(z) {
                if z < floor {
                    *t = 0.0;
                }
            }
            self.sum(&t)
        };
        let mut solution = vec![0.0; gap.len()];
        let mut residual = gap.to_vec();
        let mut direction = lead(&residual);
        let mut size = dot(&residual, &direction);
        // conditions that follow from each other have directions of round-off alone, and the residual grows there once the rest is met
        let mut best = (dot(gap, gap), solution.clone());
        let goal = best.0 * 1e-20;
        for _ in 0..MOST_ITERATIONS {
            let along = apply(&direction);
            let curvature = dot(&direction, &along);
            // conditions that contradict each other have directions without any
            if dot(&residual, &residual) <= goal || curvature <= 1e-13 * dot(&direction, &direction)
            {
                break;
            }
            let step = size / curvature;
            for k in 0..solution.len() {
                solution[k] += step * direction[k];
                residual[k] -= step * along[k];
            }
            let left = dot(&residual, &residual);
            if left < best.0 {
                best = (left, solution.clone());
            }
            let led = lead(&residual);
            let next = dot(&residual, &led);
            let ratio = next / size;
            size = next;
            for (d, r) in direction.iter_mut().zip(&led) {
                *d = r + ratio * *d;
            }
        }
        best.1
    }
}

/// What solves the normal equations of all changes, but for what is added to their diagonal.
fn solved(factors: &Llt<usize, f64>, wanted: &[f64]) -> Vec<f64> {
    let mut solution = wanted.to_vec();
    let rows = solution.len();
    factors.solve_in_place(faer::MatMut::from_column_major_slice_mut(
        &mut solution,
        rows,
        1,
    ));
    solution
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

    fn conditions(rows: &[&[f64]]) -> Conditions {
        let mut c = Conditions::new(rows.len());
        for k in 0..rows[0].len() {
            for (r, row) in rows.iter().enumerate() {
                c.add(r, row[k]);
            }
            c.close();
        }
        c
    }

    #[test]
    fn smallest_change_by_hand() {
        // x + y = 2 and nothing else: (1, 1)
        let x = conditions(&[&[1.0, 1.0]]).least_change(&[2.0], -0.9);
        assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-14), "{x:?}");
        // x - y = 3 with a floor of -1/2: (5/2, -1/2)
        let x = conditions(&[&[1.0, -1.0]]).least_change(&[3.0], -0.5);
        assert!(
            (x[0] - 2.5).abs() < 1e-13 && (x[1] + 0.5).abs() < 1e-13,
            "{x:?}"
        );
        // the same condition twice, at another scale, does no harm
        let x = conditions(&[&[1.0, 2.0], &[1e6, 2e6]]).least_change(&[5.0, 5e6], -0.9);
        assert!(
            (x[0] - 1.0).abs() < 1e-13 && (x[1] - 2.0).abs() < 1e-13,
            "{x:?}"
        );
    }

    #[test]
    fn what_bounded_changes_cannot_reach() {
        // x + y = -3 with a floor of -0.9 leaves 1.2 of 3, and so does the same condition at any scale
        for size in [1.0, 1e5] {
            let c = conditions(&[&[size, size]]);
            let bound = c.out_of_reach(&[-3.0 * size], -0.9, 1e3);
            assert!((0.39..=0.4 + 1e-12).contains(&bound), "{bound}");
            assert_eq!(c.out_of_reach(&[3.0 * size], -0.9, 1e3), 0.0);
            // from above: 2 + 2 of 5
            let bound = c.out_of_reach(&[5.0 * size], -0.9, 2.0);
            assert!((0.19..=0.2 + 1e-12).contains(&bound), "{bound}");
        }
        // two conditions against each other: 1 and 2 by the same number leave (1, -1)/2 of (1, 2)
        let c = conditions(&[&[1.0], &[1.0]]);
        let bound = c.out_of_reach(&[1.0, 2.0], -9.0, 9.0);
        assert!((0.3..=0.1f64.sqrt() + 1e-12).contains(&bound), "{bound}");
    }

    #[test]
    fn a_long_chain_is_met() {
        // x_k+1 − x_k = b_k has the smallest solution whose sum is zero; conjugate gradients alone would take as many iterations as there are conditions
        let n = 12_000;
        let mut c = Conditions::new(n);
        for k in 0..=n {
            if k > 0 {
                c.add(k - 1, 1.0);
            }
            if k < n {
                c.add(k, -1.0);
            }
            c.close();
        }
        let b: Vec<f64> = (0..n).map(|k| (k as f64 * 0.01).sin() + 1e-3).collect();
        let x = c.least_change(&b, -1e6);
        let mut wanted = vec![0.0; n + 1];
        for k in 0..n {
            wanted[k + 1] = wanted[k] + b[k];
        }
        let mean = wanted.iter().sum::<f64>() / (n + 1) as f64;
        let size = wanted.iter().map(|w| (w - mean).abs()).fold(0.0, f64::max);
        for (x, w) in x.iter().zip(&wanted) {
            assert!((x - (w - mean)).abs() < 1e-9 * size, "{x} {w}");
        }
    }

    /// `x_k − 2 x_k+1 + x_k+2 + beside y_k = b_k`, of a sine: where `beside` is small the normal equations are singular to 1e-10 and less. Also what the largest gap of changes is, over the largest `b_k`.
    fn bent(n: usize, beside: f64) -> (Conditions, Vec<f64>, impl Fn(&[f64]) -> f64) {
        let mut c = Conditions::new(n);
        for k in 0..n + 2 {
            for (back, value) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                if k >= back && k - back < n {
                    c.add(k - back, value);
                }
            }
            c.close();
        }
        for k in 0..n {
            c.add(k, beside);
            c.close();
        }
        let at = |k: usize| (k as f64 * 0.01).sin();
        let b: Vec<f64> = (0..n)
            .map(|k| at(k) - 2.0 * at(k + 1) + at(k + 2))
            .collect();
        let largest = |v: &[f64]| v.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let (met, wanted) = (c.clone(), b.clone());
        let gap = move |x: &[f64]| largest(&met.left(&wanted, x)) / largest(&wanted);
        (c, b, gap)
    }

    #[test]
    fn nearly_dependent_conditions_are_met() {
        let n = 1200;
        let (c, b, gap) = bent(n, 0.0);
        let x = c.least_change(&b, f64::NEG_INFINITY);
        // 3e-7 without the corrections by the factors
        assert!(gap(&x) < 1e-10, "{}", gap(&x));
        // the smallest of all that meet them has no mean and no slope
        let mean = x.iter().sum::<f64>() / n as f64;
        let slope = x[..n + 2].iter().enumerate().map(|(k, x)| k as f64 * x);
        let slope = slope.sum::<f64>() / (n * n) as f64;
        assert!(mean.abs() < 1e-12 && slope.abs() < 1e-12, "{mean} {slope}");
    }

    #[test]
    fn nearly_dependent_conditions_are_met_on_a_floor() {
        let (n, beside, floor) = (1200, 1e-3, -0.08);
        let (c, b, gap) = bent(n, beside);
        let x = c.least_change(&b, floor);
        // 4e-9 without the corrections by the factors
        assert!(gap(&x) < 1e-11, "{}", gap(&x));
        let (bent, aside) = x.split_at(n + 2);
        let is_held: Vec<bool> = aside.iter().map(|&y| y <= floor).collect();
        let held = is_held.iter().filter(|h| **h).count();
        assert!((100..1000).contains(&held), "{held}");
        assert!(x.iter().all(|&x| x >= floor));
        // off the floor y_k is beside times a multiplier, and x their second difference
        for k in 2..n {
            if !is_held[k - 2..=k].contains(&true) {
                let wanted = (aside[k] - 2.0 * aside[k - 1] + aside[k - 2]) / beside;
                assert!((bent[k] - wanted).abs() < 1e-9, "{} {wanted}", bent[k]);
            }
        }
    }

    #[test]
    fn conditions_that_follow_from_others_are_met_on_a_floor() {
        // the sums of neighbouring conditions beside them
        let (n, floor) = (1200, -1e-4);
        let (alone, ..) = bent(n, 0.3);
        let mut c = Conditions::new(2 * n - 1);
        for k in 0..alone.changes() {
            for (r, v) in alone.column(k) {
                c.add(r, v);
                for sum in [r.wrapping_sub(1), r] {
                    if sum < n - 1 {
                        c.add(n + sum, v);
                    }
                }
            }
            c.close();
        }
        let mut b: Vec<f64> = (0..n)
            .map(|k| 1e-4 * ((k * k) as f64 * 0.7).sin())
            .collect();
        b.extend((0..n - 1).map(|k| b[k] + b[k + 1]).collect::<Vec<_>>());
        let x = c.least_change(&b, floor);
        let gap = norm(&c.left(&b, &x)) / norm(&b);
        // 1e-2 where the last iterate of conjugate gradients is taken, not the one with the least residual
        assert!(gap < 1e-10, "{gap}");
        let held = x.iter().filter(|&&x| x <= floor).count();
        assert!((100..1000).contains(&held) && x.iter().all(|&x| x >= floor));
    }

    #[test]
    fn contradictions_leave_a_gap() {
        let rows: [&[f64]; 2] = [&[1.0, 1.0], &[1.0, 1.0]];
        let x = conditions(&rows).least_change(&[1.0, 2.0], -0.9);
        let sum = conditions(&rows).sum(&x);
        let gap = (sum[0] - 1.0).abs().max((sum[1] - 2.0).abs());
        assert!((0.5 - 1e-12..0.7).contains(&gap), "{sum:?}");
        // a thousand, each wanted to be two values that are 0.01 apart: half of that is left
        let n = 1000;
        let mut c = Conditions::new(2 * n);
        for k in 0..=n {
            for copy in [0, n] {
                if k > 0 {
                    c.add(copy + k - 1, 1.0);
                }
                if k < n {
                    c.add(copy + k, -1.0);
                }
            }
            c.close();
        }
        let b: Vec<f64> = (0..2 * n)
            .map(|k| ((k % n) as f64 * 0.01).sin() + if k < n { 0.0 } else { 0.01 })
            .collect();
        let left = c.left(&b, &c.least_change(&b, f64::NEG_INFINITY));
        let gap = left.iter().map(|l| l.abs()).fold(0.0, f64::max);
        assert!((0.005 - 1e-12..0.0055).contains(&gap), "{gap}");
        // a floor in the way
        let rows: [&[f64]; 1] = [&[1.0, 1.0]];
        let x = conditions(&rows).least_change(&[-3.0], -0.9);
        assert!((conditions(&rows).sum(&x)[0] + 1.8).abs() < 1e-12, "{x:?}");
    }
}
