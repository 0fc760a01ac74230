//! Thermal part of a scene's stresses, and the numbers made of stresses that are written.

use std::sync::Arc;

use super::thermal::{TemperatureField, Thermal};
use crate::material::{Kinematics, LocalLaw};
use crate::peridynamics::bond_force::BondKinematics;
use crate::scene::expression::Expression;
use crate::scene::materials::{Material, Ratio};
use crate::scene::temperature::TemperatureValue;
use crate::scene::validated::{FieldChoice, Scene};

/// Thermal part of a scene's stresses, and the quantities that are made of stresses.
#[derive(Clone, Debug)]
pub struct StressSettings<const D: usize> {
    /// The fields that are asked for.
    pub output: FieldChoice,
    /// True if the stresses around the tip of a crack are integrated.
    pub at_tips: bool,
    /// Thermal expansion, if any material expands.
    pub thermal: Option<Thermal<D>>,
    /// Reduction of the solid: plane stress, plane strain or another.
    pub kinematics: Kinematics,
    /// Kinematics of the bonds.
    pub bonds: BondKinematics,
    /// The local law of each material's elements, of those whose elements are not linear by their material.
    pub local_laws: Vec<Option<Arc<dyn LocalLaw<D>>>>,
    /// Poisson's ratio and `E α` of each material.
    pub constants: Vec<(f64, f64)>,
}

impl<const D: usize> StressSettings<D> {
    /// Of a scene; one whose temperature is solved for stays at its reference until [`heated_problem`](super::conduction::heated_problem) has the solution.
    pub fn of(scene: &Scene<D>) -> Self {
        let kinematics = scene.kinematics;
        let ratio = |m: &Material<D>| Ratio::new(m.lame, kinematics).typed;
        let stiffness = |m: &Material<D>| 2.0 * m.lame.1 * (1.0 + ratio(m));
        let alpha = |m: &Material<D>| m.expansion.unwrap_or(0.0);
        let of_solid = |m| match kinematics {
            Kinematics::PlaneStrain => (1.0 + ratio(m)).recip(),
            Kinematics::Bar | Kinematics::PlaneStress | Kinematics::Solid => 1.0,
        };
        let cells = scene.mesh.cell_count().max(1);
        let (low, high) = scene.mesh.bounds();
        let size = (high - low).norm() / (cells as f64).powf(1.0 / D as f64);
        let thermal = scene.temperature.as_ref().map(|temperature| Thermal {
            temperature: TemperatureField::Typed(match &temperature.value {
                TemperatureValue::Typed(value) => value.clone(),
                TemperatureValue::Conduction(_) => Expression::constant(temperature.reference),
            }),
            reference: temperature.reference,
            expansion: (scene.materials.iter())
                .map(|m| alpha(m) / of_solid(m))
                .collect(),
            solid: scene.materials.iter().map(of_solid).collect(),
            reach: 0.25 * size,
        });
        Self {
            output: scene.output.fields.clone(),
            at_tips: (scene.output.tips.iter()).any(|tip| tip.domains.is_some()),
            thermal,
            kinematics,
            bonds: scene.breaking.bonds,
            local_laws: (scene.materials.iter())
                .map(|m| m.law.local_law().filter(|law| !law.is_linear()))
                .collect(),
            constants: (scene.materials.iter())
                .map(|m| (ratio(m), stiffness(m) * alpha(m)))
                .collect(),
        }
    }

    /// Returns true if stresses of points need more than the bonds that a process has of its own: numbers are made of them, they are integrated, or a temperature has a part in them.
    pub fn asks_for_more(&self) -> bool {
        self.thermal.is_some() || self.at_tips || self.output.has_numbers()
    }
}
