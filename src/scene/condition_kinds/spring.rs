//! Springs to the ground.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::mesh::Mesh;
use crate::scene::bounds_checks;
use crate::scene::components::Components;
use crate::scene::conditions::{Bedding, Condition, Prescribed};
use crate::scene::error::{SceneError, SceneErrorKind};
use crate::scene::places::{facet_set, inside, outer_facets};
use crate::scene::solve::Clock;
use crate::scene::spec::ShapeSpec;
use crate::scene::value::{Number, Text};
use crate::tensor::Vector;

const AXES: [&str; 3] = ["x", "y", "z"];

/// Springs to the ground: exactly one of `on` and `inside`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct SpringSpec {
    /// A named set of facets of the mesh; stiffnesses are forces per area and displacement.
    #[serde(default)]
    pub on: Option<Text>,
    /// The cells of the mesh with their centroid in a shape; stiffnesses are forces per volume and displacement.
    #[serde(default)]
    pub inside: Option<ShapeSpec>,
    /// Stiffness along x.
    #[serde(default)]
    pub x: Option<Number>,
    /// Stiffness along y.
    #[serde(default)]
    pub y: Option<Number>,
    /// Stiffness along z.
    #[serde(default)]
    pub z: Option<Number>,
    /// Stiffness along the normal of the set, instead of components.
    #[serde(default)]
    pub normal: Option<Number>,
}

impl ConditionKind for SpringSpec {
    fn build<const D: usize>(
        &self,
        place: &str,
        name: &Text,
        mesh: &Mesh<D>,
        _clock: Clock,
    ) -> Result<Condition<D>, SceneError> {
        let given = [&self.x, &self.y, &self.z];
        let choice = |what: &str, help: &str| {
            Err(
                SceneError::new(SceneErrorKind::Choice, format!("`{place}` has {what}"))
                    .label(name.span.clone(), "springs")
                    .help(help),
            )
        };
        let mut stiffness = Vector::<D>::zeros();
        for (k, number) in given.iter().enumerate() {
            let Some(number) = number else { continue };
            let at = format!("{place}.{}", AXES[k]);
            let value = bounds_checks::positive(&at, number)?;
            if k >= D {
                return Err(SceneError::new(
                    SceneErrorKind::Dimension,
                    format!("`{at}` in a scene of dimension {D}"),
                )
                .label(number.span.clone(), "no such axis")
                .help(format!("remove `{}`", AXES[k])));
            }
            stiffness[k] = value;
        }
        let has_components = given.iter().any(|g| g.is_some());
        let bedding = match (&self.on, &self.inside, &self.normal) {
            (None, None, _) | (Some(_), Some(_), _) => {
                return choice(
                    match self.on {
                        Some(_) => "both `on` and `inside`",
                        None => "neither `on` nor `inside`",
                    },
                    "keep one: `on = \"set\"` of the mesh, or `inside = { box = ... }`",
                );
            }
            (_, _, Some(_)) if has_components => {
                return choice("`normal` and components", "keep one of the two");
            }
            (None, Some(_), Some(_)) => {
                return choice(
                    "`inside` and `normal`",
                    "cells have no normal: give components, or name a set of facets by `on`",
                );
            }
            (_, _, None) if !has_components => {
                return choice("no stiffness", "add x = ..., or normal = ...");
            }
            (Some(on), None, Some(normal)) => Bedding::Normal {
                facets: outer_facets(place, on, mesh)?,
                stiffness: bounds_checks::positive(&format!("{place}.normal"), normal)?,
            },
            (Some(on), None, None) => Bedding::Axes {
                facets: facet_set(place, on, mesh)?.to_vec(),
                stiffness,
            },
            (None, Some(shape), None) => Bedding::Inside {
                region: inside(place, name, shape, mesh)?,
                stiffness,
            },
        };
        Ok(Condition {
            name: name.value.clone(),
            prescribed: Prescribed::Spring(bedding),
            components: Components(std::array::from_fn(|_| None)),
        })
    }
}
