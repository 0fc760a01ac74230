//! Temperature and voids of a scene.

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use crate::scene::expression::Expression;
use crate::scene::spec::conduction::ConductionSpec;
use crate::scene::spec::region::ShapeSpec;
use crate::scene::value::Number;

/// A temperature, by which materials expand: exactly one of `value` and `conduction`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct TemperatureSpec {
    /// Temperature in x, y, z and, in scenes in time, t.
    pub value: Option<Expression>,
    /// Heat conduction, whose solution the temperature is.
    #[schemars(with = "Option<ConductionSpec>")]
    pub conduction: Option<Spanned<ConductionSpec>>,
    /// Temperature without thermal strain; 0 if left out.
    pub reference: Option<Number>,
}

/// An empty region.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct VoidSpec {
    /// Its shape.
    pub inside: ShapeSpec,
    /// True if bonds across it are cut; true if left out. Left uncut, an opening comes out several times too small.
    #[serde(default = "yes")]
    pub cut_bonds: bool,
}

fn yes() -> bool {
    true
}
