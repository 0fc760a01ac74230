//! Shapes and zones of a scene.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use crate::scene::value::{Coordinates, Number, Text};

/// Nonlocal zone of the body, and transition zone where the two models overlap. All else is local.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct ZonesSpec {
    /// Nonlocal where a solution with finite elements alone says that it must be; `zones = "auto"` where no option is set.
    #[schemars(with = "Option<AutoSpec>")]
    pub auto: Option<Spanned<AutoSpec>>,
    /// Peridynamics only. Cells whose centroid lies inside.
    #[schemars(with = "Option<ShapeSpec>")]
    pub nonlocal: Option<Spanned<ShapeSpec>>,
    /// Both models at once (blending, partial stress). Cells whose centroid lies inside and that are not nonlocal.
    #[schemars(with = "Option<TransitionSpec>")]
    pub transition: Option<Spanned<TransitionSpec>>,
    /// Action when damage reaches the edge of the nonlocal zone; "stop" if left out.
    #[schemars(with = "Option<EdgeSpec>")]
    pub damage_at_edge: Option<Spanned<EdgeSpec>>,
    /// The nonlocal zone follows the crack; `{}` for the defaults. Scenes in time only.
    #[schemars(with = "Option<FollowSpec>")]
    pub follow: Option<Spanned<FollowSpec>>,
    /// Cells of the nonlocal zone that are elements all the same, so that no bond is missing there.
    pub skin: Option<SkinSpec>,
    /// Cells along which the seam runs. If left out, those of the mesh; but with truncated bonds whose faces do not follow the lattice "own", in 3D at once, else where they do not hold.
    #[schemars(with = "Option<RimSpec>")]
    pub rim: Option<Spanned<RimSpec>>,
    /// Parts of the nonlocal zone with a horizon and a lattice of their own, by name; a layer of elements keeps them apart. Coupling `truncated` only.
    #[serde(default)]
    pub bodies: BTreeMap<Text, BodySpec>,
}

/// Criteria by which the nonlocal zone is placed: cracks and voids, the error of the local model, bonds that may break.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct AutoSpec {
    /// Fraction of the critical stretch from which a bond is taken to be near breaking; 0.5 if left out.
    pub stretch: Option<Number>,
    /// Horizons by which what is marked is padded, at least 1; 1 if left out, and 2 around cracks, voids and notches.
    pub padding: Option<Number>,
    /// Error of the local model that may remain, relative in the norm of energy; 0.05 if left out.
    pub tolerance: Option<Number>,
}

/// Settings of a nonlocal zone that follows the crack.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct FollowSpec {
    /// Fraction of the critical stretch from which a cell is wanted in the zone; 0.8 if left out.
    pub stretch: Option<Number>,
    /// Distance by which the zone extends beyond such cells when it changes; five horizons if left out.
    pub padding: Option<Number>,
    /// Distance by which it extends ahead of the tips of cracks when it changes; 1.5 paddings if left out.
    pub ahead: Option<Number>,
}

/// A part of the nonlocal zone with a horizon and a lattice of its own.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BodySpec {
    /// Its shape; cells whose centroid lies inside. Cells of the rest of the zone that touch one of them become elements.
    pub inside: ShapeSpec,
    /// Its horizon δ.
    pub horizon: Number,
    /// The spacing of its points.
    pub spacing: Number,
}

/// Layer of elements that covers the nonlocal zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SkinSpec {
    /// Elements on the boundary of the mesh: one cell thick, or as thick as a rim of its own is; meant for the coupling `truncated`.
    FreeSurfaces,
    /// No such layer.
    None,
}

/// Cells along which the seam runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RimSpec {
    /// Those of the mesh.
    Mesh,
    /// A layer of elements on the lattice of the points, tied to the mesh around it; the zone consists of cells of the lattice, whatever the mesh is.
    Own,
}

/// A region of space or a named set of cells.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ShapeSpec {
    /// An axis-parallel box (an interval in 1D, a rectangle in 2D).
    Box(BoxSpec),
    /// All points within a radius of a centre.
    Ball(BallSpec),
    /// A point; of use in 1D cracks and within `near`.
    Point(Coordinates),
    /// A straight line.
    Segment(SegmentSpec),
    /// Straight lines from each point to the next.
    Polyline(Vec<Coordinates>),
    /// A closed polygon: its area in 2D, a plane surface in 3D.
    Polygon(Vec<Coordinates>),
    /// All points within a distance of another shape, such as a crack line.
    Near(NearSpec),
    /// A named set of cells of the mesh.
    Set(Text),
    /// The whole body.
    Everywhere(bool),
    /// All points of any of several shapes.
    Any(Vec<ShapeSpec>),
    /// A shape without another.
    Without(Box<WithoutSpec>),
}

/// The cells of a material: a shape, or the name of a set.
///
/// A name is read as `{ set = "name" }`.
#[derive(Clone, Debug, Deserialize)]
#[serde(transparent)]
pub struct CellsSpec(pub ShapeSpec);

impl JsonSchema for CellsSpec {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "CellsSpec".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let shape = generator.subschema_for::<ShapeSpec>();
        schemars::json_schema!({
            "description": "The cells of a material: the name of a set, or a shape that holds their centroids.",
            "anyOf": [{ "type": "string" }, shape]
        })
    }
}

/// The region where both models overlap.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TransitionSpec {
    /// All cells within this distance of the nonlocal zone.
    Around(Number),
    /// An axis-parallel box.
    Box(BoxSpec),
    /// All points within a radius of a centre.
    Ball(BallSpec),
    /// A point; of use within `near`.
    Point(Coordinates),
    /// A straight line.
    Segment(SegmentSpec),
    /// Straight lines from each point to the next.
    Polyline(Vec<Coordinates>),
    /// A closed polygon.
    Polygon(Vec<Coordinates>),
    /// All points within a distance of a shape.
    Near(NearSpec),
    /// A named set of cells of the mesh.
    Set(Text),
    /// The whole body.
    Everywhere(bool),
    /// All points of any of several shapes.
    Any(Vec<ShapeSpec>),
    /// A shape without another.
    Without(Box<WithoutSpec>),
}

/// An axis-parallel box.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BoxSpec {
    /// Smallest corner.
    pub min: Coordinates,
    /// Largest corner.
    pub max: Coordinates,
}

/// All points within `radius` of `center`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BallSpec {
    /// Centre.
    pub center: Coordinates,
    /// Radius.
    pub radius: Number,
}

/// A straight line from one point to another.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct SegmentSpec {
    /// Start.
    pub from: Coordinates,
    /// End.
    pub to: Coordinates,
}

/// All points within a distance of a shape: exactly one shape beside `within`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct NearSpec {
    /// The distance.
    pub within: Number,
    /// A point.
    pub point: Option<Coordinates>,
    /// A straight line.
    pub segment: Option<SegmentSpec>,
    /// Straight lines from each point to the next.
    pub polyline: Option<Vec<Coordinates>>,
    /// A closed polygon.
    pub polygon: Option<Vec<Coordinates>>,
    /// An axis-parallel box.
    #[serde(default, rename = "box")]
    pub cuboid: Option<BoxSpec>,
}

/// A shape without another.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct WithoutSpec {
    /// Shape from which the other is removed.
    pub from: ShapeSpec,
    /// Shape that is removed.
    pub removed: ShapeSpec,
}

/// Action when damage reaches the edge of the nonlocal zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeSpec {
    /// The run ends there, its outputs written.
    Stop,
    /// The run goes on; the summary says when it happened.
    Warn,
}
