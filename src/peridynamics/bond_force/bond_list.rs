//! Bonds as lists, with the data that their passes read.

use super::{
    BondKinematics,
    compressed_list::{Neighbours, Weights},
    softened_bonds::SoftenedBonds,
};

/// Limit of `t` beyond which bonds break.
pub(super) enum Limit {
    Never,
    Uniform(f64),
    PerBond(Vec<f64>),
}

/// Coefficients of the state-based law, per point.
pub(super) struct Solid {
    /// `D/m`.
    pub dilatation: Vec<f64>,
    /// `(D k − (D+2) μ)/m`.
    pub volumetric: Vec<f64>,
    /// `D (D+2) μ/m`.
    pub deviatoric: Vec<f64>,
    /// Dilatation of the pass at hand.
    pub(super) theta: Vec<f64>,
}

/// A bond pass over lists: two (or four) bytes of neighbour, eight (or four) of weight and one bit per directed bond.
pub(super) struct List<const D: usize> {
    pub position: Vec<[f64; D]>,
    pub volume: Vec<f64>,
    pub row: Vec<bool>,
    pub no_fail: Vec<bool>,
    pub offsets: Vec<usize>,
    pub neighbours: Neighbours,
    pub weights: Weights,
    pub limit: Limit,
    pub(super) kinematics: BondKinematics,
    pub solid: Option<Solid>,
    /// Start of each point's bits, which fill whole bytes.
    pub bytes: Vec<usize>,
    pub(super) intact: Vec<u8>,
    pub(super) reference: u64,
    /// Points and bonds that the last pass broke, ascending; empty if they soften.
    pub(super) last: Vec<(u32, usize)>,
    /// Bonds past the onset of softening, which have no bit; none if bonds break at once.
    pub(super) softened: Option<SoftenedBonds>,
    /// Quantities computed of each point, see `own_points.rs`; empty if all are.
    pub(super) parts: Vec<u8>,
    /// True if the last force at own points broke bonds of points whose breaks are found here.
    pub(super) has_seen_breaks: bool,
}
