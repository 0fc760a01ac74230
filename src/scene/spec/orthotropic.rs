//! Orthotropic elastic materials of finite elements.

use schemars::JsonSchema;
use serde::Deserialize;

use super::region::CellsSpec;
use crate::scene::expression::Expression;
use crate::scene::value::Number;

/// An orthotropic elastic material of finite elements, which has no peridynamic points.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct OrthotropicSpec {
    /// Young's modulus E₁ along axis 1.
    pub e1: Number,
    /// Young's modulus E₂ along axis 2; not needed by a bar.
    pub e2: Option<Number>,
    /// Young's modulus E₃ along axis 3; needed in plane strain and by solids.
    pub e3: Option<Number>,
    /// Poisson's ratio ν₁₂: contraction along 2 under a stress along 1; ν₂₁ = ν₁₂ E₂/E₁.
    pub nu12: Option<Number>,
    /// Poisson's ratio ν₁₃; needed in plane strain and by solids.
    pub nu13: Option<Number>,
    /// Poisson's ratio ν₂₃; needed in plane strain and by solids.
    pub nu23: Option<Number>,
    /// Shear modulus G₁₂; not needed by a bar.
    pub g12: Option<Number>,
    /// Shear modulus G₁₃; needed by solids.
    pub g13: Option<Number>,
    /// Shear modulus G₂₃; needed by solids.
    pub g23: Option<Number>,
    /// In two dimensions the angle from x to axis 1, towards y, in degrees, a number or an expression in x and y; 0 if left out. Axis 3 is normal to the plane.
    pub angle: Option<Expression>,
    /// In three dimensions a vector along axis 1, of numbers or of expressions in x, y and z; x if both vectors are left out.
    pub axis_1: Option<Vec<Expression>>,
    /// In three dimensions a vector whose part perpendicular to axis 1 lies along axis 2; y if both vectors are left out.
    pub axis_2: Option<Vec<Expression>>,
    /// Density.
    pub density: Option<Number>,
    /// Linear thermal expansion along axis 1 per degree, with `[temperature]`.
    pub alpha1: Option<Number>,
    /// Linear thermal expansion along axis 2; not needed by a bar.
    pub alpha2: Option<Number>,
    /// Linear thermal expansion along axis 3; needed in plane strain and by solids.
    pub alpha3: Option<Number>,
    /// Thermal conductivity k, the same in all directions, with `[temperature.conduction]`.
    pub conductivity: Option<Number>,
    /// Heat capacity per volume ρ c, with `[temperature.conduction]` that has `initial`.
    pub heat_capacity: Option<Number>,
    /// The cells that this material fills: the name of a set, or a shape that holds their centroids.
    pub cells: Option<CellsSpec>,
}
