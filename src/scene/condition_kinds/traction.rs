//! Force per area on facets.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::mesh::Mesh;
use crate::scene::components::{components_in, finite};
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::error::SceneError;
use crate::scene::expression::Expression;
use crate::scene::load::{Domain, Load, typed};
use crate::scene::places::{faces, facet_set};
use crate::scene::solve::Clock;
use crate::scene::value::Text;

/// A traction on a set of facets.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct TractionSpec {
    /// A named set of facets of the mesh.
    pub on: Text,
    /// Traction along x.
    #[serde(default)]
    pub x: Option<Expression>,
    /// Traction along y.
    #[serde(default)]
    pub y: Option<Expression>,
    /// Traction along z.
    #[serde(default)]
    pub z: Option<Expression>,
}

impl ConditionKind for TractionSpec {
    fn build<const D: usize>(
        &self,
        place: &str,
        name: &Text,
        mesh: &Mesh<D>,
        clock: Clock,
    ) -> Result<Condition<D>, SceneError> {
        let components = components_in(place, name, [&self.x, &self.y, &self.z], clock)?;
        let facets = facet_set(place, &self.on, mesh)?;
        // else a line through cells would carry a load
        faces(place, &self.on, mesh)?;
        let nodes = facets.iter().flatten().map(|&n| mesh.nodes[n as usize]);
        finite(place, name, &components, clock, nodes)?;
        let load = Load {
            on: Domain::Facets(facets.to_vec()),
            density: typed,
        };
        Ok(Condition {
            name: name.value.clone(),
            prescribed: Prescribed::Load(load),
            components,
        })
    }
}
