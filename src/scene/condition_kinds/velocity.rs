//! Prescribed velocities.

use schemars::JsonSchema;
use serde::Deserialize;

use super::{ConditionKind, displacement::held};
use crate::scene::components::Components;
use crate::scene::condition_at::ConditionAt;
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::error::SceneError;
use crate::scene::expression::Expression;
use crate::scene::solve::Pacing;
use crate::scene::spec::ShapeSpec;
use crate::scene::value::Text;

/// Prescribed velocity: exactly one of `on` and `inside`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct VelocitySpec {
    /// A named set of the mesh. Where peridynamics meets the set, points within three quarters of their spacing of it follow it: the first layer.
    pub on: Option<Text>,
    /// All sites inside a shape.
    pub inside: Option<ShapeSpec>,
    /// Velocity along x.
    pub x: Option<Expression>,
    /// Velocity along y.
    pub y: Option<Expression>,
    /// Velocity along z.
    pub z: Option<Expression>,
}

impl ConditionKind for VelocitySpec {
    fn build<const D: usize>(&self, at: &ConditionAt<'_, D>) -> Result<Condition<D>, SceneError> {
        let components = at.components([&self.x, &self.y, &self.z])?;
        moves(at, &components)?;
        let support = held(at, (self.on.as_ref(), self.inside.as_ref()), &components)?;
        Ok(at.prescribes(Prescribed::Velocity(support), components))
    }
}

/// Checks that a velocity is one that a run can follow.
fn moves<const D: usize>(
    at: &ConditionAt<'_, D>,
    components: &Components<D>,
) -> Result<(), SceneError> {
    let place = at.place;
    if at.clock.pacing != Pacing::Moving {
        return Err(
            SceneError::conflict(format!("`{place}` in a scene that does not move"))
                .label(at.name.span.clone(), "a velocity")
                .help("add [solve.explicit] with duration = ..., or prescribe a displacement"),
        );
    }
    match components
        .0
        .iter()
        .flatten()
        .find(|e| e.depends_on_time() && e.depends_on_position())
    {
        None => Ok(()),
        Some(e) => Err(SceneError::conflict(format!("`{place}` depends on time and on position"))
            .label(e.span.clone(), "has no displacement in closed form")
            .help("prescribe the displacement, its integral over t; or let the velocity depend on one of the two")),
    }
}
