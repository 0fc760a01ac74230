//! Sections through the body: a plane, and the part of the body beyond it.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::conditions::Condition;
use super::error::SceneError;
use super::places::{extent, inside};
use super::region::{Region, position};
use super::spec::SectionSpec;
use super::value::Text;
use crate::mesh::Mesh;
use crate::model::tributary::HalfSpace;
use crate::tensor::Vector;

/// A section through the body.
#[derive(Clone, Debug, PartialEq)]
pub struct Section<const D: usize> {
    /// Its name.
    pub name: String,
    /// Half-space beyond the plane.
    pub beyond: HalfSpace<D>,
    /// The part of it whose force is reported.
    pub inside: Region<D>,
    /// The point about which the moment is taken \[m\].
    pub about: Vector<D>,
    /// The body with its loads before a patch was embedded in it, where there is one: what acts beyond the plane is the same, and no cell is cut.
    pub(crate) uncut: Option<Arc<UncutBody<D>>>,
}

/// A body before a patch was embedded in it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct UncutBody<const D: usize> {
    pub mesh: Mesh<D>,
    /// The conditions of the scene, in the same order.
    pub conditions: Vec<Condition<D>>,
}

impl<const D: usize> Section<D> {
    /// Returns true if a position lies in the part whose force is reported.
    pub fn holds(&self, x: &Vector<D>) -> bool {
        self.beyond.holds(x) && self.inside.contains(x, self.beyond.tolerance)
    }
}

/// The sections of a scene.
pub(super) fn sections<const D: usize>(
    spec: &BTreeMap<Text, SectionSpec>,
    mesh: &Mesh<D>,
) -> Result<Vec<Section<D>>, SceneError> {
    spec.iter()
        .map(|(name, typed)| section(name, typed, mesh))
        .collect()
}

fn section<const D: usize>(
    name: &Text,
    spec: &SectionSpec,
    mesh: &Mesh<D>,
) -> Result<Section<D>, SceneError> {
    let place = format!("output.sections.{name}");
    let point = position::<D>(&format!("{place}.point"), &spec.point)?;
    let normal = position::<D>(&format!("{place}.normal"), &spec.normal)?;
    let normal = normal.try_normalize(1e-300);
    let Some(normal) = normal.filter(|n| n.iter().all(|n| n.is_finite())) else {
        return Err(
            SceneError::wrong_value(format!("`{place}.normal` has no direction"))
                .label(spec.normal.span.clone(), "zero")
                .help(format!(
                    "write a direction such as {}",
                    ["[1]", "[1, 0]", "[1, 0, 0]"][D - 1]
                )),
        );
    };
    let (low, high) = mesh.bounds();
    let section = Section {
        name: name.value.clone(),
        beyond: HalfSpace {
            point,
            normal,
            tolerance: 1e-9 * (high - low).norm(),
        },
        inside: match &spec.inside {
            Some(shape) => inside(&place, name, shape, mesh)?,
            None => Region::everywhere(),
        },
        about: match &spec.about {
            Some(about) => position(&format!("{place}.about"), about)?,
            None => point,
        },
        uncut: None,
    };
    let beyond = mesh.nodes.iter().filter(|x| section.holds(x)).count();
    if beyond > 0 && beyond < mesh.nodes.len() {
        return Ok(section);
    }
    let (what, remedy) = match beyond {
        0 => (
            "has nothing of the body beyond it",
            "move its point, or turn its normal to the part whose force is to be told",
        ),
        _ => (
            "has all of the body beyond it",
            "move its point into the body",
        ),
    };
    Err(SceneError::empty(format!("`{place}` {what}"))
        .label(spec.point.span.clone(), "cuts nothing")
        .help(format!("{remedy}; {}", extent(mesh))))
}
