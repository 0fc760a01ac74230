//! Force per area on facets.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::scene::condition_at::ConditionAt;
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::error::SceneError;
use crate::scene::expression::Expression;
use crate::scene::load::{Domain, Load, typed};
use crate::scene::value::Text;

/// A traction on a set of facets.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct TractionSpec {
    /// A named set of facets of the mesh.
    pub on: Text,
    /// Traction along x.
    pub x: Option<Expression>,
    /// Traction along y.
    pub y: Option<Expression>,
    /// Traction along z.
    pub z: Option<Expression>,
    /// Stages of the scene in which it acts; all if left out. After the stage in which it begins it keeps the values of its end.
    pub stages: Option<Vec<Text>>,
}

impl ConditionKind for TractionSpec {
    fn build<const D: usize>(&self, at: &ConditionAt<'_, D>) -> Result<Condition<D>, SceneError> {
        let components = at.components([&self.x, &self.y, &self.z])?;
        let facets = at.facet_set(&self.on)?;
        // else a line through cells would carry a load
        at.faces(&self.on)?;
        let nodes = facets.iter().flatten().map(|&n| at.mesh.nodes[n as usize]);
        at.finite(&components, nodes)?;
        let load = Load {
            on: Domain::Facets(facets.to_vec()),
            density: typed,
        };
        Ok(at.prescribes(Prescribed::Load(load), components))
    }

    fn stages(&self) -> Option<&[Text]> {
        self.stages.as_deref()
    }
}
