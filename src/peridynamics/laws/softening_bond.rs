//! Bonds that soften: cohesive fracture with a tensile strength and a fracture energy.

use std::sync::Arc;

use super::{BondBased, Constants, NamedLaw, Parameter, Ratio};
use crate::{
    material::{Kinematics, LocalLaw},
    peridynamics::{
        Accelerator, BondEnergy, Calibrate, DeformedFamily, Departure, EnergyDensity, ForceState,
        HistoryLayout, KeptDamage, Law, LinearForceState, Linearity, Micromodulus, Parameters,
        Past, PointStress, Present,
        departure::DAMAGED_ELEMENTS,
        largest_extension,
        softening::{Calibration, CalibrationError, Envelope, RegularFamily, Softening},
    },
    tensor::{Tensor, Vector},
};

/// Bond-based material whose bonds soften beyond a stretch, for concrete and ceramics.
///
/// Source: none in [SAND2015-7998]; bonds that act alone, eq. (3.1), with the damage of cohesive models. With `κ` the largest stretch so far and the envelope `g` of [`Envelope`]:
///
/// ```text
/// T⟨ξ⟩ = ½ c (1 − φ) s M  under tension,   ½ c s M  under compression until φ = 1,   φ = 1 − g(κ)/κ
/// ```
///
/// `g` is fixed by the lattice ([`Softening::calibrate`]): the largest stress of the homogeneous lattice in uniaxial stress along an axis is the tensile strength, and opening a plane between two of its layers takes the fracture energy.
/// Before that, its bonds are linear.
#[derive(Clone, Debug)]
pub struct SofteningBond<const D: usize> {
    linear: BondBased<D>,
    typed: Softening,
    calibration: Option<Calibration>,
}

impl<const D: usize> NamedLaw<D> for SofteningBond<D> {
    const KEY: &'static str = "softening-bond";
    const ABOUT: &'static str = "Bonds that act alone and soften beyond a stretch, so that the material has a tensile strength and a fracture energy.";
    const RATIO: Ratio = Ratio::Pairwise;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter {
            key: "tensile-strength",
            about: "Largest stress of the lattice under uniaxial stress along one of its axes.",
            default: None,
            least: 1e-100,
            most: 1e100,
            usual: 0.04,
            words: &[],
        },
        Parameter {
            key: "fracture-energy",
            about: "Energy per area that a plane between two layers of points takes until it is open.",
            default: None,
            least: 1e-100,
            most: 1e100,
            usual: 0.0005,
            words: &[],
        },
        Parameter::words(
            "softening",
            "How the force of a bond falls with its stretch: along a line, or exponentially down to 1/1000 of its largest.",
            &["bilinear", "exponential"],
        ),
    ];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        Arc::new(Self {
            linear: BondBased::new(Micromodulus::InverseDistance, constants.shear),
            typed: Softening {
                strength: values[0],
                energy: values[1],
                is_exponential: values[2] == 1.0,
            },
            calibration: None,
        })
    }
}

impl<const D: usize> Law<D> for SofteningBond<D> {
    fn name(&self) -> &'static str {
        "softening bond"
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
        Linearity::UntilDamaged
    }

    fn departure(&self, strain: &Tensor<D>, _time: f64) -> Departure {
        // bonds that act alone, C_1111 = 3 C_1122, and E = C_1111 in a bar
        let c1111 = self.linear.tensor().get(0, 0, 0, 0);
        let young = c1111 * [1.0, 8.0 / 9.0, 5.0 / 6.0][D - 1];
        Departure::AtStrain {
            factor: largest_extension(strain) * young / self.typed.strength,
            begins: "its bonds soften, tensile-strength over Young's modulus",
            in_elements: Some(DAMAGED_ELEMENTS),
        }
    }

    /// Not at a stretch: they break by their damage.
    fn has_breakable_bonds(&self) -> bool {
        false
    }

    fn bond_energy(&self, _horizon: f64) -> Option<BondEnergy> {
        None
    }

    fn parameters(&self) -> Parameters<'_, D> {
        Parameters::OfLattice(self)
    }
}

impl<const D: usize> Calibrate<D> for SofteningBond<D> {
    fn to_lattice(
        &self,
        family: &RegularFamily<'_, D>,
    ) -> Result<Arc<dyn Law<D>>, CalibrationError> {
        Ok(Arc::new(Self {
            calibration: Some(self.typed.calibrate(family)?),
            ..self.clone()
        }))
    }

    fn found(&self) -> Option<String> {
        self.calibration.map(|found| found.to_string())
    }

    fn elastic_limit(&self) -> Option<f64> {
        self.calibration.map(|found| found.envelope.onset)
    }
}

/// Names of the history variables of a bond.
const HISTORY: [&str; 2] = ["damage", "largest stretch"];

impl<const D: usize> ForceState<D> for SofteningBond<D> {
    fn history(&self) -> HistoryLayout {
        HistoryLayout {
            point: &[],
            bond: &HISTORY,
            damage: Some(KeptDamage::Bond(0)),
        }
    }

    fn respond(
        &self,
        family: &DeformedFamily<'_, D>,
        _step: f64,
        past: Past<'_>,
        present: Present<'_>,
        force: &mut [Vector<D>],
    ) -> EnergyDensity {
        let envelope: Option<Envelope> = self.calibration.map(|c| c.envelope);
        let mut energy = EnergyDensity::default();
        let bonds = past.bonds.chunks_exact(2);
        let bonds = bonds.zip(present.bonds.chunks_exact_mut(2));
        for (k, (past, present)) in bonds.enumerate() {
            let square = family.bonds[k].norm_squared();
            let s = family.extension[k] / square.sqrt();
            // p |ξ|⁴ V: twice the energy of this end of the bond at a unit stretch
            let stiffness = family.pair[k] * square * square * family.volumes[k];
            let [mut damage, before] = [past[0], past[1]];
            let mut largest = before;
            if let Some(envelope) = envelope
                && s > before
                && !family.keeps_damage
            {
                largest = s;
                damage = envelope.damage(s).max(damage);
                energy.dissipated += stiffness * (envelope.spent(s) - envelope.spent(before));
            }
            present.copy_from_slice(&[damage, largest]);
            // cracks close: a bond that is not damaged through carries all of a compression
            let left = if s < 0.0 && damage < 1.0 {
                1.0
            } else {
                1.0 - damage
            };
            force[k] = family.direction[k] * (left * family.pair[k] * square * family.extension[k]);
            energy.stored += 0.5 * left * stiffness * s * s;
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

#[cfg(test)]
#[path = "softening_bond_tests.rs"]
mod tests;
