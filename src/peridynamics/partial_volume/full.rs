//! FL, FA, FV: full lengths, areas, volumes.

/// One within the horizon, a tie included, else zero.
///
/// Source: [SAND2015-7998] eq. (5.6).
pub(super) fn share(distance: f64, horizon: f64, tie_tolerance: f64) -> f64 {
    if distance <= horizon * (1.0 + tie_tolerance) {
        1.0
    } else {
        0.0
    }
}
