//! What of a scene's stresses is thermal, and which numbers made of them are written.

use super::thermal::Thermal;
use crate::material::Kinematics;
use crate::scene::materials::{Material, Ratio};
use crate::scene::spec::StressSpec;
use crate::scene::validated::Scene;

/// What of a scene's stresses is thermal, and what is made of them.
#[derive(Clone, Debug)]
pub struct StressSettings<const D: usize> {
    /// What is asked for.
    pub asked: Vec<StressSpec>,
    /// What expands, if anything does.
    pub thermal: Option<Thermal<D>>,
    /// How the body stands for a solid.
    pub kinematics: Kinematics,
    /// Poisson's ratio and `E α` of each material.
    pub constants: Vec<(f64, f64)>,
}

impl<const D: usize> StressSettings<D> {
    /// Of a scene.
    pub fn of(scene: &Scene<D>) -> Self {
        let kinematics = scene.kinematics;
        let ratio = |m: &Material<D>| Ratio::new(m.lame, kinematics).typed;
        let stiffness = |m: &Material<D>| 2.0 * m.lame.1 * (1.0 + ratio(m));
        let alpha = |m: &Material<D>| m.expansion.unwrap_or(0.0);
        let within = |m| match kinematics {
            Kinematics::PlaneStrain => (1.0 + ratio(m)) * alpha(m),
            _ => alpha(m),
        };
        let cells = scene.mesh.cell_count().max(1);
        let (low, high) = scene.mesh.bounds();
        let size = (high - low).norm() / (cells as f64).powf(1.0 / D as f64);
        let thermal = scene.temperature.as_ref().map(|temperature| Thermal {
            temperature: temperature.clone(),
            expansion: scene.materials.iter().map(within).collect(),
            reach: 0.25 * size,
        });
        Self {
            asked: scene.output.stresses.clone(),
            thermal,
            kinematics,
            constants: (scene.materials.iter())
                .map(|m| (ratio(m), stiffness(m) * alpha(m)))
                .collect(),
        }
    }

    /// What outputs at time `t` need; none where nothing is asked for and nothing expands.
    pub fn at(&self, t: f64) -> Option<(&Self, f64)> {
        (self.thermal.is_some() || !self.asked.is_empty()).then_some((self, t))
    }
}
