//! The model of a scene linearised about rest, for studies of stiffness, eigenvalues and waves.

use std::sync::Arc;

use super::setup::{self, problem};
use crate::coupling::semidiscrete::masses;
use crate::material::LocalLaw;
use crate::progress::Silent;
use crate::run::AnyScene;
use crate::run::any_scene::each;
use crate::run::error::RunError;
use crate::scene::validated::Scene;
use crate::system::{BlockCsr, LinearMotion};
use crate::tensor::padded;
use crate::{
    coupling::{Coupling, Operator},
    model::Model,
};

/// The sites and bonds of a scene as its run lays them out: bonds intact, nothing loaded or held, nothing proved.
pub struct SceneModel<const D: usize> {
    /// Sites and families.
    pub model: Model<D>,
    /// Coupling of the models; its operator belongs to `model`.
    pub coupling: Box<dyn Coupling<D>>,
    /// Density of each material [kg/m³]; zero where the scene types none.
    pub density: Vec<f64>,
    /// The laws of elements that are not linear, by the number of a material.
    pub local_laws: Vec<Option<Arc<dyn LocalLaw<D>>>>,
}

impl<const D: usize> SceneModel<D> {
    /// Lays out a scene; its conditions and what it computes are left out.
    ///
    /// # Errors
    /// [`RunError::Model`] of the sites or their families.
    pub fn new(scene: Scene<D>) -> Result<Self, RunError> {
        let (problem, rest) = problem(scene);
        let (model, coupling) = setup::model(problem, &rest, &Silent)?;
        Ok(Self {
            model,
            coupling,
            density: rest.density,
            local_laws: rest.local_laws,
        })
    }

    /// The stiffness as a run has it, a `D × D` block per pair of sites: minus the derivative of internal forces \[N\] by displacements \[m\].
    ///
    /// # Errors
    /// [`RunError::Model`] of the coupling.
    pub fn stiffness(&self) -> Result<BlockCsr, RunError> {
        let operator = self.coupling.operator(&self.model)?;
        Ok(self.model.assemble(&operator, &Silent))
    }

    /// Stiffness, and lumped mass of each site \[kg\].
    ///
    /// # Errors
    /// As [`SceneModel::stiffness`].
    pub fn motion(&self) -> Result<LinearMotion, RunError> {
        let operator = self.coupling.operator(&self.model)?;
        Ok(self.motion_by(&operator))
    }

    fn motion_by(&self, operator: &Operator<'_, D>) -> LinearMotion {
        LinearMotion {
            stiffness: self.model.assemble(operator, &Silent),
            mass: masses(&self.model, |material| self.density[material as usize]),
            symmetry: self.coupling.symmetry(),
        }
    }
}

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
        each!(self, scene => linear_model(scene.scene))
    }
}

fn linear_model<const D: usize>(scene: Scene<D>) -> Result<LinearModel, RunError> {
    let laid = SceneModel::new(scene)?;
    let operator = laid.coupling.operator(&laid.model)?;
    let sites = &laid.model.sites;
    Ok(LinearModel {
        beta: (0..sites.len()).map(|s| (operator.beta)(s)).collect(),
        position: sites.iter().map(|s| padded(&s.position)).collect(),
        motion: laid.motion_by(&operator),
    })
}
