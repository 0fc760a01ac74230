//! PL-, PA-, PV-PDLAMMPS: the family of the first algorithm, its last half spacing weighed by a ramp.

use super::{full, hhb};

/// `(δ − (|ξ| − h/2))/h` where `|ξ| + h/2 > δ`, one below, zero beyond the horizon; one half at `|ξ| = δ`.
///
/// Source: [SAND2015-7998] section 5.2.1, second algorithm.
pub(super) fn share(distance: f64, horizon: f64, h: f64, tie_tolerance: f64) -> f64 {
    full::share(distance, horizon, tie_tolerance) * hhb::share(distance, horizon, h)
}
