//! Exact lengths in 1D.

/// Length of `[low, high] ∩ [−radius, radius]`.
pub(super) fn interval(low: f64, high: f64, radius: f64) -> f64 {
    (high.min(radius) - low.max(-radius)).max(0.0)
}
