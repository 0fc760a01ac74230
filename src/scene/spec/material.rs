//! Materials and peridynamics of a scene.

use std::borrow::Cow;
use std::fmt;
use std::sync::LazyLock;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{self, DeserializeSeed, Deserializer, EnumAccess, VariantAccess, Visitor};

use super::influence::InfluenceSpec;
use super::named_law::{self, NamedSpec};
use super::orthotropic::OrthotropicSpec;
use super::region::CellsSpec;
use super::user_material::UmatSpec;
use crate::model::Surfaces;
use crate::peridynamics::bond_force::{BondKinematics, Storage};
use crate::peridynamics::failure::{self, FailureCriterion};
use crate::peridynamics::laws::Named;
use crate::peridynamics::{BondWeights, PartialVolume};
use crate::scene::expression::Expression;
use crate::scene::value::{Coordinates, Number, Text};

/// A material: its peridynamic law, beside which the local law is linear elasticity with the same constants; or a local law alone.
#[derive(Clone, Debug)]
pub enum MaterialSpec {
    /// A routine of a user's library.
    Umat(UmatSpec),
    /// An orthotropic material of finite elements.
    Orthotropic(Box<OrthotropicSpec>),
    /// A law of [`Named`].
    Named(NamedSpec),
}

impl MaterialSpec {
    /// Keys of materials.
    pub fn keys() -> &'static [&'static str] {
        &KEYS
    }

    /// Thermal expansion, where it is typed; of several the first.
    pub fn thermal_expansion(&self) -> Option<&Number> {
        match self {
            Self::Named(m) => m.thermal_expansion.as_ref(),
            Self::Umat(m) => m.thermal_expansion.as_ref(),
            Self::Orthotropic(m) => {
                let typed = [&m.alpha1, &m.alpha2, &m.alpha3];
                typed.into_iter().flatten().next()
            }
        }
    }

    /// Density, where it is typed.
    pub fn density(&self) -> Option<&Number> {
        match self {
            Self::Named(m) => m.density.as_ref(),
            Self::Umat(m) => m.density.as_ref(),
            Self::Orthotropic(m) => m.density.as_ref(),
        }
    }

    /// The cells that it fills, where they are typed.
    pub fn cells(&self) -> Option<&CellsSpec> {
        match self {
            Self::Named(m) => m.cells.as_ref(),
            Self::Umat(m) => m.cells.as_ref(),
            Self::Orthotropic(m) => m.cells.as_ref(),
        }
    }

    /// Thermal conductivity and heat capacity per volume, where they are typed.
    pub fn conduction(&self) -> [Option<&Number>; 2] {
        match self {
            Self::Named(m) => [m.conductivity.as_ref(), m.heat_capacity.as_ref()],
            Self::Umat(m) => [m.conductivity.as_ref(), m.heat_capacity.as_ref()],
            Self::Orthotropic(m) => [m.conductivity.as_ref(), m.heat_capacity.as_ref()],
        }
    }
}

/// Keys of materials.
static KEYS: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| (Named::KEYS.iter().copied().chain([ORTHOTROPIC, "umat"])).collect());

/// The key of orthotropic materials.
const ORTHOTROPIC: &str = "orthotropic";

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
                    Key::Orthotropic => MaterialSpec::Orthotropic(content.newtype_variant()?),
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
    Orthotropic,
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
            ORTHOTROPIC => Key::Orthotropic,
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
        let mut variants = vec![
            of(
                "umat",
                "Correspondence with the stress of a user's routine, called as Abaqus calls UMAT; the program has to be built with the feature umat.",
                generator.subschema_for::<UmatSpec>(),
            ),
            of(
                ORTHOTROPIC,
                "Orthotropic linear elasticity of finite elements, without peridynamic points.",
                generator.subschema_for::<OrthotropicSpec>(),
            ),
        ];
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
            Self::Orthotropic(_) => ORTHOTROPIC,
        }
    }

    /// Criteria by which its bonds break, each with its number.
    pub fn failure(&self) -> Vec<(&'static dyn FailureCriterion, &Number)> {
        match self {
            Self::Named(m) => m.failure.iter().map(|(c, number)| (*c, number)).collect(),
            Self::Orthotropic(_) => Vec::new(),
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
    /// Rule for bonds between points of different horizons; "dual" if left out, and of bodies what their coupling has.
    #[schemars(with = "Option<HorizonChangeSpec>")]
    pub horizon_change: Option<toml::Spanned<HorizonChangeSpec>>,
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
    /// Returns true if points of different horizons are typed to be spliced.
    pub fn splices(&self) -> bool {
        let typed = self.horizon_change.as_ref().map(|typed| *typed.get_ref());
        typed == Some(HorizonChangeSpec::Splice)
    }

    /// Returns true if a horizon is typed that is not constant.
    pub fn horizon_varies(&self) -> bool {
        let typed = self.horizon.as_ref();
        typed.is_some_and(|h| h.as_constant().is_none())
    }
}

/// Rules for bonds between points of different horizons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HorizonChangeSpec {
    /// Each point has the force state of its own horizon, which acts at both ends of its bonds (SAND2015-7998 eq. (2.5), (2.15)).
    Dual,
    /// A bond has the larger horizon of its ends, weakened for the other (Jenabidehkordi and Rabczuk 2019 eq. (7)).
    MultiHorizon,
    /// Each point sees all others with its own horizon (SAND2015-7998 section 2.5).
    Splice,
    /// Divergence of the partial stress (SAND2015-7998 eq. (2.20)): coupling `partial-stress`.
    PartialStress,
    /// A layer of elements between bodies: coupling `truncated` with `zones.bodies`.
    Layer,
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
