//! Partial stress, [SAND2015-7998] eq. (2.19), (2.29).

use schemars::JsonSchema;
use serde::Deserialize;

use super::{CouplingKind, CouplingTraits, LatticeStart, ZonesNeeded};
use crate::coupling::{Coupling, PartialStressElements, PartialStressMeshfree};
use crate::model::FitDegree;
use crate::peridynamics::LinearForceState;

/// Partial stress.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct PartialStressSpec {
    /// Discretisation of the divergence of the partial stress.
    #[serde(default)]
    pub form: FormSpec,
    /// Order of the least-squares constraint where mesh and points meet.
    #[serde(default)]
    pub interface: FitDegree,
}

/// Discretisation of the divergence of the partial stress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FormSpec {
    /// Finite elements whose stress is the partial stress at their Gauss points (SAND2015-7998 section 7.3).
    #[default]
    Elements,
    /// Points, through the shape tensor (section 7.2).
    Meshfree,
}

impl CouplingKind for PartialStressSpec {
    fn traits(&self) -> CouplingTraits {
        CouplingTraits {
            name: "partial-stress",
            about: "the transition zone carries the partial stress",
            zones: ZonesNeeded::Transition {
                width: 1.0,
                why: "families of the nonlocal zone then reach past it",
            },
            lattice: LatticeStart::OnCorner,
        }
    }

    fn build<const D: usize>(&self, law: &dyn LinearForceState<D>) -> Box<dyn Coupling<D>> {
        match self.form {
            FormSpec::Elements => Box::new(PartialStressElements {
                fit: self.interface,
            }),
            FormSpec::Meshfree => Box::new(PartialStressMeshfree {
                influence: law.divergence(),
            }),
        }
    }
}
