//! Bonds that end on the faces of elements.

use schemars::JsonSchema;
use serde::Deserialize;

use super::{CouplingKind, CouplingTraits, LatticeStart, ZonesNeeded};
use crate::coupling::truncated::CutBonds;
use crate::coupling::{Coupling, Truncated, TruncatedFamilies};
use crate::peridynamics::LinearForceState;

/// Bonds that end on the faces of elements.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct TruncatedSpec {
    /// Treatment of cut bonds where bonds are exact or break; `breaking` if left out, `linear` beside a zone that follows its crack.
    pub cut_bonds: Option<CutBonds>,
}

impl CouplingKind for TruncatedSpec {
    fn traits(&self) -> CouplingTraits {
        CouplingTraits {
            name: "truncated",
            about: "bonds that leave the nonlocal zone end on the faces of elements",
            zones: ZonesNeeded::Nonlocal,
            lattice: LatticeStart::Halfway,
        }
    }

    fn build<const D: usize>(&self, law: &dyn LinearForceState<D>) -> Box<dyn Coupling<D>> {
        if !law.is_ordinary() {
            return Box::new(TruncatedFamilies);
        }
        Box::new(Truncated {
            cut_bonds: self.cut_bonds.unwrap_or_default(),
        })
    }
}
