//! Planes of symmetry.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::scene::components::Components;
use crate::scene::condition_at::ConditionAt;
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::error::SceneError;
use crate::scene::expression::Expression;
use crate::scene::value::Text;

/// A plane of symmetry along the axes.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct SymmetrySpec {
    /// A named set of the mesh, all of whose nodes lie in one plane x, y or z = constant.
    pub on: Text,
}

impl ConditionKind for SymmetrySpec {
    fn build<const D: usize>(&self, at: &ConditionAt<'_, D>) -> Result<Condition<D>, SceneError> {
        let (place, mesh) = (at.place, at.mesh);
        let support = at.support(Some(&self.on), None)?;
        let nodes = mesh.nodes_of_set(&self.on.value).unwrap_or_default();
        let (low, high) = mesh.bounds();
        let tolerance = 1e-9 * (high - low).norm();
        let (from, to) = mesh.bounds_of(&nodes);
        let flat: Vec<usize> = (0..D).filter(|&k| to[k] - from[k] <= tolerance).collect();
        let refuse = |why: String, help: &str| {
            Err(SceneError::conflict(format!("`{place}.on`: {why}"))
                .label(self.on.span.clone(), "whose normal?")
                .help(help))
        };
        match flat[..] {
            [axis] => {
                let zero = Expression::constant(0.0).at(self.on.span.clone());
                let components = Components::only(axis, zero);
                Ok(at.prescribes(Prescribed::Displacement(support), components))
            }
            [] => refuse(
                format!(
                    "the set `{}` reaches from {:?} to {:?}: it is no plane x, y or z = constant",
                    self.on,
                    from.as_slice(),
                    to.as_slice()
                ),
                "turn the mesh so that its planes of symmetry lie along the axes, or hold the set by stiff [conditions.NAME.spring] with normal = ...",
            ),
            _ => refuse(
                format!(
                    "the set `{}` at {:?} has no area: its normal is not known",
                    self.on,
                    from.as_slice()
                ),
                "name the set of all facets of the plane, or prescribe a displacement by its components",
            ),
        }
    }
}
