//! Finite elements everywhere, and peridynamics everywhere.

use schemars::JsonSchema;
use serde::Deserialize;

use super::{CouplingKind, CouplingTraits, LatticeStart, ZonesNeeded};
use crate::coupling::{Coupling, Local, Nonlocal};
use crate::model::Zone;
use crate::peridynamics::LinearForceState;

/// Finite elements alone, without options.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LocalSpec {}

impl CouplingKind for LocalSpec {
    fn traits(&self) -> CouplingTraits {
        CouplingTraits {
            name: "local",
            about: "finite elements everywhere",
            zones: ZonesNeeded::Everywhere(Zone::Local),
            lattice: LatticeStart::OnCorner,
        }
    }

    fn build<const D: usize>(&self, _law: &dyn LinearForceState<D>) -> Box<dyn Coupling<D>> {
        Box::new(Local)
    }
}

/// Peridynamics alone, without options.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NonlocalSpec {}

impl CouplingKind for NonlocalSpec {
    fn traits(&self) -> CouplingTraits {
        CouplingTraits {
            name: "nonlocal",
            about: "peridynamics everywhere",
            zones: ZonesNeeded::Everywhere(Zone::Nonlocal),
            lattice: LatticeStart::OnCorner,
        }
    }

    fn build<const D: usize>(&self, _law: &dyn LinearForceState<D>) -> Box<dyn Coupling<D>> {
        Box::new(Nonlocal)
    }
}
