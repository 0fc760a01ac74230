//! The motion of a scene about rest, as matrices: what studies of eigenvalues and waves look at.

use super::setup::problem;
use crate::coupling::Model;
use crate::coupling::motion::masses;
use crate::progress::Silent;
use crate::run::AnyScene;
use crate::run::error::RunError;
use crate::scene::validated::Scene;
use crate::system::LinearMotion;
use crate::tensor::padded;

/// Stiffness and masses of a scene at rest, bonds intact and nothing held.
pub struct LinearModel {
    /// Stiffness, and lumped mass of each site \[kg\].
    pub motion: LinearMotion,
    /// Place of each site \[m\], padded with zeros.
    pub position: Vec<[f64; 3]>,
    /// Blending function of each site: 1 where it is peridynamic, 0 where it is local.
    pub beta: Vec<f64>,
}

impl AnyScene {
    /// The model of the scene as matrices; its conditions and cracks in time are left out.
    ///
    /// # Errors
    /// [`RunError`] of the model or its coupling.
    pub fn linear_model(self) -> Result<LinearModel, RunError> {
        match self {
            Self::Bar(scene) => linear_model(scene.scene),
            Self::Plane(scene) => linear_model(scene.scene),
            Self::Solid(scene) => linear_model(scene.scene),
        }
    }
}

fn linear_model<const D: usize>(scene: Scene<D>) -> Result<LinearModel, RunError> {
    let (problem, rest) = problem(scene);
    let (model, coupling) = Model::new(problem, &Silent)?;
    let operator = coupling.operator(&model)?;
    let density = |material: u16| rest.density[material as usize];
    Ok(LinearModel {
        beta: (0..model.sites.len()).map(|s| operator.beta(s)).collect(),
        position: model.sites.iter().map(|s| padded(&s.position)).collect(),
        motion: LinearMotion {
            stiffness: model.assemble(operator.as_ref(), &Silent),
            mass: masses(&model, density),
            symmetry: coupling.symmetry(),
        },
    })
}
