//! Prescribed displacements.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::scene::components::Components;
use crate::scene::condition_at::ConditionAt;
use crate::scene::conditions::{Condition, Prescribed, Support};
use crate::scene::error::SceneError;
use crate::scene::expression::Expression;
use crate::scene::spec::ShapeSpec;
use crate::scene::value::Text;

/// Prescribed displacement: exactly one of `on` and `inside`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct DisplacementSpec {
    /// A named set of the mesh. Where peridynamics meets the set, points within three quarters of their spacing of it follow it: the first layer.
    pub on: Option<Text>,
    /// All sites inside a shape.
    pub inside: Option<ShapeSpec>,
    /// Displacement along x.
    pub x: Option<Expression>,
    /// Displacement along y.
    pub y: Option<Expression>,
    /// Displacement along z.
    pub z: Option<Expression>,
    /// Stages of the scene in which it acts; all if left out. After the stage in which it begins it keeps the values of its end.
    pub stages: Option<Vec<Text>>,
}

impl ConditionKind for DisplacementSpec {
    fn build<const D: usize>(&self, at: &ConditionAt<'_, D>) -> Result<Condition<D>, SceneError> {
        let components = at.components([&self.x, &self.y, &self.z])?;
        let support = held(at, (self.on.as_ref(), self.inside.as_ref()), &components)?;
        Ok(at.prescribes(Prescribed::Displacement(support), components))
    }

    fn stages(&self) -> Option<&[Text]> {
        self.stages.as_deref()
    }
}

/// The place where a motion is prescribed, `on` a set or `inside` a shape, whose components are numbers there.
///
/// # Errors
/// [`SceneError`] for both or neither of the two, for a place that holds nothing, and for a component that is no number.
pub(super) fn held<const D: usize>(
    at: &ConditionAt<'_, D>,
    (on, inside): (Option<&Text>, Option<&ShapeSpec>),
    components: &Components<D>,
) -> Result<Support<D>, SceneError> {
    let support = at.support(on, inside)?;
    if let Support::Set { nodes, .. } = &support {
        let nodes = nodes.iter().map(|&n| at.mesh.nodes[n as usize]);
        at.finite(components, nodes)?;
    }
    Ok(support)
}
