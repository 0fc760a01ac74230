//! The mesh of a scene.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{self, Deserializer, Unexpected, Visitor};
use toml::Spanned;

use crate::mesh::{MeshParts, Order};
use crate::scene::value::{Coordinates, Count, Number, Text};

/// A generated mesh or one from a file.
///
/// Generated meshes carry the facet sets `left`, `right` (x), `bottom`, `top` (y), `back`, `front` (z).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MeshSpec {
    /// A line of two-node cells (1D).
    Line(LineMeshSpec),
    /// A rectangle of quadrilaterals or triangles (2D).
    Rectangle(RectangleMeshSpec),
    /// A box of hexahedra or tetrahedra (3D).
    Box(BoxMeshSpec),
    /// A Gmsh (`.msh`, 2.2 or 4.1), Abaqus or CalculiX (`.inp`) or VTK (`.vtk`, `.vtu`) file; physical groups and sets become named sets.
    File(FileMeshSpec),
}

/// A line of two-node cells.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct LineMeshSpec {
    /// Left end.
    pub min: Coordinates,
    /// Right end.
    pub max: Coordinates,
    /// Division of the line into cells.
    #[schemars(with = "AxisSpec")]
    pub x: Spanned<AxisSpec>,
    /// Intervals left out, by name.
    #[serde(default)]
    pub cutouts: BTreeMap<Text, CutoutSpec>,
}

/// A rectangle of quadrilaterals or triangles.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct RectangleMeshSpec {
    /// Smallest corner.
    pub min: Coordinates,
    /// Largest corner.
    pub max: Coordinates,
    /// Division of the x axis into cells.
    #[schemars(with = "AxisSpec")]
    pub x: Spanned<AxisSpec>,
    /// Division of the y axis into cells.
    #[schemars(with = "AxisSpec")]
    pub y: Spanned<AxisSpec>,
    /// Shape of the cells.
    #[serde(default)]
    pub cell: PlaneCellSpec,
    /// Boxes left out, by name; their edges become facet sets of that name. Cells whose centroid lies inside are removed.
    #[serde(default)]
    pub cutouts: BTreeMap<Text, CutoutSpec>,
}

/// A box of hexahedra or tetrahedra.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BoxMeshSpec {
    /// Smallest corner.
    pub min: Coordinates,
    /// Largest corner.
    pub max: Coordinates,
    /// Division of the x axis into cells.
    #[schemars(with = "AxisSpec")]
    pub x: Spanned<AxisSpec>,
    /// Division of the y axis into cells.
    #[schemars(with = "AxisSpec")]
    pub y: Spanned<AxisSpec>,
    /// Division of the z axis into cells.
    #[schemars(with = "AxisSpec")]
    pub z: Spanned<AxisSpec>,
    /// Shape of the cells.
    #[serde(default)]
    pub cell: SolidCellSpec,
    /// Boxes left out, by name; their faces become facet sets of that name.
    #[serde(default)]
    pub cutouts: BTreeMap<Text, CutoutSpec>,
}

/// A mesh from a file.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct FileMeshSpec {
    /// The file, relative to the scene.
    pub path: Text,
    /// The order of the cells; "kept" if left out.
    #[serde(default)]
    pub order: Order,
    /// Sets of cells that are left out, and types of elements of a deck (`.inp`), such as `"T2D2"`.
    #[serde(default)]
    pub ignore: Vec<Text>,
    /// Nodes at one place: false keeps them apart, a distance makes those within it one. If left out, those along a crack stay apart, and others are refused.
    #[serde(default)]
    pub merge: Option<MergeSpec>,
    /// A mesh in memory that stands for the file; the source of the scene has it.
    #[serde(skip)]
    pub held: Option<Arc<MeshParts>>,
}

/// Treatment of nodes of a file at one place: false, or a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MergeSpec {
    /// All stay.
    Keep,
    /// Those within this distance are one \[length\].
    Within(f64),
}

impl<'de> Deserialize<'de> for MergeSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Choices;
        impl Visitor<'_> for Choices {
            type Value = MergeSpec;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("false, or a distance above zero")
            }

            fn visit_bool<E: de::Error>(self, v: bool) -> Result<MergeSpec, E> {
                match v {
                    false => Ok(MergeSpec::Keep),
                    true => Err(E::invalid_value(Unexpected::Bool(v), &self)),
                }
            }

            fn visit_i64<E: de::Error>(self, v: i64) -> Result<MergeSpec, E> {
                self.visit_f64(v as f64)
            }

            fn visit_f64<E: de::Error>(self, v: f64) -> Result<MergeSpec, E> {
                match v > 0.0 && v.is_finite() {
                    true => Ok(MergeSpec::Within(v)),
                    false => Err(E::invalid_value(Unexpected::Float(v), &self)),
                }
            }
        }
        deserializer.deserialize_any(Choices)
    }
}

impl JsonSchema for MergeSpec {
    fn schema_name() -> Cow<'static, str> {
        "MergeSpec".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [{ "const": false }, { "type": "number", "exclusiveMinimum": 0 }] })
    }
}

/// A box that a generated mesh leaves out.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct CutoutSpec {
    /// Smallest corner.
    pub min: Coordinates,
    /// Largest corner.
    pub max: Coordinates,
}

/// Division of an axis of a generated mesh into cells.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AxisSpec {
    /// This many equal cells.
    Cells(Count),
    /// Equal cells of about this size; the length is divided by the nearest whole number.
    Spacing(Number),
    /// Fine in one interval, growing away from it.
    Graded(GradedSpec),
}

/// A fine interval with cells that grow away from it.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct GradedSpec {
    /// Both ends of the fine interval.
    pub fine: Coordinates,
    /// Cell size in the fine interval.
    pub spacing: Number,
    /// Ratio of neighbouring cell sizes outside, at least 1.
    pub growth: Option<Number>,
    /// The largest cell size.
    pub largest: Option<Number>,
}

/// Cells of a plane mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PlaneCellSpec {
    /// Four-node quadrilaterals.
    #[default]
    Quad4,
    /// Three-node triangles, two in each quadrilateral.
    Tri3,
    /// Eight-node quadrilaterals.
    Quad8,
    /// Six-node triangles, two in each quadrilateral.
    Tri6,
}

/// Cells of a solid mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SolidCellSpec {
    /// Eight-node hexahedra.
    #[default]
    Hex8,
    /// Four-node tetrahedra, six in each hexahedron.
    Tet4,
    /// Twenty-node hexahedra.
    Hex20,
    /// Ten-node tetrahedra, six in each hexahedron.
    Tet10,
}
