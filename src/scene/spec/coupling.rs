//! The coupling of a scene: what is typed, what a run asks of it, and the method that it makes.
//!
//! A coupling enters a scene here and nowhere else: a variant of [`CouplingSpec`], its [`CouplingTraits`] and the value that
//! [`CouplingSpec::build`] makes of it. Parser, JSON Schema, overrides and messages follow from the variant.

use std::sync::LazyLock;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;

use crate::peridynamics::{Influence, LinearForceState};
use crate::{
    coupling::{
        Balanced, Blending, BlendingFunction, Coupling, Local, Nonlocal, PartialStressElements,
        PartialStressMeshfree, Splice, Truncated, TruncatedFamilies, truncated::CutBonds,
    },
    model::{FitDegree, Zone},
};

/// Coupling of finite elements and peridynamics.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CouplingSpec {
    /// Each site takes the whole force of its own model (SAND2015-7998 eq. (2.30)).
    Splice(NoOptionsSpec),
    /// Forces blended by β over the transition zone (SAND2015-7998 eq. (3.14)).
    Blending(BlendingSpec),
    /// Half of a splice's forces and half of a blending's: what both leave out of balance cancels.
    Balanced(BalancedSpec),
    /// Partial stress in the transition zone (SAND2015-7998 eq. (2.19), (2.29)).
    PartialStress(PartialStressSpec),
    /// Bonds that end on the faces of elements: symmetric, in exact equilibrium.
    Truncated(TruncatedSpec),
    /// Finite elements everywhere.
    Local(NoOptionsSpec),
    /// Peridynamics everywhere.
    Nonlocal(NoOptionsSpec),
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

impl CouplingSpec {
    /// Name, description and needs of the coupling.
    pub fn traits(&self) -> CouplingTraits {
        match self {
            Self::Splice(_) => CouplingTraits {
                name: "splice",
                about: "each site takes the whole force of its own model",
                zones: ZonesNeeded::Nonlocal,
                lattice: LatticeStart::OnCorner,
            },
            Self::Blending(b) => CouplingTraits {
                name: "blending",
                about: "forces are blended over the transition zone",
                zones: match b.beta {
                    // a step is a step, however wide; the report's slit plate has one horizon
                    BetaSpec::Constant => ZonesNeeded::Transition {
                        width: 1.0,
                        why: "families of the nonlocal zone then reach past it",
                    },
                    _ => ZonesNeeded::Transition {
                        width: 3.0,
                        why: "a smooth blending over three horizons cuts spurious forces a hundredfold",
                    },
                },
                lattice: LatticeStart::OnCorner,
            },
            Self::Balanced(b) => CouplingTraits {
                name: "balanced",
                about: "half of a splice's forces and half of a blending's",
                zones: match b.beta {
                    None => ZonesNeeded::Nonlocal,
                    Some(_) => ZonesNeeded::Transition {
                        width: 3.0,
                        why: "a smooth blending over three horizons cuts spurious forces a hundredfold",
                    },
                },
                lattice: LatticeStart::OnCorner,
            },
            Self::PartialStress(_) => CouplingTraits {
                name: "partial-stress",
                about: "the transition zone carries the partial stress",
                zones: ZonesNeeded::Transition {
                    width: 1.0,
                    why: "families of the nonlocal zone then reach past it",
                },
                lattice: LatticeStart::OnCorner,
            },
            Self::Truncated(_) => CouplingTraits {
                name: "truncated",
                about: "bonds that leave the nonlocal zone end on the faces of elements",
                zones: ZonesNeeded::Nonlocal,
                lattice: LatticeStart::Halfway,
            },
            Self::Local(_) => CouplingTraits {
                name: "local",
                about: "finite elements everywhere",
                zones: ZonesNeeded::Everywhere(Zone::Local),
                lattice: LatticeStart::OnCorner,
            },
            Self::Nonlocal(_) => CouplingTraits {
                name: "nonlocal",
                about: "peridynamics everywhere",
                zones: ZonesNeeded::Everywhere(Zone::Nonlocal),
                lattice: LatticeStart::OnCorner,
            },
        }
    }

    /// The method for the law of the points.
    pub fn build_for<const D: usize>(&self, law: &dyn LinearForceState<D>) -> Box<dyn Coupling<D>> {
        match self {
            Self::Truncated(_) if !law.is_ordinary() => Box::new(TruncatedFamilies),
            _ => self.build(law.divergence()),
        }
    }

