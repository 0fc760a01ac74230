//! Bonds between two materials.

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use crate::scene::value::{Number, Text};

/// Bonds between the points of two materials.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct MaterialInterfaceSpec {
    /// The names of the two materials.
    pub between: Vec<Text>,
    /// The stiffness of these bonds, of laws whose bonds act alone; "harmonic-mean" if left out.
    #[serde(default)]
    #[schemars(with = "Option<StiffnessSpec>")]
    pub stiffness: Option<Spanned<StiffnessSpec>>,
    /// Energy per area of a crack along the interface, from which the critical stretch of these bonds follows.
    #[serde(default)]
    pub fracture_energy: Option<Number>,
    /// Stretch at which these bonds break, instead of `fracture-energy`.
    #[serde(default)]
    pub critical_stretch: Option<Number>,
}

/// The stiffness of a bond between two materials, by those of bonds within each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StiffnessSpec {
    /// `2 a b/(a + b)`, as of two halves in series.
    HarmonicMean,
    /// `(a + b)/2`.
    ArithmeticMean,
}
