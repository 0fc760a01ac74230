//! Heat conduction, as scenes type it.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::scene::expression::Expression;
use crate::scene::spec::region::ShapeSpec;
use crate::scene::value::{Count, Number, Text};

/// A temperature that is solved for: steady without `initial`, transient with it.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct ConductionSpec {
    /// Temperature at time zero in x, y, z, of a scene in time; without it the temperature is steady at every instant.
    pub initial: Option<Expression>,
    /// Time steps of equal length over the duration of a scene in time; 100 if left out.
    pub steps: Option<Count>,
    /// Temperatures, heat fluxes, heat transfer and heat sources by name.
    #[serde(default)]
    pub conditions: BTreeMap<Text, HeatConditionSpec>,
}

/// A condition of heat conduction; a surface without any is insulated.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HeatConditionSpec {
    /// Prescribed temperature.
    Temperature(HeldTemperatureSpec),
    /// Heat transfer to surroundings on a set of facets.
    Convection(HeatTransferSpec),
    /// Heat flux into the body on a set of facets.
    Flux(HeatFluxSpec),
    /// Heat source per volume.
    Source(HeatSourceSpec),
}

/// A prescribed temperature: exactly one of `on` and `inside`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct HeldTemperatureSpec {
    /// A named set of the mesh.
    pub on: Option<Text>,
    /// The nodes inside a shape.
    pub inside: Option<ShapeSpec>,
    /// Temperature in x, y, z and, in scenes in time, t.
    pub value: Expression,
}

/// Heat transfer to surroundings: a flux `coefficient (ambient − T)` into the body.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct HeatTransferSpec {
    /// A named set of facets of the mesh.
    pub on: Text,
    /// Heat-transfer coefficient: heat per time, area and degree.
    pub coefficient: Number,
    /// Temperature of the surroundings in x, y, z and, in scenes in time, t.
    pub ambient: Expression,
}

/// A heat flux into the body.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct HeatFluxSpec {
    /// A named set of facets of the mesh.
    pub on: Text,
    /// Heat per time and area in x, y, z and, in scenes in time, t.
    pub value: Expression,
}

/// A heat source.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct HeatSourceSpec {
    /// The cells of the mesh with their centroid in a shape; the whole body if left out.
    pub inside: Option<ShapeSpec>,
    /// Heat per time and volume in x, y, z and, in scenes in time, t.
    pub value: Expression,
}
