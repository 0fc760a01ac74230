//! A bond of a spring beside a Maxwell arm: viscoelastic, with one relaxation time.

use std::sync::Arc;

use super::{BondBased, Constants, NamedLaw, Parameter, Ratio};
use crate::{
    material::{Arm, Kinematics, LocalLaw},
    peridynamics::{
        Accelerator, BondEnergy, DeformedFamily, Departure, EnergyDensity, ForceState,
        HistoryLayout, Law, LinearForceState, Linearity, Micromodulus, Parameters, Past,
        PointStress, Present,
    },
    tensor::{Tensor, Vector},
};

/// Standard linear solid, bond by bond: `T = ½ c [(1 − g) s + g q] M`, `q̇ = ṡ − q/τ`.
///
/// Source: [SAND2015-7998] section 4.3 has one arm of it at work in an LPS; here it is the whole force of a bond. At once it is the bond-based material with Young's modulus E, in the end with `(1 − g) E`.
/// `q` is updated exactly for a stretch that is linear over the step.
#[derive(Clone, Debug)]
pub struct Maxwell<const D: usize> {
    linear: BondBased<D>,
    /// The share g of the arm.
    share: f64,
    /// τ \[s\].
    time: f64,
}

impl<const D: usize> NamedLaw<D> for Maxwell<D> {
    const KEY: &'static str = "viscoelastic-bond";
    const ABOUT: &'static str = "Bonds that act alone, each a spring beside one Maxwell arm; the constants are those at once.";
    const RATIO: Ratio = Ratio::Pairwise;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter {
            key: "relaxing-share",
            about: "Part g of the stiffness that relaxes: in the end (1 − g) of it is left.",
            default: None,
            least: 0.0,
            most: 1.0,
            usual: 0.4,
            words: &[],
        },
        Parameter {
            key: "relaxation-time",
            about: "Relaxation time τ of that part.",
            default: None,
            least: 1e-100,
            most: 1e100,
            usual: 0.7,
            words: &[],
        },
    ];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        Arc::new(Self {
            linear: BondBased::new(Micromodulus::InverseDistance, constants.shear),
            share: values[0],
            time: values[1],
        })
    }
}

impl<const D: usize> Law<D> for Maxwell<D> {
    fn name(&self) -> &'static str {
        "viscoelastic bond"
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

    fn departure(&self, _strain: &Tensor<D>, time: f64) -> Departure {
        Departure::WithTime {
            lost: self.share * (1.0 - (-time / self.time).exp()),
            in_elements: Some("the material viscoelastic-correspondence, whose elements relax"),
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

impl<const D: usize> ForceState<D> for Maxwell<D> {
    fn history(&self) -> HistoryLayout {
        HistoryLayout {
            point: &[],
            bond: &["stretch", "stretch of the spring in the arm"],
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
        let arm = Arm::over(step, self.time);
        let mut energy = EnergyDensity::default();
        let bonds = past
            .bonds
            .chunks_exact(2)
            .zip(present.bonds.chunks_exact_mut(2));
        for (k, (past, present)) in bonds.enumerate() {
            let r = family.bonds[k].norm();
            let s = family.extension[k] / r;
            let (q, spent) = arm.follow(past[1], s - past[0]);
            present.copy_from_slice(&[s, q]);
            // p r³ = c/2 per bond and volume
            let half = family.pair[k] * r * r * r;
            force[k] = family.direction[k] * (half * ((1.0 - self.share) * s + self.share * q));
            let weight = half * r * family.volumes[k];
            energy.stored += 0.5 * weight * ((1.0 - self.share) * s * s + self.share * q * q);
            energy.dissipated += weight * self.share * spent;
        }
        energy
    }

    fn correspondence(&self, _material: Option<u16>) -> Option<PointStress<'_, D>> {
        None
    }

    fn is_objective(&self) -> bool {
        true
    }

    fn energy_ratio(&self, _s: f64) -> f64 {
        1.0
    }
}
