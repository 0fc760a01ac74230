//! Splice, [SAND2015-7998] eq. (2.30).

use schemars::JsonSchema;
use serde::Deserialize;

use super::{CouplingKind, CouplingTraits, LatticeStart, ZonesNeeded};
use crate::coupling::{Coupling, Splice};
use crate::peridynamics::LinearForceState;

/// A splice, without options.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpliceSpec {}

impl CouplingKind for SpliceSpec {
    fn traits(&self) -> CouplingTraits {
        CouplingTraits {
            name: "splice",
            about: "each site takes the whole force of its own model",
            zones: ZonesNeeded::Nonlocal,
            lattice: LatticeStart::OnCorner,
        }
    }

    fn build<const D: usize>(&self, _law: &dyn LinearForceState<D>) -> Box<dyn Coupling<D>> {
        Box::new(Splice)
    }
}
