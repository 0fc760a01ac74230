//! The model of a scene linearised about rest, for studies of stiffness, eigenvalues and waves.

use std::sync::Arc;

use super::setup::{self, problem};
use crate::coupling::semidiscrete::masses;
use crate::material::LocalLaw;
use crate::progress::Silent;
use crate::run::error::RunError;
use crate::scene::validated::Scene;
use crate::system::{BlockCsr, LinearMotion};
use crate::{coupling::Coupling, model::Model};

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
        Ok(LinearMotion {
            stiffness: self.model.assemble(&operator, &Silent),
            mass: masses(&self.model, |material| self.density[material as usize]),
            symmetry: self.model.symmetry(),
        })
    }
}
