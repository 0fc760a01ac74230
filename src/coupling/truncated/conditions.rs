//! Conditions on changes of a seam, as a sparse matrix.

/// Most iterations with factors, times the number of conditions: the cost of an iteration grows with it, to 0.6 s at 57 630 conditions.
const MOST_LED_CONDITIONS: usize = 10_000_000;

/// The same in the last attempt: 64 192 conditions have needed 250 iterations.
const MOST_LED_LAST: usize = 50_000_000;

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

    /// The same conditions with all rows brought to the norm 1, rows of zeros aside, and what is wanted of them.
    pub(super) fn scaled(&self, target: &[f64]) -> (Self, Vec<f64>) {
        let mut size = vec![0.0f64; self.count];
        for (&r, v) in self.rows.iter().zip(&self.values) {
            size[r as usize] += v * v;
        }
        let scale = |&s: &f64| if s > 0.0 { 1.0 / s.sqrt() } else { 0.0 };
        let scale: Vec<f64> = size.iter().map(scale).collect();
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
}

pub(super) fn norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