    /// The method; `influence` is that of the material's bonds.
    pub fn build<const D: usize>(&self, influence: Influence) -> Box<dyn Coupling<D>> {
        match self {
            Self::Splice(_) => Box::new(Splice),
            Self::Blending(b) => Box::new(Blending {
                function: b.beta.function(),
            }),
            Self::Balanced(b) => Box::new(Balanced {
                function: b.beta.map(BetaSpec::function),
            }),
            Self::PartialStress(p) => match p.form {
                FormSpec::Elements => Box::new(PartialStressElements {
                    fit: match p.interface {
                        InterfaceSpec::Affine => FitDegree::Affine,
                        InterfaceSpec::Quadratic => FitDegree::Quadratic,
                    },
                }),
                FormSpec::Meshfree => Box::new(PartialStressMeshfree { influence }),
            },
            Self::Truncated(t) => Box::new(Truncated {
                cut_bonds: match t.cut_bonds.unwrap_or_default() {
                    CutBondsSpec::Breaking => CutBonds::Breaking,
                    CutBondsSpec::Linear => CutBonds::Linear,
                },
            }),
            Self::Local(_) => Box::new(Local),
            Self::Nonlocal(_) => Box::new(Nonlocal),
        }
    }

    /// The names of all couplings, sorted; read off the schema, which the variants make.
    pub fn names() -> &'static [&'static str] {
        static OWNED: LazyLock<Vec<String>> = LazyLock::new(|| {
            let schema = schemars::schema_for!(CouplingSpec);
            let variants = schema.get("oneOf").and_then(|v| v.as_array());
            let mut names: Vec<String> = variants
                .into_iter()
                .flatten()
                .filter_map(|variant| variant.get("required")?.get(0)?.as_str())
                .map(str::to_owned)
                .collect();
            names.sort();
            names
        });
        static NAMES: LazyLock<Vec<&'static str>> =
            LazyLock::new(|| OWNED.iter().map(String::as_str).collect());
        &NAMES
    }
}

/// A table with the method's options, or the method's name alone.
pub(super) fn coupling_schema(generator: &mut SchemaGenerator) -> Schema {
    let table = generator.subschema_for::<CouplingSpec>();
    json_schema!({
        "description": "How the two models are selected: a table, [coupling.blending], or a name where no option is set, \"splice\".",
        "anyOf": [table, { "enum": CouplingSpec::names() }]
    })
}

/// A coupling without options.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoOptionsSpec {}

/// Force-based blending.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BlendingSpec {
    /// Shape of β from 1 at the nonlocal zone to 0 at the local one.
    #[serde(default)]
    pub beta: BetaSpec,
}

/// Half of a splice's forces and half of a blending's.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BalancedSpec {
    /// Shape of β over the transition zone; if left out, a step at the edge of the nonlocal zone.
    pub beta: Option<BetaSpec>,
}

/// Shape of the blending function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BetaSpec {
    /// One half throughout the transition zone.
    Constant,
    /// Straight.
    Linear,
    /// The cubic `3 s² - 2 s³`.
    #[default]
    Smooth,
}

impl BetaSpec {
    fn function(self) -> BlendingFunction {
        match self {
            Self::Constant => BlendingFunction::Constant,
            Self::Linear => BlendingFunction::Linear,
            Self::Smooth => BlendingFunction::Smooth,
        }
    }
}

/// Bonds that end on the faces of elements.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct TruncatedSpec {
    /// Treatment of cut bonds where bonds are exact or break; `breaking` if left out, `linear` beside a zone that follows its crack.
    #[serde(default)]
    pub cut_bonds: Option<CutBondsSpec>,
}

/// Treatment of bonds that the seam cuts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CutBondsSpec {
    /// They turn, stretch and break like others.
    #[default]
    Breaking,
    /// They are linear and do not break: cheaper, where damage stays two horizons away from the seam.
    Linear,
}

/// Partial stress.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct PartialStressSpec {
    /// Discretisation of the divergence of the partial stress.
    #[serde(default)]
    pub form: FormSpec,
    /// Order of the least-squares constraint where mesh and points meet.
    #[serde(default)]
    pub interface: InterfaceSpec,
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

/// Order of the constraint where mesh and points meet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum InterfaceSpec {
    /// Affine fields pass exactly.
    Affine,
    /// Quadratic fields pass exactly.
    #[default]
    Quadratic,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coupling_is_called_what_its_variant_is_called() {
        assert_eq!(
            CouplingSpec::names(),
            [
                "balanced",
                "blending",
                "local",
                "nonlocal",
                "partial-stress",
                "splice",
                "truncated"
            ]
        );
        for name in CouplingSpec::names() {
            let typed = format!("[coupling.{name}]");
            let table: std::collections::BTreeMap<String, CouplingSpec> =
                toml::from_str(&typed).expect("no option is compulsory");
            assert_eq!(table["coupling"].traits().name, *name);
        }
    }
}
