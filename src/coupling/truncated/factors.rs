//! Factors of the normal equations of conditions, and what they cost.

use faer::sparse::{SparseColMat, Triplet};

use super::normal::Dense;
use crate::coupling::truncated::conditions::{Conditions, norm};
use crate::{model::sparse_factors::SparseFactors, parallel};

/// Conditions from which on their normal equations are factorised: conjugate gradients alone take as many iterations as a long seam has points.
const FACTORISED: usize = 300;

/// Regularisation added to the diagonal of the normal equations, whose entries are 1: conditions may follow from each other.
const REGULAR: f64 = 1e-8;

/// Conditions up to which factors of a step are dense.
const DENSE: usize = 2500;

/// Conditions from which on the cost of their factors is asked for: below it is seconds.
const MANY: usize = 20_000;

impl Conditions {
    /// Operations that the factors of the normal equations of all changes take, a bound from below; zero for few conditions.
    pub fn operations(&self) -> f64 {
        if self.count < MANY {
            return 0.0;
        }
        let Some(normal) = self.normal(|_| true) else {
            return 0.0;
        };
        // the sum of the squares of all columns of the factor is least where they have the same length
        let entries = SparseFactors::entries(&normal);
        entries.map_or(0.0, |n| (n as f64).powi(2) / self.count as f64)
    }

    /// The factors of the normal equations of the changes that count, if there are many; rows are those of norm 1.
    pub(super) fn factors(&self, counts: impl Fn(usize) -> bool + Sync) -> Option<SparseFactors> {
        if self.count < FACTORISED {
            return None;
        }
        SparseFactors::new(&self.normal(counts)?)
    }

    /// The normal equations of the changes that count.
    fn normal(&self, counts: impl Fn(usize) -> bool + Sync) -> Option<SparseColMat<usize, f64>> {
        let mut of_row: Vec<Vec<(usize, f64)>> = vec![Vec::new(); self.count];
        for k in (0..self.changes()).filter(|&k| counts(k)) {
            for (r, v) in self.column(k) {
                of_row[r].push((k, v));
            }
        }
        // a row at a time: a change of a trace has a hundred entries, and its square ten thousand
        let entries = parallel::map_with(
            self.count,
            1,
            || vec![0.0; self.count],
            |sums: &mut Vec<f64>, r| {
                let mut touched = vec![r];
                sums[r] = REGULAR;
                for &(k, v) in &of_row[r] {
                    for (s, w) in self.column(k).filter(|&(s, _)| s <= r) {
                        if sums[s] == 0.0 {
                            touched.push(s);
                        }
                        sums[s] += v * w;
                    }
                }
                touched.sort_unstable();
                touched.dedup();
                let row = touched
                    .iter()
                    .map(|&s| Triplet::new(r, s, std::mem::take(&mut sums[s])));
                row.collect::<Vec<_>>()
            },
        );
        let entries: Vec<Triplet<usize, usize, f64>> = entries.concat();
        // without factors all goes as before, and takes longer
        SparseColMat::try_new_from_triplets(self.count, self.count, &entries).ok()
    }

    /// Solves the normal equations of the changes off the floor, with as much added to their diagonal as still tells conditions apart.
    pub(super) fn direct_step(
        &self,
        gap: &[f64],
        whole: f64,
        is_free: impl Fn(usize) -> bool + Sync,
    ) -> Option<Vec<f64>> {
        let n = self.count;
        if n > DENSE {
            return Some(self.factors(is_free)?.solved(gap));
        }
        let mut normal = vec![0.0; n * n];
        for k in (0..self.changes()).filter(|&k| is_free(k)) {
            for (r, v) in self.column(k) {
                for (s, w) in self.column(k).filter(|&(s, _)| s >= r) {
                    normal[r * n + s] += v * w;
                }
            }
        }
        let regular = (REGULAR * norm(gap) / whole).clamp(1e-12, REGULAR);
        for r in 0..n {
            normal[r * n + r] += regular;
        }
        Some(Dense::new(n, normal)?.solved(gap))
    }
}
