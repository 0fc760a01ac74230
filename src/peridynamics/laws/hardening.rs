//! A bond whose stiffness grows, or falls, with the square of its stretch.

use std::sync::Arc;

use super::{BondBased, Constants, NamedLaw, Parameter, Ratio};
use crate::{
    material::{Kinematics, LocalLaw},
    peridynamics::{
        Accelerator, BondEnergy, DeformedFamily, Departure, EnergyDensity, ForceState,
        HistoryLayout, Law, LinearForceState, Linearity, Micromodulus, Parameters, Past,
        PointStress, Present, departure::stretch_of_cubic, largest_extension,
    },
    tensor::{Tensor, Vector},
};

/// Nonlinear elastic bonds, `T⟨ξ⟩ = ½ c s (1 + β s²) M` with the stretch `s = e/|ξ|` and the micromodulus `λ = c/|ξ|³`.
///
/// Source: none; prototype microelastic brittle, [SAND2015-7998] eq. (3.1), with a cubic term. Energy of a bond: `½ c |ξ| s² (1 + β s²/2)`. Its linearisation is the bond-based material.
#[derive(Clone, Debug)]
pub struct Hardening<const D: usize> {
    linear: BondBased<D>,
    beta: f64,
}

impl<const D: usize> NamedLaw<D> for Hardening<D> {
    const KEY: &'static str = "hardening";
    const ABOUT: &'static str =
        "Bonds that act alone and stiffen as they stretch: c s (1 + β s²) instead of c s.";
    const RATIO: Ratio = Ratio::Pairwise;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[Parameter {
        key: "hardening",
        about: "β: the force of a bond grows by β s² beyond proportion; negative values soften, down to −1/(3 s²) at the largest stretch s.",
        default: None,
        least: -1e6,
        most: 1e12,
        usual: 20.0,
        words: &[],
    }];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        Arc::new(Self {
            linear: BondBased::new(Micromodulus::InverseDistance, constants.shear),
            beta: values[0],
        })
    }
}

impl<const D: usize> Law<D> for Hardening<D> {
    fn name(&self) -> &'static str {
        "hardening bond"
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
        None
    }

    fn linearity(&self) -> Linearity {
        Linearity::AtRest
    }

    fn departure(&self, strain: &Tensor<D>, _time: f64) -> Departure {
        let largest = largest_extension(strain).max(largest_extension(&-strain));
        Departure::AtStrain {
            factor: largest / stretch_of_cubic(self.beta),
            begins: "the force of its bonds departs from proportion to their stretch by 5 %",
            in_elements: Some("peridynamics.elements = \"cauchy-born\""),
        }
    }

    fn has_breakable_bonds(&self) -> bool {
        true
    }

    fn parameters(&self) -> Parameters<'_, D> {
        Parameters::Typed
    }

    fn bond_energy(&self, horizon: f64) -> Option<BondEnergy> {
        self.linear.bond_energy(horizon)
    }
}

impl<const D: usize> ForceState<D> for Hardening<D> {
    fn history(&self) -> HistoryLayout {
        HistoryLayout::NONE
    }

    fn respond(
        &self,
        family: &DeformedFamily<'_, D>,
        _step: f64,
        _past: Past<'_>,
        _present: Present<'_>,
        force: &mut [Vector<D>],
    ) -> EnergyDensity {
        let mut stored = 0.0;
        for (k, force) in force.iter_mut().enumerate() {
            let (e, square) = (family.extension[k], family.bonds[k].norm_squared());
            let linear = family.pair[k] * square * e;
            let growth = self.beta * e * e / square;
            *force = family.direction[k] * (linear * (1.0 + growth));
            stored += 0.5 * linear * e * (1.0 + 0.5 * growth) * family.volumes[k];
        }
        EnergyDensity {
            stored,
            dissipated: 0.0,
        }
    }

    fn correspondence(&self, _material: Option<u16>) -> Option<PointStress<'_, D>> {
        None
    }

    fn is_objective(&self) -> bool {
        true
    }

    fn energy_ratio(&self, s: f64) -> f64 {
        1.0 + 0.5 * self.beta * s * s
    }
}
