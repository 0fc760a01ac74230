//! Prescribed displacements.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::mesh::Mesh;
use crate::scene::components::{components_in, finite};
use crate::scene::conditions::{Condition, Prescribed, Support};
use crate::scene::error::SceneError;
use crate::scene::expression::Expression;
use crate::scene::places::support;
use crate::scene::solve::Clock;
use crate::scene::spec::ShapeSpec;
use crate::scene::value::Text;

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

impl ConditionKind for DisplacementSpec {
    fn build<const D: usize>(
        &self,
        place: &str,
        name: &Text,
        mesh: &Mesh<D>,
        clock: Clock,
    ) -> Result<Condition<D>, SceneError> {
        let components = components_in(place, name, [&self.x, &self.y, &self.z], clock)?;
        let support = support(place, name, self.on.as_ref(), self.inside.as_ref(), mesh)?;
        if let Support::Set { nodes, .. } = &support {
            let nodes = nodes.iter().map(|&n| mesh.nodes[n as usize]);
            finite(place, name, &components, clock, nodes)?;
        }
        Ok(Condition {
            name: name.value.clone(),
            prescribed: Prescribed::Displacement(support),
            components,
        })
    }
}
