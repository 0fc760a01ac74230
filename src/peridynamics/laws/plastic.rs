//! Correspondence whose classical stress is that of J2 plasticity.

use std::sync::Arc;

use super::{Constants, Correspondence, NamedLaw, Parameter, Ratio};
use crate::{
    material::{J2, Kinematics, LocalLaw},
    peridynamics::{
        Accelerator, BondEnergy, DeformedFamily, EnergyDensity, ForceState, HistoryLayout, Law,
        LinearForceState, Past, Present,
    },
    tensor::{Tensor, Vector, inverse},
};

/// Correspondence with a [`LocalLaw`]: `F̄ − I = Ḡ K⁻¹`, `T⟨ξ⟩ = ω σ(F̄) K⁻¹ ξ + q ω (η − F̄ ξ)`, the stabilising term elastic.
///
/// Source: [SAND2015-7998] section 7.2 (after \[Silling2007\]), with the stress of [`J2`]. Its linearisation is [`Correspondence`].
#[derive(Clone, Debug)]
pub struct PlasticCorrespondence<const D: usize> {
    linear: Correspondence<D>,
    local: Arc<J2<D>>,
}

impl<const D: usize> NamedLaw<D> for PlasticCorrespondence<D> {
    const KEY: &'static str = "plastic-correspondence";
    const ABOUT: &'static str = "Correspondence with von Mises plasticity and linear isotropic hardening, for small strains.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = J2::<D>::KINEMATICS;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter {
            key: "yield-stress",
            about: "Equivalent stress at which the material begins to flow.",
            default: None,
            least: 1e-100,
            most: 1e100,
            usual: 0.1,
        },
        Parameter {
            key: "hardening-modulus",
            about: "Growth of the yield stress with the equivalent plastic strain.",
            default: Some(0.0),
            least: 0.0,
            most: 1e100,
            usual: 0.4,
        },
        Parameter {
            key: "stabilisation",
            about: "Strength of the stabilising bond force relative to an LPS; 0 switches it off.",
            default: Some(1.0),
            least: 0.0,
            most: 1e6,
            usual: 1.0,
        },
    ];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let Constants {
            lambda,
            shear,
            influence,
        } = constants;
        Arc::new(Self {
            linear: Correspondence::new(influence, lambda, shear, values[2]),
            local: Arc::new(J2::new(lambda, shear, values[0], values[1])),
        })
    }
}

impl<const D: usize> Law<D> for PlasticCorrespondence<D> {
    fn name(&self) -> &'static str {
        "plastic correspondence"
    }

    fn linearised(&self) -> &dyn LinearForceState<D> {
        &self.linear
    }

    fn force_state(&self) -> Option<&dyn ForceState<D>> {
        Some(self)
    }

    fn local_law(&self) -> Option<Arc<dyn LocalLaw<D>>> {
        Some(Arc::clone(&self.local) as _)
    }

    fn accelerator(&self) -> Option<Accelerator> {
        None
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn bond_energy(&self, _horizon: f64) -> Option<BondEnergy> {
        None
    }
}

impl<const D: usize> ForceState<D> for PlasticCorrespondence<D> {
    fn history(&self) -> HistoryLayout {
        HistoryLayout {
            point: self.local.history(),
            bond: &[],
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
        // a family has a shape tensor with an inverse, or the body would not have been made
        let Some(state) = family.state else {
            return energy;
        };
        let Some((shape, _)) = inverse(&state.shape) else {
            return energy;
        };
        let mut sum = Tensor::<D>::zeros();
        for (k, eta) in family.difference.iter().enumerate() {
            sum += eta * family.bonds[k].transpose() * (family.omega[k] * family.volumes[k]);
        }
        let gradient = sum * shape;
        let local = (self.local).respond(&gradient, step, past.point, present.point);
        energy.stored = local.stored;
        energy.dissipated = local.dissipated;
        let through = local.stress * shape;
        for (k, force) in force.iter_mut().enumerate() {
            let (xi, omega) = (family.bonds[k], family.omega[k]);
            let left = family.difference[k] - gradient * xi;
            let stabilising = left * state.stabilisation;
            *force = (through * xi + stabilising) * omega;
            energy.stored += 0.5 * omega * stabilising.dot(&left) * family.volumes[k];
        }
        energy
    }

    fn is_objective(&self) -> bool {
        false
    }

    fn energy_ratio(&self, _s: f64) -> f64 {
        1.0
    }
}
