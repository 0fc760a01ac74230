//! Bonds between two materials.

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use crate::peridynamics::laws::StiffnessMean;
use crate::scene::value::{Number, Text};

/// Bonds between the points of two materials.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct MaterialInterfaceSpec {
    /// The names of the two materials.
    pub between: Vec<Text>,
    /// The stiffness of these bonds, of laws whose bonds act alone; "harmonic-mean" if left out.
    #[schemars(with = "Option<StiffnessMean>")]
    pub stiffness: Option<Spanned<StiffnessMean>>,
    /// Energy per area of a crack along the interface, from which the critical stretch of these bonds follows.
    pub fracture_energy: Option<Number>,
    /// Stretch at which these bonds break, instead of `fracture-energy`.
    pub critical_stretch: Option<Number>,
}
