//! Correspondence whose classical stress is that of a local law.

use std::sync::Arc;

use super::{Correspondence, Parameter};
use crate::{
    material::LocalLaw,
    peridynamics::{
        Accelerator, BondEnergy, Calibrate, CauchyStress, DeformedFamily, Departure, EnergyDensity,
        ForceState, HistoryLayout, KeptDamage, Law, LinearForceState, Linearity, Parameters, Past,
        PointStress, Present, ZeroEnergyControl,
        bond_force::{conjugate, felt},
        departure,
        shape_tensor::spanned_inverse,
        softening::{CalibrationError, RegularFamily},
        zero_energy::{control_left, excess_length},
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
    /// `local` within the crack band of the lattice, of a law that softens.
    band: Option<Band<D>>,
}

/// A law that softens, within the crack band of a lattice.
#[derive(Clone, Debug)]
struct Band<const D: usize> {
    width: f64,
    law: Arc<dyn LocalLaw<D>>,
}

impl<const D: usize> LocalCorrespondence<D> {
    /// A law of this usual name; `linear` has the tangent of `local` at rest.
    pub fn new(name: &'static str, linear: Correspondence<D>, local: Arc<dyn LocalLaw<D>>) -> Self {
        Self {
            name,
            linear,
            local,
            band: None,
        }
    }

    /// The law of points.
    fn law(&self) -> &dyn LocalLaw<D> {
        self.band.as_ref().map_or(&*self.local, |band| &*band.law)
    }

    /// Choice of the zero-energy control in scenes.
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

    fn accelerator(&self) -> Option<Accelerator> {
        None
    }

    fn local_law(&self) -> Option<Arc<dyn LocalLaw<D>>> {
        Some(Arc::clone(&self.local))
    }

    fn linearity(&self) -> Linearity {
        Linearity::AtRest
    }

    fn departure(&self, strain: &Tensor<D>, time: f64) -> Departure {
        departure::of_local_law(self.law(), strain, time)
    }

    /// Not of a law that softens: it loses its stiffness before.
    fn has_breakable_bonds(&self) -> bool {
        self.local.history().damage.is_none()
    }

    fn parameters(&self) -> Parameters<'_, D> {
        match self.local.history().damage {
            Some(_) => Parameters::OfLattice(self),
            None => Parameters::Typed,
        }
    }

    fn bond_energy(&self, _horizon: f64) -> Option<BondEnergy> {
        None
    }
}

/// A law that softens has the crack band of a lattice: a crack along its layers damages every family that it crosses through, and each of them takes the energy of its volume. That is `2 n h` for layers of the spacing h, n of which have bonds of weight ω > 0 to one of them.
impl<const D: usize> Calibrate<D> for LocalCorrespondence<D> {
    fn to_lattice(
        &self,
        family: &RegularFamily<'_, D>,
    ) -> Result<Arc<dyn Law<D>>, CalibrationError> {
        let omega = |xi: &Vector<D>| self.linear.influence.value(xi.norm(), family.horizon);
        let bonds = family.bonds.iter().map(|(xi, _)| xi);
        let largest = bonds.clone().map(omega).fold(0.0, f64::max);
        let reach = bonds
            .filter(|xi| omega(xi) > NO_WEIGHT * largest)
            .fold(0.0f64, |reach, xi| reach.max(xi[0].abs()));
        let width = 2.0 * reach;
        let Some(law) = self.local.in_band(width) else {
            return Ok(Arc::new(self.clone()));
        };
        let law = law.map_err(|source| CalibrationError::Band {
            horizon: family.horizon,
            largest: family.horizon * source.widest / width,
            source,
        })?;
        Ok(Arc::new(Self {
            band: Some(Band { width, law }),
            ..self.clone()
        }))
    }

    fn found(&self) -> Option<String> {
        let band = self.band.as_ref()?;
        Some(format!(
            "points soften within a crack band of the width {:.4e}: a crack damages every family that it crosses",
            band.width
        ))
    }

    fn elastic_limit(&self) -> Option<f64> {
        None
    }
}

/// Part of the largest weight of a bond below which it counts as none.
const NO_WEIGHT: f64 = 1e-9;

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
        let history = self.local.history();
        HistoryLayout {
            point: history.names,
            bond: &[],
            damage: history.damage.map(KeptDamage::Point),
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
        // without its band a law that softens keeps the damage that it has
        let law = match family.keeps_damage {
            true => &*self.local,
            false => self.law(),
        };
        let objective = law.is_objective();
        let felt = felt(&gradient, family.carried, objective);
        let local = law.respond(&felt, step, past.point, present.point);
        let fades = |point: &[f64]| law.history().damage.map_or(1.0, |d| control_left(point[d]));
        let (fade, faded) = (fades(past.point), fades(present.point));
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
                    let resisting = beyond * (fade * state.stabilisation);
                    (resisting, 0.5 * resisting.dot(&beyond))
                }
                ZeroEnergyControl::Length => {
                    let excess = excess_length(&xi, &eta, &gradient, family.kinematics);
                    let size = fade * state.control * excess;
                    (family.direction[k] * size, 0.5 * size * excess)
                }
                // it asks for velocities, which the pass has
                ZeroEnergyControl::Drag => (Vector::zeros(), 0.0),
            };
            *force = (through * xi + resisting) * omega;
            let stored = omega * stored * family.volumes[k];
            energy.stored += stored;
            if faded < fade {
                energy.dissipated += (1.0 - faded / fade) * stored;
            }
        }
        energy
    }

    /// `(1 − D) J⁻¹ P(F̄) F̄ᵀ`: the zero-energy control has no part in it.
    fn stress(
        &self,
        family: &DeformedFamily<'_, D>,
        past: Past<'_>,
        _force: &[Vector<D>],
    ) -> CauchyStress<D> {
        let Some((gradient, _)) = displacement_gradient(family) else {
            return CauchyStress::zero();
        };
        let mut present = past.point.to_vec();
        let objective = self.local.is_objective();
        let felt = felt(&gradient, family.carried, objective);
        let found = (self.law()).respond(&felt, 0.0, past.point, &mut present);
        let left = 1.0 - family.damage;
        CauchyStress {
            tensor: found.cauchy(&felt, objective) * left,
            across: Some(found.across * left),
        }
    }

    fn correspondence(&self, _material: Option<u16>) -> Option<PointStress<'_, D>> {
        Some(PointStress {
            law: self.law(),
            keeping: self.band.as_ref().map(|_| &*self.local),
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
