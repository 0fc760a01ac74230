//! Force per volume.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::mesh::Mesh;
use crate::scene::components::{components_in, finite};
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::error::SceneError;
use crate::scene::expression::Expression;
use crate::scene::load::{Domain, Load, typed};
use crate::scene::places::inside;
use crate::scene::region::Region;
use crate::scene::solve::Clock;
use crate::scene::spec::ShapeSpec;
use crate::scene::value::Text;

/// A force per volume.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BodyForceSpec {
    /// Region of the force; everywhere if left out.
    #[serde(default)]
    pub inside: Option<ShapeSpec>,
    /// Force along x.
    #[serde(default)]
    pub x: Option<Expression>,
    /// Force along y.
    #[serde(default)]
    pub y: Option<Expression>,
    /// Force along z.
    #[serde(default)]
    pub z: Option<Expression>,
}

impl ConditionKind for BodyForceSpec {
    fn build<const D: usize>(
        &self,
        place: &str,
        name: &Text,
        mesh: &Mesh<D>,
        clock: Clock,
    ) -> Result<Condition<D>, SceneError> {
        let components = components_in(place, name, [&self.x, &self.y, &self.z], clock)?;
        let region = match &self.inside {
            Some(shape) => inside(place, name, shape, mesh)?,
            None => Region::everywhere(),
        };
        let within = (0..mesh.cell_count())
            .map(|i| mesh.centroid(i))
            .filter(|x| region.contains(x, 0.0));
        finite(place, name, &components, clock, within)?;
        let load = Load {
            on: Domain::Cells(region),
            density: typed,
        };
        Ok(Condition {
            name: name.value.clone(),
            prescribed: Prescribed::Load(load),
            components,
        })
    }
}
