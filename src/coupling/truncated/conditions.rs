//! Conditions on changes of a seam, as a sparse matrix.

/// Conditions on changes, one column per change.
#[derive(Clone)]
pub(super) struct Conditions {
    pub(super) count: usize,
    pub(super) offsets: Vec<usize>,
    pub(super) rows: Vec<u32>,
    pub(super) values: Vec<f64>,
    /// From this column on changes have no floor.
    pub(super) free: usize,
    /// Iterations with factors times conditions.
    pub(super) most_led: usize,
}

pub(super) fn norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
