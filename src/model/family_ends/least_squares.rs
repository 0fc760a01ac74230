//! Least squares of a sparse matrix by conjugate gradients on the normal equations (CGLS, \[Bjorck1996\] section 7.4.1), led by the factors of those of other scales.

use faer::sparse::{SparseColMat, Triplet};

use crate::{model::sparse_factors::SparseFactors, parallel};

/// Columns of a sparse matrix, and once they are all there its rows.
#[derive(Default)]
pub(super) struct Columns {
    pub rows: usize,
    /// Start of each column.
    pub offsets: Vec<usize>,
    pub entries: Vec<(u32, f64)>,
    /// Start of each row.
    of_rows: Vec<usize>,
    /// Columns and numbers of all rows.
    by_rows: Vec<(u32, f64)>,
}

impl Columns {
    pub fn new() -> Self {
        Self {
            offsets: vec![0],
            ..Self::default()
        }
    }

    /// Ends a column, whose entries were pushed.
    pub fn end(&mut self) {
        self.offsets.push(self.entries.len());
    }

    /// Ends the last column: products may follow.
    pub fn finish(&mut self) {
        let mut starts = vec![0; self.rows + 1];
        for (row, _) in &self.entries {
            starts[*row as usize + 1] += 1;
        }
        for r in 0..self.rows {
            starts[r + 1] += starts[r];
        }
        let mut next = starts.clone();
        self.by_rows = vec![(0, 0.0); self.entries.len()];
        for k in 0..self.offsets.len() - 1 {
            for &(row, a) in &self.entries[self.offsets[k]..self.offsets[k + 1]] {
                let place = &mut next[row as usize];
                self.by_rows[*place] = (k as u32, a);
                *place += 1;
            }
        }
        self.of_rows = starts;
    }

    /// A number of each row that counts, made of its entries; zero of others.
    fn of_each_row(
        &self,
        counts: &[bool],
        number: impl Fn(&[(u32, f64)]) -> f64 + Sync,
    ) -> Vec<f64> {
        parallel::map(self.rows, 64, |r| match counts[r] {
            true => number(&self.by_rows[self.of_rows[r]..self.of_rows[r + 1]]),
            false => 0.0,
        })
    }

    /// `A x`, of the rows that count.
    pub fn product(&self, x: &[f64], counts: &[bool]) -> Vec<f64> {
        self.of_each_row(counts, |row| {
            row.iter().map(|(k, a)| a * x[*k as usize]).sum()
        })
    }

    /// `S Aᵀ y`.
    fn transposed(&self, scale: &[f64], y: &[f64]) -> Vec<f64> {
        parallel::map(scale.len(), 256, |k| {
            let column = self.entries[self.offsets[k]..self.offsets[k + 1]].iter();
            scale[k] * column.map(|(row, a)| a * y[*row as usize]).sum::<f64>()
        })
    }

    /// The lower half of `A S² Aᵀ`, of the rows that count, with `damping²` and a little more on its diagonal, of short rows a part of the square of the `smallest`.
    fn normal(
        &self,
        scale: &[f64],
        counts: &[bool],
        (damping, smallest): (f64, f64),
    ) -> Option<SparseColMat<usize, f64>> {
        let row = |sums: &mut Vec<f64>, r: usize| {
            let mut touched = vec![r];
            let of = &self.by_rows[self.of_rows[r]..self.of_rows[r + 1]];
            for &(k, a) in of.iter().filter(|_| counts[r]) {
                let k = k as usize;
                let a = a * scale[k] * scale[k];
                for &(s, b) in &self.entries[self.offsets[k]..self.offsets[k + 1]] {
                    let s = s as usize;
                    if s <= r && counts[s] {
                        if sums[s] == 0.0 {
                            touched.push(s);
                        }
                        sums[s] += a * b;
                    }
                }
            }
            sums[r] += REGULAR * sums[r].max(smallest * smallest) + damping * damping;
            touched.sort_unstable();
            touched.dedup();
            let entry = |s: usize| Triplet::new(r, s, std::mem::take(&mut sums[s]));
            touched.into_iter().map(entry).collect::<Vec<_>>()
        };
        let entries = parallel::map_with(self.rows, 1, || vec![0.0; self.rows], row);
        SparseColMat::try_new_from_triplets(self.rows, self.rows, &entries.concat()).ok()
    }
}

/// Added to the diagonal of the normal equations, over what is there: conditions that follow from each other leave them singular.
const REGULAR: f64 = 1e-8;

/// The inverse of `A S² Aᵀ + damping²`, for the scales that it was made with: the metric in which residuals are measured.
pub(super) struct Metric(Option<SparseFactors>);

impl Metric {
    /// Rows shorter than the `smallest` need not be met.
    pub fn new(
        a: &Columns,
        scale: &[f64],
        counts: &[bool],
        (damping, smallest): (f64, f64),
    ) -> Self {
        let normal = a.normal(scale, counts, (damping, smallest));
        Self(normal.and_then(|normal| SparseFactors::new(&normal)))
    }

    /// The numbers themselves where there are no factors: then conjugate gradients take more iterations.
    fn applied(&self, values: &[f64]) -> Vec<f64> {
        match &self.0 {
            Some(factors) => factors.solved(values),
            None => values.to_vec(),
        }
    }
}

