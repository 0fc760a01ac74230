//! Conditions and voids of a scene.

use schemars::JsonSchema;
use serde::Deserialize;

use crate::scene::expression::Expression;
use crate::scene::spec::region::ShapeSpec;
use crate::scene::value::{Coordinates, Number, Text};

/// What is prescribed somewhere.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ConditionSpec {
    /// Displacement, component by component; components left out stay free.
    Displacement(DisplacementSpec),
    /// Velocity, component by component, in a scene that moves; components left out stay free.
    Velocity(VelocitySpec),
    /// Force per area (per length of thickness 1 in 2D; a force in 1D) on a set of facets.
    Traction(TractionSpec),
    /// Pressure on a set of facets: a force per area against the outward normal, in the reference configuration.
    Pressure(PressureSpec),
    /// Force per volume.
    BodyForce(BodyForceSpec),
    /// Springs to the ground, an elastic foundation: a force per area against the displacement.
    Spring(SpringSpec),
    /// A plane of symmetry: no displacement along its normal.
    Symmetry(SymmetrySpec),
    /// Rigid rotation about a centre, as an axis or a grip imposes it.
    Rotation(RotationSpec),
}

/// Prescribed displacement: exactly one of `on` and `inside`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct DisplacementSpec {
    /// A named set of the mesh. Where peridynamics meets the set, points within three quarters of their spacing of it follow it: the first layer.
    #[serde(default)]
    pub on: Option<Text>,
    /// All sites inside a shape.
    #[serde(default)]
    pub inside: Option<ShapeSpec>,
    /// Displacement along x.
    #[serde(default)]
    pub x: Option<Expression>,
    /// Displacement along y.
    #[serde(default)]
    pub y: Option<Expression>,
    /// Displacement along z.
    #[serde(default)]
    pub z: Option<Expression>,
}

/// Prescribed velocity: exactly one of `on` and `inside`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct VelocitySpec {
    /// A named set of the mesh. Where peridynamics meets the set, points within three quarters of their spacing of it follow it: the first layer.
    #[serde(default)]
    pub on: Option<Text>,
    /// All sites inside a shape.
    #[serde(default)]
    pub inside: Option<ShapeSpec>,
    /// Velocity along x.
    #[serde(default)]
    pub x: Option<Expression>,
    /// Velocity along y.
    #[serde(default)]
    pub y: Option<Expression>,
    /// Velocity along z.
    #[serde(default)]
    pub z: Option<Expression>,
}

/// A traction on a set of facets.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct TractionSpec {
    /// A named set of facets of the mesh.
    pub on: Text,
    /// Traction along x.
    #[serde(default)]
    pub x: Option<Expression>,
    /// Traction along y.
    #[serde(default)]
    pub y: Option<Expression>,
    /// Traction along z.
    #[serde(default)]
    pub z: Option<Expression>,
}

/// A pressure on a set of facets at the boundary of the body.
///
/// A dead load: area and normal are those of the reference configuration, whatever the body has moved.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct PressureSpec {
    /// A named set of facets of the mesh.
    pub on: Text,
    /// Pressure, positive where it presses on the body; may depend on place and time.
    pub value: Expression,
}

/// Springs to the ground: exactly one of `on` and `inside`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct SpringSpec {
    /// A named set of facets of the mesh; stiffnesses are forces per area and displacement.
    #[serde(default)]
    pub on: Option<Text>,
    /// The cells of the mesh with their centroid in a shape; stiffnesses are forces per volume and displacement.
    #[serde(default)]
    pub inside: Option<ShapeSpec>,
    /// Stiffness along x.
    #[serde(default)]
    pub x: Option<Number>,
    /// Stiffness along y.
    #[serde(default)]
    pub y: Option<Number>,
    /// Stiffness along z.
    #[serde(default)]
    pub z: Option<Number>,
    /// Stiffness along the normal of the set, instead of components.
    #[serde(default)]
    pub normal: Option<Number>,
}

/// A plane of symmetry along the axes.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct SymmetrySpec {
    /// A named set of the mesh, all of whose nodes lie in one plane x, y or z = constant.
    pub on: Text,
}

/// A rigid rotation: exactly one of `on` and `inside`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct RotationSpec {
    /// A named set of the mesh.
    #[serde(default)]
    pub on: Option<Text>,
    /// All sites inside a shape.
    #[serde(default)]
    pub inside: Option<ShapeSpec>,
    /// A point of the axis.
    pub center: Coordinates,
    /// Direction of the axis in 3D, of any length; in a plane the axis is z.
    #[serde(default)]
    pub axis: Option<Coordinates>,
    /// Angle in degrees, right-handed about the axis (counter-clockwise in a plane); may depend on the time.
    pub angle: Expression,
}

/// A force per volume.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BodyForceSpec {
    /// Where; everywhere if left out.
    #[serde(default)]
    pub inside: Option<ShapeSpec>,
    /// Force along x.
    #[serde(default)]
    pub x: Option<Expression>,
    /// Force along y.
    #[serde(default)]
    pub y: Option<Expression>,
    /// Force along z.
    #[serde(default)]
    pub z: Option<Expression>,
}

/// A temperature, by which bond-based and lps materials expand.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct TemperatureSpec {
    /// Temperature in x, y, z and, in scenes in time, t.
    pub value: Expression,
    /// Temperature without thermal strain; 0 if left out.
    #[serde(default)]
    pub reference: Option<Number>,
}

/// An empty region.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct VoidSpec {
    /// Its shape.
    pub inside: ShapeSpec,
    /// Whether bonds across it are cut. Left uncut, an opening comes out several times too small.
    #[serde(default = "yes")]
    pub cut_bonds: bool,
}

fn yes() -> bool {
    true
}
