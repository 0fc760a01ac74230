//! Prescribed displacements.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::mesh::Mesh;
use crate::scene::components::{Components, components_in, finite};
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
        let at = (self.on.as_ref(), self.inside.as_ref());
        let support = held(place, name, at, &components, mesh, clock)?;
        Ok(Condition {
            name: name.value.clone(),
            prescribed: Prescribed::Displacement(support),
            components,
        })
    }
}

/// The place where a motion is prescribed, `on` a set or `inside` a shape, whose components are numbers there.
///
/// # Errors
/// [`SceneError`] for both or neither of the two, for a place that holds nothing, and for a component that is no number.
pub(super) fn held<const D: usize>(
    place: &str,
    name: &Text,
    (on, inside): (Option<&Text>, Option<&ShapeSpec>),
    components: &Components<D>,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Support<D>, SceneError> {
    let support = support(place, name, on, inside, mesh)?;
    if let Support::Set { nodes, .. } = &support {
        let nodes = nodes.iter().map(|&n| mesh.nodes[n as usize]);
        finite(place, name, components, clock, nodes)?;
    }
    Ok(support)
}
