//! PL-, PA-, PV-HHB, after Hu, Ha and Bobaru: the ramp goes on to half a spacing beyond the horizon.

/// `(δ − (|ξ| − h/2))/h`, at least zero and at most one.
///
/// In 1D this is the exact length. Source: [SAND2015-7998] eq. (5.7) with the correction of the second algorithm.
pub(super) fn share(distance: f64, horizon: f64, h: f64) -> f64 {
    ((horizon - (distance - 0.5 * h)) / h).clamp(0.0, 1.0)
}
