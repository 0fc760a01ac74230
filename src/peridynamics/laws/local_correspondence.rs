//! Correspondence whose classical stress is that of a local law.

use std::sync::Arc;

use super::{Correspondence, Parameter};
use crate::{
    material::LocalLaw,
    peridynamics::{
        Accelerator, BondEnergy, DeformedFamily, EnergyDensity, ForceState, HistoryLayout, Law,
        LinearForceState, Past, Present,
    },
    tensor::{Tensor, Vector, inverse},
};

/// Correspondence with a [`LocalLaw`]: `F̄ − I = Ḡ K⁻¹`, `T⟨ξ⟩ = ω P(F̄) K⁻¹ ξ + q ω (η − (F̄ − I) ξ)`, the stabilising term elastic.
///
/// Source: [SAND2015-7998] section 7.2 (after \[Silling2007\]), with the first Piola–Kirchhoff stress of any local law. Its linearisation is [`Correspondence`] with the same constants.
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
        about: "Strength of the stabilising bond force relative to an LPS; 0 switches it off.",
        default: Some(1.0),
        least: 0.0,
        most: 1e6,
        usual: 1.0,
        words: &[],
    };
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

/// `F̄ − I` of a family, and `K⁻¹`.
fn displacement_gradient<const D: usize>(
    family: &DeformedFamily<'_, D>,
) -> Option<(Tensor<D>, Tensor<D>)> {
    let (shape, _) = inverse(&family.state?.shape)?;
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
        let found = (self.local).respond(&gradient, 0.0, past.point, &mut present);
        found.cauchy(&gradient, self.local.is_objective())
    }

    fn is_objective(&self) -> bool {
        self.local.is_objective()
    }

    fn energy_ratio(&self, _s: f64) -> f64 {
        1.0
    }
}
