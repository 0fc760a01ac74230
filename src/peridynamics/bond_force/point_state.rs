//! Data of the pass over points that have a stress, and the history of a drag.

use super::point_loops::{Given, Sites};
use crate::{
    parallel,
    peridynamics::{ForceState, zero_energy::ZeroEnergyControl},
    system::Interval,
    tensor::{Tensor, Vector},
};

/// Numbers of a task that makes velocities.
const NUMBERS: usize = 4096;

/// Properties of a family that its deformation does not change, from its intact bonds.
#[derive(Clone, Copy)]
pub(super) struct Intact<const D: usize> {
    /// `K⁻¹`; none if they do not span the space.
    pub(super) inverse: Option<Tensor<D>>,
    /// `Σ ω ξ V` \[m^(D+1)\].
    pub(super) first: Vector<D>,
    /// Share of the family's volume whose bonds are broken.
    pub(super) damage: f64,
}

/// Data of the pass over points that have a stress.
pub(super) struct PointForces<const D: usize> {
    pub(super) control: ZeroEnergyControl,
    /// ω V of every bond, V of its far point; 0 of broken ones.
    pub(super) weight: Vec<f64>,
    /// The same with the ω that the far family gives to the bond, 0 if there is none; empty if all are equal.
    pub(super) back: Vec<f64>,
    pub(super) intact: Vec<Intact<D>>,
    /// Positions and displacements, and what bonds take from their far points, of the last force.
    pub(super) sites: Sites,
    pub(super) given: Given,
    /// The strength of the control of each point, but for a drag.
    pub(super) strength: Vec<f64>,
    /// `F̄ − I` of the last force.
    pub(super) gradient: Vec<Tensor<D>>,
    /// The own part of the force per volume.
    pub(super) own: Vec<Vector<D>>,
    pub(super) drag: Option<Drag>,
}

impl<const D: usize> PointForces<D> {
    /// For laws that have such points; the bonds as they stand are found by `Generic::recall_intact`.
    pub(super) fn new(states: &dyn ForceState<D>, points: usize) -> Option<Self> {
        let control = states.correspondence(None)?.control;
        let drags = control == ZeroEnergyControl::Drag;
        Some(Self {
            control,
            weight: Vec::new(),
            back: Vec::new(),
            intact: Vec::new(),
            sites: Sites::default(),
            given: Given::new::<D>(points, drags),
            strength: vec![0.0; points],
            gradient: vec![Tensor::zeros(); points],
            own: vec![Vector::zeros(); points],
            drag: drags.then(|| Drag::new(points * D)),
        })
    }

    /// ω V as the far ends of the bonds give it.
    pub(super) fn back(&self) -> &[f64] {
        match self.back.is_empty() {
            true => &self.weight,
            false => &self.back,
        }
    }

    pub(super) fn memory_bytes(&self) -> usize {
        (self.weight.len() + self.back.len()) * 8
            + self.intact.len() * std::mem::size_of::<Intact<D>>()
            + self.sites.memory_bytes()
            + self.given.memory_bytes()
            + self.strength.len() * 8
            + self.gradient.len() * std::mem::size_of::<Tensor<D>>()
            + self.own.len() * D * 8
            + self.drag.as_ref().map_or(0, Drag::memory_bytes)
    }
}

/// History of a drag, and its present values.
pub(super) struct Drag {
    /// Displacement and velocity that were committed last.
    before: Vec<f64>,
    velocity: Vec<f64>,
    /// Those of the last force.
    present: Vec<f64>,
    present_velocity: Vec<f64>,
}

impl Drag {
    pub(super) fn new(unknowns: usize) -> Self {
        let nothing = vec![0.0; unknowns];
        Self {
            before: nothing.clone(),
            velocity: nothing.clone(),
            present: nothing.clone(),
            present_velocity: nothing,
        }
    }

    /// Goes to the end of an interval; the velocities there.
    pub(super) fn moved(&mut self, u: &[f64], interval: Interval) -> &[f64] {
        self.present.copy_from_slice(u);
        match interval.length > 0.0 {
            true => {
                parallel::for_each_chunk(&mut self.present_velocity, NUMBERS, 1, |chunk, v| {
                    let start = chunk * NUMBERS;
                    let moved = u[start..].iter().zip(&self.before[start..]);
                    for (v, (now, before)) in v.iter_mut().zip(moved) {
                        *v = (now - before) / interval.length;
                    }
                });
            }
            false => self.present_velocity.clone_from(&self.velocity),
        }
        &self.present_velocity
    }

    pub(super) fn commit(&mut self) {
        self.before.clone_from(&self.present);
        self.velocity.clone_from(&self.present_velocity);
    }

    /// Returns the numbers kept in checkpoints.
    pub(super) fn kept(&self) -> impl Iterator<Item = &f64> {
        self.before.iter().chain(&self.velocity)
    }

    /// The same, to be put back.
    pub(super) fn kept_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.before.iter_mut().chain(&mut self.velocity)
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.before.len() * 32
    }
}
