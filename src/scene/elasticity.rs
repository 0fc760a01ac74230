//! Linear elasticity of the materials of a scene.

use crate::material::{Axes, Orthotropic};
use crate::tensor::{Tensor4, Vector};

/// Linear elasticity of a material in the scene's dimension.
#[derive(Clone, Debug)]
pub enum Elasticity<const D: usize> {
    /// By Lamé's parameters (λ_D, μ) \[Pa\].
    Isotropic {
        /// λ_D.
        lambda: f64,
        /// μ.
        shear: f64,
    },
    /// By three planes of symmetry.
    Orthotropic {
        /// The constants in the axes of the material.
        body: Orthotropic<D>,
        /// The directions of these axes.
        axes: Axes<D>,
    },
}

impl<const D: usize> Elasticity<D> {
    /// The stiffness at a place \[Pa\].
    pub fn stiffness_at(&self, x: &Vector<D>) -> Tensor4<D> {
        match self {
            Self::Isotropic { lambda, shear } => Tensor4::isotropic(*lambda, *shear),
            Self::Orthotropic { body, axes } => body.stiffness(&axes.at(x)),
        }
    }

    /// Returns true if the stiffness differs from place to place.
    pub fn turns(&self) -> bool {
        matches!(
            self,
            Self::Orthotropic {
                axes: Axes::Field(_),
                ..
            }
        )
    }
}
