//! Thermal part of a scene's stresses, and the numbers made of stresses that are written.

use std::sync::Arc;

use super::thermal::{Expansion, TemperatureField, Thermal};
use crate::material::{Axes, Kinematics, LocalLaw, Orthotropic};
use crate::peridynamics::bond_force::BondKinematics;
use crate::scene::elasticity::Elasticity;
use crate::scene::expression::Expression;
use crate::scene::materials::{Material, Ratio};
use crate::scene::temperature::TemperatureValue;
use crate::scene::validated::{FieldChoice, Scene};
use crate::tensor::{Tensor, Vector};

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
    /// The stress out of the plane of each material.
    pub elastic: Vec<ElasticSolid<D>>,
}

/// Constants of a linear elastic solid in plane strain, whose stress out of the plane follows from that within.
#[derive(Clone, Debug)]
pub enum ElasticSolid<const D: usize> {
    /// `σ_zz = ν (σ_xx + σ_yy) − E α ΔT`.
    Isotropic {
        /// Poisson's ratio ν.
        ratio: f64,
        /// Young's modulus E \[Pa\].
        young: f64,
        /// Thermal expansion α per degree.
        expansion: f64,
    },
    /// By the constants along its axes.
    Orthotropic(Orthotropic<D>, Axes<D>),
}

impl<const D: usize> ElasticSolid<D> {
    fn new(material: &Material<D>, kinematics: Kinematics) -> Self {
        match &material.elasticity {
            Elasticity::Isotropic { lambda, shear } => {
                let ratio = Ratio::new((*lambda, *shear), kinematics).typed;
                Self::Isotropic {
                    ratio,
                    young: 2.0 * shear * (1.0 + ratio),
                    expansion: material.expansion.unwrap_or(0.0),
                }
            }
            Elasticity::Orthotropic { body, axes } => Self::Orthotropic(body.clone(), axes.clone()),
        }
    }

    /// Twice the energy per volume and squared degree of a body that the plane holds back across and that is free within.
    fn held_energy(&self, kinematics: Kinematics) -> f64 {
        match self {
            Self::Isotropic {
                young, expansion, ..
            } => match kinematics {
                Kinematics::PlaneStrain => young * expansion * expansion,
                _ => 0.0,
            },
            Self::Orthotropic(body, _) => body.held_energy(),
        }
    }
}

impl<const D: usize> StressSettings<D> {
    /// Of a scene; one whose temperature is solved for stays at its reference until [`heated_problem`](super::conduction::heated_problem) has the solution.
    pub fn of(scene: &Scene<D>) -> Self {
        let kinematics = scene.kinematics;
        let elastic = |m: &Material<D>| ElasticSolid::new(m, kinematics);
        let of_solid = |m: &Material<D>| match (elastic(m), kinematics) {
            (ElasticSolid::Isotropic { ratio, .. }, Kinematics::PlaneStrain) => {
                (1.0 + ratio).recip()
            }
            _ => 1.0,
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
                .map(|m| match &m.elasticity {
                    Elasticity::Isotropic { .. } => {
                        Expansion::Isotropic(m.expansion.unwrap_or(0.0) / of_solid(m))
                    }
                    Elasticity::Orthotropic { body, axes } => {
                        Expansion::Orthotropic(body.clone(), axes.clone())
                    }
                })
                .collect(),
            held: (scene.materials.iter())
                .map(|m| elastic(m).held_energy(kinematics))
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
                .map(|m| m.local_law().filter(|law| !law.is_linear()))
                .collect(),
            elastic: scene.materials.iter().map(elastic).collect(),
        }
    }

    /// The normal stress out of the plane \[Pa\] of a material under a stress within it and a rise of the temperature; zero but in plane strain. Axes are those at `x`.
    pub fn across(&self, material: u16, x: &Vector<D>, stress: &Tensor<D>, rise: f64) -> f64 {
        match (&self.elastic[usize::from(material)], self.kinematics) {
            (
                ElasticSolid::Isotropic {
                    ratio,
                    young,
                    expansion,
                },
                Kinematics::PlaneStrain,
            ) => ratio * stress.trace() - young * expansion * rise,
            (ElasticSolid::Orthotropic(body, axes), Kinematics::PlaneStrain) => {
                body.across(&axes.at(x), stress, rise)
            }
            _ => 0.0,
        }
    }

    /// Returns true if stresses of points need more than the bonds that a process has of its own: numbers are made of them, they are integrated, or a temperature has a part in them.
    pub fn asks_for_more(&self) -> bool {
        self.thermal.is_some() || self.at_tips || self.output.has_numbers()
    }
}
