//! Correspondence whose classical stress is that of a local law.

use std::sync::Arc;

use super::{Correspondence, Parameter};
use crate::{
    material::LocalLaw,
    peridynamics::{
        BondEnergy, DeformedFamily, EnergyDensity, ForceState, HistoryLayout, Law,
        LinearForceState, Past, PointStress, Present, ZeroEnergyControl,
        bond_force::{conjugate, felt},
        shape_tensor::spanned_inverse,
        zero_energy::excess_length,
    },
    tensor::{Tensor, Vector, determinant},
};

/// Correspondence with a [`LocalLaw`]: `F̄ − I = Ḡ K⁻¹`, `T⟨ξ⟩ = ω P(F̄) K⁻¹ ξ + q ω (η − (F̄ − I) ξ)`, the stabilising term that of bond forces, elastic, or another [`ZeroEnergyControl`].
///
/// Source: [SAND2015-7998] section 7.2 (after \[Silling2007\]) and eq. (6.30), (6.32), with the first Piola–Kirchhoff stress of any local law. Its linearisation is [`Correspondence`] with the same constants.
///
/// Broken bonds drop out of `F̄` and K (a point that has flowed keeps the deformation they had, [`DeformedFamily::carried`]), and the stress falls with the damage, `σ = (1 − D) σ₀` (section 6.3), or what bonds are left would carry more. A family whose intact bonds no longer span the space
/// ([`SPANNED`](crate::peridynamics::shape_tensor::SPANNED)), or that have turned inside out, has no deformation gradient: its point carries no stress of its own, and follows what the families of its neighbours do to it.
#[derive(Clone, Debug)]
pub struct LocalCorrespondence<const D: usize> {
    name: &'static str,
    linear: Correspondence<D>,
    local: Arc<dyn LocalLaw<D>>,
}

impl<const D: usize> LocalCorrespondence<D> {
    /// A law of this usual name; `linear` has the tangent of `local` at rest.
    pub fn new(name: &'static str, linear: Correspondence<D>, local: Arc<dyn LocalLaw<D>>) -> Self {
        Self {
            name,
            linear,
            local,
        }
    }

    /// The strength of the stabilising term, for scenes.
    pub const STABILISATION: Parameter = Parameter {
        key: "stabilisation",
        about: "Strength of the zero-energy control relative to the bonds of an LPS; 0 switches it off.",
        default: Some(1.0),
        least: 0.0,
        most: 1e6,
        usual: 1.0,
        words: &[],
    };

    /// What resists zero-energy modes, for scenes.
    pub const CONTROL: Parameter = Parameter::words(
        "zero-energy-control",
        "What resists deformations that are not uniform: a bond force, one by the lengths of bonds alone, or a drag (in explicit dynamics).",
        ZeroEnergyControl::WORDS,
    );
}

impl<const D: usize> Law<D> for LocalCorrespondence<D> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn linearised(&self) -> &dyn LinearForceState<D> {
        &self.linear
    }

    fn force_state(&self) -> Option<&dyn ForceState<D>> {
        Some(self)
    }

    fn local_law(&self) -> Option<Arc<dyn LocalLaw<D>>> {
        Some(Arc::clone(&self.local))
    }

    fn has_breakable_bonds(&self) -> bool {
        true
    }

    fn bond_energy(&self, _horizon: f64) -> Option<BondEnergy> {
        None
    }
}

/// `K⁻¹` of the intact bonds; none if they do not span the space.
fn inverse_shape<const D: usize>(family: &DeformedFamily<'_, D>) -> Option<Tensor<D>> {
    let whole = &family.state?.shape;
    if family.is_whole {
        return spanned_inverse(whole, None);
    }
    let mut left = Tensor::<D>::zeros();
    for (k, xi) in family.bonds.iter().enumerate() {
        left += xi * xi.transpose() * (family.omega[k] * family.volumes[k]);
    }
    spanned_inverse(whole, Some(&left))
}

