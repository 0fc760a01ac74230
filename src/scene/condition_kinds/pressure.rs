//! Pressure on the surface of the body.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::mesh::Mesh;
use crate::scene::bounds_checks;
use crate::scene::components::{Components, finite};
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::error::SceneError;
use crate::scene::expression::Expression;
use crate::scene::load::{Domain, Load};
use crate::scene::places::outer_facets;
use crate::scene::solve::Clock;
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
}

impl ConditionKind for PressureSpec {
    fn build<const D: usize>(
        &self,
        place: &str,
        name: &Text,
        mesh: &Mesh<D>,
        clock: Clock,
    ) -> Result<Condition<D>, SceneError> {
        let at = format!("{place}.value");
        bounds_checks::no_further_axes::<D>(&at, &self.value)?;
        clock.admits(&at, &self.value)?;
        let facets = outer_facets(place, &self.on, mesh)?;
        let components = Components::only(0, self.value.clone());
        let nodes = facets.iter().flat_map(|f| f.nodes.iter());
        let nodes = nodes.map(|&n| mesh.nodes[n as usize]);
        finite(place, name, &components, clock, nodes)?;
        let load = Load {
            on: Domain::Surface(facets),
            // p is the first component
            density: |p, n| n * -p[0],
        };
        Ok(Condition {
            name: name.value.clone(),
            prescribed: Prescribed::Load(load),
            components,
        })
    }
}