/// The least x, y for which `A S x + damping y` is b in the rows that count, of columns that are scaled by S, or comes nearest to it in the metric; b is zero in other rows. Returns x, and how many
/// iterations it took.
///
/// With damping, x is also what minimises `|A S x − b|² + damping² |x|²`. It ends where the residual of the normal equations is `tolerance` of that at the start, or after the `most`
/// iterations; with the metric of the same scales it takes one.
pub(super) fn least_squares(
    (a, metric): (&Columns, &Metric),
    scale: &[f64],
    b: &[f64],
    counts: &[bool],
    (damping, tolerance, most): (f64, f64, usize),
) -> (Vec<f64>, usize) {
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    // x, and y behind it where there is damping
    let columns = scale.len();
    let slope = |measured: &[f64]| {
        let mut slope = a.transposed(scale, measured);
        if damping > 0.0 {
            slope.extend(measured.iter().map(|m| damping * m));
        }
        slope
    };
    let image_of = |direction: &[f64]| {
        let (x, y) = direction.split_at(columns);
        let scaled: Vec<f64> = x.iter().zip(scale).map(|(d, s)| d * s).collect();
        let mut image = a.product(&scaled, counts);
        image.iter_mut().zip(y).for_each(|(i, y)| *i += damping * y);
        image
    };
    let mut measured = metric.applied(b);
    let mut direction = slope(&measured);
    let mut x = vec![0.0; columns];
    let mut size = dot(&direction, &direction);
    let enough = size * tolerance * tolerance;
    let mut iterations = 0;
    while size > enough && iterations < most {
        iterations += 1;
        let image = image_of(&direction);
        let of_image = metric.applied(&image);
        let step = size / dot(&image, &of_image);
        let pairs = x.iter_mut().zip(&direction);
        pairs.for_each(|(x, d)| *x += step * d);
        let pairs = measured.iter_mut().zip(&of_image);
        pairs.for_each(|(m, i)| *m -= step * i);
        let gradient = slope(&measured);
        let next = dot(&gradient, &gradient);
        let share = next / size;
        let pairs = direction.iter_mut().zip(&gradient);
        pairs.for_each(|(d, g)| *d = g + share * *d);
        size = next;
    }
    (x, iterations)
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    /// Conditions with random numbers.
    fn columns(rows: usize, count: usize, in_each: usize) -> Columns {
        let mut seed = 1u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1);
            (seed >> 33) as f64 / f64::from(1u32 << 31)
        };
        let mut columns = Columns::new();
        columns.rows = rows;
        for _ in 0..count {
            for _ in 0..in_each {
                let row = (random() * rows as f64) as u32;
                columns.entries.push((row, random() - 0.5));
            }
            columns.end();
        }
        columns.finish();
        columns
    }

    #[test]
    fn solutions_are_those_of_dense_algebra() {
        let a = columns(40, 90, 5);
        let scale: Vec<f64> = (0..90).map(|k| 0.5 + f64::from(k % 7) / 7.0).collect();
        let counts: Vec<bool> = (0..40).map(|r| r % 9 != 4).collect();
        let b: Vec<f64> = (0..40)
            .map(|r| f64::from(u8::from(counts[r])) * (r as f64).sin())
            .collect();
        let mut dense = DMatrix::<f64>::zeros(40, 90);
        for k in 0..90 {
            for &(r, v) in &a.entries[a.offsets[k]..a.offsets[k + 1]] {
                dense[(r as usize, k)] += f64::from(u8::from(counts[r as usize])) * v * scale[k];
            }
        }
        for damping in [0.0, 0.3] {
            let normal: DMatrix<f64> =
                &dense * dense.transpose() + DMatrix::identity(40, 40) * (damping * damping);
            let multiplier = normal
                .svd(true, true)
                .solve(&DVector::from(b.clone()), 1e-12);
            let wanted = dense.transpose() * multiplier.unwrap();
            // the scales of the metric, and others
            for other in [1.0, 0.6] {
                let of_metric: Vec<f64> = scale.iter().map(|s| s.powf(other)).collect();
                let metric = Metric::new(&a, &of_metric, &counts, (damping, 1e-3));
                let (found, iterations) =
                    least_squares((&a, &metric), &scale, &b, &counts, (damping, 1e-13, 60));
                let apart = (DVector::from(found) - &wanted).norm() / wanted.norm();
                assert!(apart < 1e-9, "{damping} {other} {apart:e}");
                assert!(
                    iterations < if other == 1.0 { 4 } else { 60 },
                    "{iterations}"
                );
            }
        }
    }

    #[test]
    fn bits_do_not_depend_on_the_number_of_threads() {
        let a = columns(1600, 9000, 8);
        let (scale, counts) = (vec![1.0; 9000], vec![true; 1600]);
        let b: Vec<f64> = (0..1600).map(|r| f64::from(r).cos()).collect();
        let of_threads = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| {
                let metric = Metric::new(&a, &scale, &counts, (0.1, 1e-3));
                least_squares((&a, &metric), &scale, &b, &counts, (0.1, 1e-3, 60)).0
            })
        };
        assert!(of_threads(1) == of_threads(2));
    }
}
