//! Couplings of scenes, one file each: what is typed, its needs, and the method that it makes.
//!
//! | file | coupling |
//! |---|---|
//! | `splice.rs` | each site takes the whole force of its own model |
//! | `blending.rs`, `balanced.rs` | forces blended over the transition zone; half of them, half of a splice's |
//! | `partial_stress.rs` | partial stress in the transition zone |
//! | `truncated.rs` | bonds that end on the faces of elements |
//! | `uncoupled.rs` | one model everywhere |
//!
//! A coupling that implements `CouplingKind` and has its line in the list of this file is one of scenes, by its key. Parser, JSON Schema, overrides and messages follow from the line. The methods are in [`crate::coupling`].

mod balanced;
mod blending;
mod partial_stress;
mod splice;
mod truncated;
mod uncoupled;

use std::sync::LazyLock;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;

use crate::coupling::Coupling;
use crate::model::Zone;
use crate::peridynamics::LinearForceState;

pub use balanced::BalancedSpec;
pub use blending::BlendingSpec;
pub use partial_stress::{FormSpec, PartialStressSpec};
pub use splice::SpliceSpec;
pub use truncated::TruncatedSpec;
pub use uncoupled::{LocalSpec, NonlocalSpec};

/// A coupling, as scenes type it.
pub(crate) trait CouplingKind {
    /// Name, description and needs.
    fn traits(&self) -> CouplingTraits;

    /// The method for the law of the points.
    fn build<const D: usize>(&self, law: &dyn LinearForceState<D>) -> Box<dyn Coupling<D>>;
}

/// Declares [`CouplingSpec`], the couplings by their keys.
macro_rules! couplings {
    ($($(#[doc = $about:literal])+ $key:literal => $kind:ident($spec:ident)),* $(,)?) => {
        /// Coupling of finite elements and peridynamics.
        #[derive(Clone, Debug, Deserialize, JsonSchema)]
        pub enum CouplingSpec {
            $($(#[doc = $about])+ #[serde(rename = $key)] $kind($spec),)*
        }

        impl CouplingSpec {
            /// Name, description and needs of the coupling.
            pub fn traits(&self) -> CouplingTraits {
                match self { $(Self::$kind(kind) => kind.traits(),)* }
            }

            /// The method for the law of the points.
            pub fn build<const D: usize>(&self, law: &dyn LinearForceState<D>) -> Box<dyn Coupling<D>> {
                match self { $(Self::$kind(kind) => kind.build(law),)* }
            }

            /// The names of all couplings, sorted.
            pub fn names() -> &'static [&'static str] {
                static NAMES: LazyLock<Vec<&'static str>> = LazyLock::new(|| {
                    let mut names = vec![$($key),*];
                    names.sort_unstable();
                    names
                });
                &NAMES
            }
        }
    };
}

couplings! {
    /// Each site takes the whole force of its own model (SAND2015-7998 eq. (2.30)).
    "splice" => Splice(SpliceSpec),
    /// Forces blended by β over the transition zone (SAND2015-7998 eq. (3.14)).
    "blending" => Blending(BlendingSpec),
    /// Half of a splice's forces and half of a blending's: what both leave out of balance cancels.
    "balanced" => Balanced(BalancedSpec),
    /// Partial stress in the transition zone (SAND2015-7998 eq. (2.19), (2.29)).
    "partial-stress" => PartialStress(PartialStressSpec),
    /// Bonds that end on the faces of elements: symmetric, in exact equilibrium.
    "truncated" => Truncated(TruncatedSpec),
    /// Finite elements everywhere.
    "local" => Local(LocalSpec),
    /// Peridynamics everywhere.
    "nonlocal" => Nonlocal(NonlocalSpec),
}

/// Zones that a coupling needs in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ZonesNeeded {
    /// None: every cell is of this zone.
    Everywhere(Zone),
    /// A nonlocal zone; a transition zone has no meaning of its own.
    Nonlocal,
    /// A nonlocal zone and a transition zone, which should be at least so many horizons wide.
    Transition {
        /// The least width over the largest horizon.
        width: f64,
        /// Benefit of that width.
        why: &'static str,
    },
}

/// Position of a lattice whose origin is not typed, relative to the mesh's lowest corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LatticeStart {
    /// A point lies on the corner: on a mesh of the same spacing points coincide with nodes, and a seam interpolates nothing.
    OnCorner,
    /// The corner lies halfway between points: faces of the zone then pass between layers of points.
    Halfway,
}

/// Traits of a coupling: its name, a description in one line, and its needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingTraits {
    /// The name, as a scene spells it.
    pub name: &'static str,
    /// Description of the method, in one line.
    pub about: &'static str,
    /// The zones that it needs.
    pub zones: ZonesNeeded,
    /// Position of a lattice whose origin is not typed.
    pub lattice: LatticeStart,
}

/// A table with the method's options, or the method's name alone.
pub(crate) fn coupling_schema(generator: &mut SchemaGenerator) -> Schema {
    let table = generator.subschema_for::<CouplingSpec>();
    json_schema!({
        "description": "How the two models are selected: a table, [coupling.blending], or a name where no option is set, \"splice\".",
        "anyOf": [table, { "enum": CouplingSpec::names() }]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coupling_is_called_what_its_variant_is_called() {
        for name in CouplingSpec::names() {
            let typed = format!("[coupling.{name}]");
            let table: std::collections::BTreeMap<String, CouplingSpec> =
                toml::from_str(&typed).expect("no option is compulsory");
            assert_eq!(table["coupling"].traits().name, *name);
        }
    }
}
