//! Force per volume.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::scene::condition_at::ConditionAt;
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::error::SceneError;
use crate::scene::expression::Expression;
use crate::scene::load::{Domain, Load, typed};
use crate::scene::region::Region;
use crate::scene::spec::ShapeSpec;
use crate::scene::value::Text;

/// A force per volume.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BodyForceSpec {
    /// Region of the force; everywhere if left out.
    pub inside: Option<ShapeSpec>,
    /// Force along x.
    pub x: Option<Expression>,
    /// Force along y.
    pub y: Option<Expression>,
    /// Force along z.
    pub z: Option<Expression>,
    /// Stages of the scene in which it acts; all if left out. After the stage in which it begins it keeps the values of its end.
    pub stages: Option<Vec<Text>>,
}

impl ConditionKind for BodyForceSpec {
    fn build<const D: usize>(&self, at: &ConditionAt<'_, D>) -> Result<Condition<D>, SceneError> {
        let components = at.components([&self.x, &self.y, &self.z])?;
        let region = match &self.inside {
            Some(shape) => at.inside(shape)?,
            None => Region::everywhere(),
        };
        let within = (0..at.mesh.cell_count())
            .map(|i| at.mesh.centroid(i))
            .filter(|x| region.contains(x, 0.0));
        at.finite(&components, within)?;
        let load = Load {
            on: Domain::Cells(region),
            density: typed,
        };
        Ok(at.prescribes(Prescribed::Load(load), components))
    }

    fn stages(&self) -> Option<&[Text]> {
        self.stages.as_deref()
    }
}
