//! Materials and peridynamics of a scene.

use std::borrow::Cow;
use std::fmt;
use std::sync::LazyLock;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{self, DeserializeSeed, Deserializer, EnumAccess, VariantAccess, Visitor};

use super::influence::InfluenceSpec;
use super::named_law::{self, NamedSpec};
use super::user_material::UmatSpec;
use crate::model::Surfaces;
use crate::peridynamics::bond_force::{BondKinematics, Storage};
use crate::peridynamics::failure::{self, FailureCriterion};
use crate::peridynamics::laws::Named;
use crate::peridynamics::{BondWeights, PartialVolume};
use crate::scene::expression::Expression;
use crate::scene::value::{Coordinates, Number, Text};

/// A material: its peridynamic law, beside which the local law is linear elasticity with the same constants.
#[derive(Clone, Debug)]
pub enum MaterialSpec {
    /// A routine of a user's library.
    Umat(UmatSpec),
    /// A law of [`Named`].
    Named(NamedSpec),
}

impl MaterialSpec {
    /// Thermal expansion, where it is typed.
    pub fn thermal_expansion(&self) -> Option<&Number> {
        match self {
            Self::Named(m) => m.thermal_expansion.as_ref(),
            Self::Umat(m) => m.thermal_expansion.as_ref(),
        }
    }

    /// Thermal conductivity and heat capacity per volume, where they are typed.
    pub fn conduction(&self) -> [Option<&Number>; 2] {
        match self {
            Self::Named(m) => [m.conductivity.as_ref(), m.heat_capacity.as_ref()],
            Self::Umat(m) => [m.conductivity.as_ref(), m.heat_capacity.as_ref()],
        }
    }
}

/// Keys of materials.
static KEYS: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| Named::KEYS.iter().copied().chain(["umat"]).collect());

impl<'de> Deserialize<'de> for MaterialSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Materials;
        impl<'de> Visitor<'de> for Materials {
            type Value = MaterialSpec;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "one of {}", KEYS.join(", "))
            }

            fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<MaterialSpec, A::Error> {
                let (key, content) = data.variant_seed(MaterialKey)?;
                Ok(match key {
                    Key::Umat => MaterialSpec::Umat(content.newtype_variant()?),
                    Key::Named(law) => {
                        MaterialSpec::Named(content.newtype_variant_seed(named_law::Seed(law))?)
                    }
                })
            }
        }
        deserializer.deserialize_enum("MaterialSpec", &KEYS, Materials)
    }
}

/// The law that a key of a material names.
enum Key {
    Umat,
    Named(Named),
}

/// Reads such a key.
struct MaterialKey;

impl<'de> DeserializeSeed<'de> for MaterialKey {
    type Value = Key;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Key, D::Error> {
        let key = String::deserialize(deserializer)?;
        Ok(match key.as_str() {
            "umat" => Key::Umat,
            other => match Named::ALL.iter().find(|law| law.key() == other) {
                Some(law) => Key::Named(*law),
                None => return Err(de::Error::unknown_variant(other, &KEYS)),
            },
        })
    }
}

impl JsonSchema for MaterialSpec {
    fn schema_name() -> Cow<'static, str> {
        "MaterialSpec".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let of = |key: &str, about: &str, content: Schema| {
            json_schema!({
                "description": about,
                "type": "object",
                "properties": { key: content },
                "required": [key],
                "additionalProperties": false
            })
        };
        let mut variants = vec![of(
            "umat",
            "Correspondence with the stress of a user's routine, called as Abaqus calls UMAT; the program has to be built with the feature umat.",
            generator.subschema_for::<UmatSpec>(),
        )];
        for law in Named::ALL {
            let content = named_law::schema(*law, generator);
            variants.push(of(law.key(), law.about(), content));
        }
        json_schema!({
            "description": "A material: its peridynamic law, beside which the local law is linear elasticity with the same constants.",
            "oneOf": variants
        })
    }
}

