//! Half of a splice's forces and half of a blending's.

use schemars::JsonSchema;
use serde::Deserialize;

use super::blending::SMOOTH;
use super::{CouplingKind, CouplingTraits, LatticeStart, ZonesNeeded};
use crate::coupling::{Balanced, BlendingFunction, Coupling};
use crate::peridynamics::LinearForceState;

/// Half of a splice's forces and half of a blending's.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BalancedSpec {
    /// Shape of β over the transition zone; if left out, a step at the edge of the nonlocal zone.
    pub beta: Option<BlendingFunction>,
}

impl CouplingKind for BalancedSpec {
    fn traits(&self) -> CouplingTraits {
        CouplingTraits {
            name: "balanced",
            about: "half of a splice's forces and half of a blending's",
            zones: match self.beta {
                None => ZonesNeeded::Nonlocal,
                Some(_) => SMOOTH,
            },
            lattice: LatticeStart::OnCorner,
        }
    }

    fn build<const D: usize>(&self, _law: &dyn LinearForceState<D>) -> Box<dyn Coupling<D>> {
        Box::new(Balanced {
            function: self.beta,
        })
    }
}
