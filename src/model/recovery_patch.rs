//! Weights of recovered second derivatives, \[ZienkiewiczZhu1992\].

use crate::tensor::Vector;

/// Weights of the second derivatives in one element, about its centroid.
pub(crate) struct Patch<const D: usize> {
    pub centre: Vector<D>,
    pub size: f64,
    /// One entry per site: its weight for each second derivative `∂_b ∂_d u` (`b ≤ d`) times the square of the size.
    pub weights: Vec<(u32, Vec<f64>)>,
}