impl MaterialSpec {
    /// Key of its law.
    pub fn law(&self) -> &'static str {
        match self {
            Self::Named(m) => m.law.key(),
            Self::Umat(_) => "umat",
        }
    }

    /// Criteria by which its bonds break, each with its number.
    pub fn failure(&self) -> Vec<(&'static dyn FailureCriterion, &Number)> {
        match self {
            Self::Named(m) => m.failure.iter().map(|(c, number)| (*c, number)).collect(),
            Self::Umat(m) => {
                let typed = m.critical_stretch.iter();
                typed
                    .map(|number| (failure::CRITICAL_STRETCH, number))
                    .collect()
            }
        }
    }
}

/// Horizon, points and weights of the peridynamic region.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct PeridynamicsSpec {
    /// Horizon δ: a number, or an expression in x, y, z; three spacings of the points if left out, where no bond breaks.
    pub horizon: Option<Expression>,
    /// Bond weights.
    #[serde(default)]
    pub weights: BondWeights,
    /// Partial volume of a cell that the horizon cuts (SAND2015-7998 section 5.2.1); all but "full" need `points.lattice`.
    #[schemars(with = "Option<PartialVolume>")]
    pub volumes: Option<toml::Spanned<PartialVolume>>,
    /// Influence function of state-based laws; `{ degree = 3, alpha = 0 }` if left out.
    pub influence: Option<InfluenceSpec>,
    /// Positions of the points; a lattice if left out, as fine as the cells of the zone where they are alike, else a third of the horizon.
    pub points: Option<PointsSpec>,
    /// Dependence of the bond force on the displacement; "linear" without damage and "exact" with it if left out.
    #[schemars(with = "Option<BondKinematics>")]
    pub bonds: Option<toml::Spanned<BondKinematics>>,
    /// Constitutive law of the finite elements of the points' materials; "linear" if left out.
    #[schemars(with = "Option<super::motion::ElementsSpec>")]
    pub elements: Option<toml::Spanned<super::motion::ElementsSpec>>,
    /// Storage of the weights of bonds in scenes in time and load steps; "double" if left out.
    #[schemars(with = "Option<Storage>")]
    pub precision: Option<toml::Spanned<Storage>>,
    /// Calibration of the critical stretch to a fracture energy; "lattice" if left out.
    #[schemars(with = "Option<super::motion::CalibrationSpec>")]
    pub calibration: Option<toml::Spanned<super::motion::CalibrationSpec>>,
    /// Treatment of bonds across the mesh's own boundary (a hole, a notch); "cut" if left out.
    #[schemars(with = "Option<Surfaces>")]
    pub surfaces: Option<toml::Spanned<Surfaces>>,
}

impl PeridynamicsSpec {
    /// Returns true if a horizon is typed that is not constant.
    pub fn horizon_varies(&self) -> bool {
        let typed = self.horizon.as_ref();
        typed.is_some_and(|h| h.as_constant().is_none())
    }
}

/// Positions of the peridynamic points.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PointsSpec {
    /// One at the centroid of each cell of the zone.
    Cells,
    /// A regular lattice that fills the zone.
    Lattice(LatticeSpec),
    /// Those of a file, which are the whole body: the scene has no `mesh` then, and no finite elements.
    File(PointFileSpec),
}

/// Points from a file, each with its volume.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct PointFileSpec {
    /// The file, relative to the scene: a table whose first line names its columns, or a VTK file (`.vtk`, `.vtu`) whose points are the points.
    pub path: Text,
    /// The column of the coordinate x; "x" if left out.
    pub x: Option<Text>,
    /// The column of the coordinate y; "y" if left out.
    pub y: Option<Text>,
    /// The column of the coordinate z; "z" if left out.
    pub z: Option<Text>,
    /// The column, or the array of the points, of the volume (in the plane the area, of a bar the length); "volume" if left out.
    pub volume: Option<Text>,
}

/// A regular lattice of points.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct LatticeSpec {
    /// Distance of neighbours h.
    pub spacing: Number,
    /// Any point of the lattice; the mesh's lowest corner if left out, so that points coincide with the nodes of a
    /// mesh of the same spacing; with the coupling `truncated` half a spacing inside of that corner.
    pub origin: Option<Coordinates>,
}