/// `F̄ − I` of a family, and `K⁻¹`.
fn displacement_gradient<const D: usize>(
    family: &DeformedFamily<'_, D>,
) -> Option<(Tensor<D>, Tensor<D>)> {
    let shape = inverse_shape(family)?;
    let mut sum = Tensor::<D>::zeros();
    for (k, eta) in family.difference.iter().enumerate() {
        sum += eta * family.bonds[k].transpose() * (family.omega[k] * family.volumes[k]);
    }
    Some((sum * shape, shape))
}

impl<const D: usize> ForceState<D> for LocalCorrespondence<D> {
    fn history(&self) -> HistoryLayout {
        HistoryLayout {
            point: self.local.history(),
            bond: &[],
            damage: None,
        }
    }

    fn respond(
        &self,
        family: &DeformedFamily<'_, D>,
        step: f64,
        past: Past<'_>,
        present: Present<'_>,
        force: &mut [Vector<D>],
    ) -> EnergyDensity {
        let mut energy = EnergyDensity::default();
        let Some((gradient, shape)) = displacement_gradient(family) else {
            return energy;
        };
        // a family has a state, or the body would not have been made
        let Some(state) = family.state else {
            return energy;
        };
        let objective = self.local.is_objective();
        let felt = felt(&gradient, family.carried, objective);
        let local = (self.local).respond(&felt, step, past.point, present.point);
        if family.damage > 0.0 && !local.stored.is_finite() {
            // what is left of the family is turned inside out
            present.point.copy_from_slice(past.point);
            return energy;
        }
        if let Some(principal) = present.principal_stress {
            *principal = local.principal_stresses(&felt, objective);
        }
        let left = 1.0 - family.damage;
        energy.stored = left * local.stored;
        energy.dissipated = left * local.dissipated;
        let through = conjugate(&local.stress, family.carried, objective) * shape * left;
        for (k, force) in force.iter_mut().enumerate() {
            let (xi, eta, omega) = (family.bonds[k], family.difference[k], family.omega[k]);
            let (resisting, stored) = match self.linear.control {
                ZeroEnergyControl::BondForce => {
                    let beyond = eta - gradient * xi;
                    let resisting = beyond * state.stabilisation;
                    (resisting, 0.5 * resisting.dot(&beyond))
                }
                ZeroEnergyControl::Length => {
                    let excess = excess_length(&xi, &eta, &gradient, family.kinematics);
                    let size = state.control * excess;
                    (family.direction[k] * size, 0.5 * size * excess)
                }
                // it asks for velocities, which the pass has
                ZeroEnergyControl::Drag => (Vector::zeros(), 0.0),
            };
            *force = (through * xi + resisting) * omega;
            energy.stored += omega * stored * family.volumes[k];
        }
        energy
    }

    fn stress(
        &self,
        family: &DeformedFamily<'_, D>,
        past: Past<'_>,
        _force: &[Vector<D>],
    ) -> Tensor<D> {
        // the stabilising term has no part in it
        let Some((gradient, _)) = displacement_gradient(family) else {
            return Tensor::zeros();
        };
        let mut present = past.point.to_vec();
        let objective = self.local.is_objective();
        let felt = felt(&gradient, family.carried, objective);
        let found = (self.local).respond(&felt, 0.0, past.point, &mut present);
        found.cauchy(&felt, objective) * (1.0 - family.damage)
    }

    fn correspondence(&self, _material: Option<u16>) -> Option<PointStress<'_, D>> {
        Some(PointStress {
            law: self.local.as_ref(),
            control: self.linear.control,
        })
    }

    fn responds(&self, family: &DeformedFamily<'_, D>) -> bool {
        let gradient = displacement_gradient(family);
        gradient.is_some_and(|(g, _)| {
            let felt = felt(&g, family.carried, self.local.is_objective());
            determinant(&(Tensor::identity() + felt)) > 0.0
        })
    }

    fn is_objective(&self) -> bool {
        self.local.is_objective()
    }

    fn energy_ratio(&self, _s: f64) -> f64 {
        1.0
    }
}
