//! Pressure on the surface of the body.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::scene::bounds_checks;
use crate::scene::components::Components;
use crate::scene::condition_at::ConditionAt;
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::error::SceneError;
use crate::scene::expression::Expression;
use crate::scene::load::{Domain, Load};
use crate::scene::value::Text;

/// A pressure on a set of facets at the boundary of the body.
///
/// A dead load: area and normal are those of the reference configuration, whatever the body has moved.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct PressureSpec {
    /// A named set of facets of the mesh.
    pub on: Text,
    /// Pressure, positive where it presses on the body; may depend on place and time.
    pub value: Expression,
    /// Stages of the scene in which it acts; all if left out. After the stage in which it begins it keeps the values of its end.
    pub stages: Option<Vec<Text>>,
}

impl ConditionKind for PressureSpec {
    fn build<const D: usize>(&self, at: &ConditionAt<'_, D>) -> Result<Condition<D>, SceneError> {
        let place = format!("{}.value", at.place);
        bounds_checks::no_further_axes::<D>(&place, &self.value)?;
        at.clock.admits(&place, &self.value)?;
        let facets = at.outer_facets(&self.on)?;
        let components = Components::only(0, self.value.clone());
        let nodes = facets.iter().flat_map(|f| f.nodes.iter());
        let nodes = nodes.map(|&n| at.mesh.nodes[n as usize]);
        at.finite(&components, nodes)?;
        let load = Load {
            on: Domain::Surface(facets),
            // p is the first component
            density: |p, n| n * -p[0],
        };
        Ok(at.prescribes(Prescribed::Load(load), components))
    }

    fn stages(&self) -> Option<&[Text]> {
        self.stages.as_deref()
    }
}
