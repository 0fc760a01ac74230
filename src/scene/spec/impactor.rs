//! Rigid impactors of a scene.

use schemars::JsonSchema;
use serde::Deserialize;

use crate::scene::expression::Expression;
use crate::scene::value::{Coordinates, Number};

/// A rigid body that strikes or presses: exactly one of `sphere`, `cylinder`, `plane`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct ImpactorSpec {
    /// A sphere; a disc in 2D.
    pub sphere: Option<SphereSpec>,
    /// A cylinder without ends, in 3D.
    pub cylinder: Option<CylinderSpec>,
    /// The half space behind a plane.
    pub plane: Option<PlaneSpec>,
    /// Mass of an impactor that moves freely (per thickness in 2D, per section in 1D); without it its motion is prescribed.
    pub mass: Option<Number>,
    /// Velocity: at time zero of one with a mass, else prescribed, as numbers or expressions in t.
    pub velocity: Option<ImpactorMotionSpec>,
    /// Prescribed way from its place, in t.
    pub displacement: Option<ImpactorMotionSpec>,
    /// Factor of the penalty stiffness; 0.5 in motion and 10 in load steps if left out.
    pub stiffness_factor: Option<Number>,
}

/// A sphere.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct SphereSpec {
    /// Centre.
    pub center: Coordinates,
    /// Radius.
    pub radius: Number,
}

/// A cylinder without ends.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct CylinderSpec {
    /// A point of the axis.
    pub point: Coordinates,
    /// Direction of the axis, of any length.
    pub direction: Coordinates,
    /// Radius.
    pub radius: Number,
}

/// The half space behind a plane.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct PlaneSpec {
    /// A point of the plane.
    pub point: Coordinates,
    /// Normal out of the impactor, towards the body, of any length.
    pub normal: Coordinates,
}

/// A translation; components left out are zero.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct ImpactorMotionSpec {
    // with defaults a list may have fewer components: `velocity = [0, -1]`
    /// Component along x.
    #[serde(default)]
    pub x: Option<Expression>,
    /// Component along y.
    #[serde(default)]
    pub y: Option<Expression>,
    /// Component along z.
    #[serde(default)]
    pub z: Option<Expression>,
}
