//! Deformation that breaking bonds take from the deformation gradient of a point that has flowed plastically.
//!
//! `F̄` is a least-squares fit over intact bonds. When bonds break it jumps, since those that break are the longest; a point that remembers its plastic strain would take the jump for elastic strain, and be compressed by it.
//! So the deformation that the broken bonds had is kept: the local law is evaluated at `F̄ C`, and each break turns C into `F̄₊⁻¹ F̄₋ C`, by which `F̄ C` and the stress do not jump (in small strains `G + C`, a sum).
//! The stress that works on `F̄` is then `P Cᵀ`. A point that has not flowed keeps nothing of its broken bonds: its stress is that of its intact ones.

use super::bond_failure::BondFailure;
use crate::{
    peridynamics::{HistoryLayout, force_state::PLASTIC_STRAIN},
    tensor::Tensor,
};

/// C of every point, less the identity, and what it was before the last break.
pub(super) struct CarriedDeformation<const D: usize> {
    /// The place of the plastic strain in a point's history.
    pub(super) place: usize,
    pub(super) kept: Vec<Tensor<D>>,
    /// Points whose bonds the last pass broke, with C before.
    pub(super) before: Vec<(u32, Tensor<D>)>,
}

impl<const D: usize> CarriedDeformation<D> {
    /// None if nothing flows, or nothing breaks.
    pub(super) fn new(
        layout: &HistoryLayout,
        failure: &BondFailure,
        points: usize,
    ) -> Option<Self> {
        let place = layout.point.iter().position(|n| *n == PLASTIC_STRAIN)?;
        (!matches!(failure, BondFailure::Never)).then(|| Self {
            place,
            kept: vec![Tensor::zeros(); points],
            before: Vec::new(),
        })
    }

    /// The numbers of a checkpoint.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &f64> {
        self.kept.iter().flat_map(|c| c.iter())
    }

    /// The same, to be put back.
    pub(super) fn numbers_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.kept.iter_mut().flat_map(|c| c.iter_mut())
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.kept.len() * D * D * 8
    }
}

/// The displacement gradient at which a local law is evaluated: `(I + G)(I + c) − I` of one for strains of any size, else `G + c`.
pub(crate) fn felt<const D: usize>(
    gradient: &Tensor<D>,
    carried: Option<&Tensor<D>>,
    is_objective: bool,
) -> Tensor<D> {
    match carried {
        Some(c) if is_objective => gradient + c + gradient * c,
        Some(c) => gradient + c,
        None => *gradient,
    }
}

/// Returns the stress that is work-conjugate to the gradient of the intact bonds, from the stress at [`felt`].
pub(crate) fn conjugate<const D: usize>(
    stress: &Tensor<D>,
    carried: Option<&Tensor<D>>,
    is_objective: bool,
) -> Tensor<D> {
    match carried {
        Some(c) if is_objective => stress + stress * c.transpose(),
        _ => *stress,
    }
}
