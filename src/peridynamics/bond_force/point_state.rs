//! What the pass over points that have a stress keeps, and what a drag remembers.

use crate::{
    peridynamics::{ForceState, zero_energy::ZeroEnergyControl},
    tensor::{Tensor, Vector},
};

/// What a family has whatever its deformation, by its intact bonds.
#[derive(Clone, Copy)]
pub(super) struct Intact<const D: usize> {
    /// `K⁻¹`; none if they do not span the space.
    pub(super) inverse: Option<Tensor<D>>,
    /// `Σ ω ξ V` \[m^(D+1)\].
    pub(super) first: Vector<D>,
    /// Share of the family's volume whose bonds are broken.
    pub(super) damage: f64,
}

/// What the bonds of a family take from their centre: `ω (B ξ + q η)`.
#[derive(Clone, Copy)]
pub(super) struct PointTensor<const D: usize> {
    pub(super) through: Tensor<D>,
    pub(super) strength: f64,
}

impl<const D: usize> PointTensor<D> {
    pub(super) const NONE: Self = Self {
        through: Tensor::<D>::from_array_storage(nalgebra::ArrayStorage([[0.0; D]; D])),
        strength: 0.0,
    };
}

/// What the pass keeps for it.
pub(super) struct PointForces<const D: usize> {
    pub(super) control: ZeroEnergyControl,
    /// ω V of every bond, V of its far point; 0 of broken ones.
    pub(super) weight: Vec<f64>,
    /// The same with the ω that the far family gives to the bond, 0 if there is none; empty if all are equal.
    pub(super) back: Vec<f64>,
    pub(super) intact: Vec<Intact<D>>,
    /// Of the last force.
    pub(super) tensor: Vec<PointTensor<D>>,
    /// `F̄ − I` of the last force.
    pub(super) gradient: Vec<Tensor<D>>,
    /// The own part of the force per volume.
    pub(super) own: Vec<Vector<D>>,
    pub(super) drag: Option<Drag<D>>,
}

impl<const D: usize> PointForces<D> {
    /// For laws that have such points; the bonds as they stand are found by `Generic::recall_intact`.
    pub(super) fn new(states: &dyn ForceState<D>, points: usize) -> Option<Self> {
        let control = states.correspondence(None)?.control;
        Some(Self {
            control,
            weight: Vec::new(),
            back: Vec::new(),
            intact: Vec::new(),
            tensor: vec![PointTensor::NONE; points],
            gradient: vec![Tensor::zeros(); points],
            own: vec![Vector::zeros(); points],
            drag: (control == ZeroEnergyControl::Drag).then(|| Drag::new(points)),
        })
    }

    /// ω V as the far ends of the bonds give it.
    pub(super) fn back(&self) -> &[f64] {
        match self.back.is_empty() {
            true => &self.weight,
            false => &self.back,
        }
    }

    /// The strength of a control that the tensors of the points do not hold.
    pub(super) fn strength(&self, i: usize) -> f64 {
        self.tensor[i].strength
    }

    pub(super) fn memory_bytes(&self) -> usize {
        (self.weight.len() + self.back.len()) * 8
            + self.intact.len() * std::mem::size_of::<Intact<D>>()
            + self.tensor.len() * std::mem::size_of::<PointTensor<D>>()
            + self.gradient.len() * std::mem::size_of::<Tensor<D>>()
            + self.own.len() * D * 8
            + self.drag.as_ref().map_or(0, Drag::memory_bytes)
    }
}

/// What a drag remembers, and what it finds.
pub(super) struct Drag<const D: usize> {
    /// Displacement and velocity that were committed last.
    pub(super) before: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    /// Those of the last force.
    pub(super) present: Vec<f64>,
    pub(super) present_velocity: Vec<f64>,
    /// The velocity gradient of each family, and its strength c, 0 where there is none.
    pub(super) rate: Vec<(Tensor<D>, f64)>,
}

impl<const D: usize> Drag<D> {
    pub(super) fn new(points: usize) -> Self {
        let nothing = vec![0.0; points * D];
        Self {
            before: nothing.clone(),
            velocity: nothing.clone(),
            present: nothing.clone(),
            present_velocity: nothing,
            rate: vec![(Tensor::zeros(), 0.0); points],
        }
    }

    pub(super) fn commit(&mut self) {
        self.before.clone_from(&self.present);
        self.velocity.clone_from(&self.present_velocity);
    }

    /// What it keeps in checkpoints.
    pub(super) fn kept(&self) -> impl Iterator<Item = &f64> {
        self.before.iter().chain(&self.velocity)
    }

    /// The same, to be put back.
    pub(super) fn kept_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.before.iter_mut().chain(&mut self.velocity)
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.before.len() * 32 + self.rate.len() * std::mem::size_of::<(Tensor<D>, f64)>()
    }
}
