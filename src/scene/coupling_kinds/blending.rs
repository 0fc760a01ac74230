//! Force-based blending, [SAND2015-7998] eq. (3.14).

use schemars::JsonSchema;
use serde::Deserialize;

use super::{CouplingKind, CouplingTraits, LatticeStart, ZonesNeeded};
use crate::coupling::{Blending, BlendingFunction, Coupling};
use crate::peridynamics::LinearForceState;

/// Force-based blending.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BlendingSpec {
    /// Shape of β from 1 at the nonlocal zone to 0 at the local one.
    #[serde(default)]
    pub beta: BlendingFunction,
}

/// A transition zone over which β falls smoothly.
pub(super) const SMOOTH: ZonesNeeded = ZonesNeeded::Transition {
    width: 3.0,
    why: "a smooth blending over three horizons cuts spurious forces a hundredfold",
};

impl CouplingKind for BlendingSpec {
    fn traits(&self) -> CouplingTraits {
        CouplingTraits {
            name: "blending",
            about: "forces are blended over the transition zone",
            zones: match self.beta {
                // a step is a step, however wide; the report's slit plate has one horizon
                BlendingFunction::Constant => ZonesNeeded::Transition {
                    width: 1.0,
                    why: "families of the nonlocal zone then reach past it",
                },
                BlendingFunction::Linear | BlendingFunction::Smooth => SMOOTH,
            },
            lattice: LatticeStart::OnCorner,
        }
    }

    fn build<const D: usize>(&self, _law: &dyn LinearForceState<D>) -> Box<dyn Coupling<D>> {
        Box::new(Blending {
            function: self.beta,
        })
    }
}
