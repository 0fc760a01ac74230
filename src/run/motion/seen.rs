//! Extremes of energy, rotation and strains in a run so far, which a checkpoint keeps.

use serde::{Deserialize, Serialize};

use crate::run::linear_parts::Passed;

/// Extremes so far: part of a checkpoint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// The largest energy or work so far.
    pub(super) largest: f64,
    /// First gain beyond [`TOLD`]: relative gain, step, time.
    pub(super) told: Option<(f64, u64, f64)>,
    /// The largest gain: relative gain, step, time.
    pub(super) most: Option<(f64, u64, f64)>,
    /// The largest rotation: degrees, cell, step, time, and the strain energy that it costs.
    pub(super) rotated: Option<Rotated>,
    /// Largest excesses over the limits of linear parts.
    pub(super) passed: Passed,
    /// The largest energy that load steps stored \[J\], and the norm of the prescribed displacements then \[m\].
    pub(super) largest_stored: (f64, f64),
}

/// An element that has rotated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Rotated {
    pub(super) degrees: f64,
    pub(super) place: [f64; 3],
    pub(super) step: u64,
    pub(super) time: f64,
    pub(super) energy: f64,
}
