//! Initial fields of a validated scene.

use std::collections::BTreeMap;

use super::components::{Components, components};
use super::condition_at::ConditionAt;
use super::error::SceneError;
use super::places::inside;
use super::region::Region;
use super::solve::{Clock, Pacing, still};
use super::spec::{InitialFieldSpec, InitialSpec, ShapeSpec};
use super::value::Text;
use crate::mesh::Mesh;

/// Field that is given at time zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitialKind {
    /// Displacement.
    Displacement,
    /// Velocity.
    Velocity,
}

/// A field at time zero; where two meet, the later name in the alphabet holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Initial<const D: usize> {
    /// Its name.
    pub name: String,
    /// The field.
    pub kind: InitialKind,
    /// Region of the field.
    pub region: Region<D>,
    /// Its components; those left out stay as they are.
    pub components: Components<D>,
}

/// All initial fields.
pub(crate) fn initial<const D: usize>(
    spec: &BTreeMap<Text, InitialSpec>,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Vec<Initial<D>>, SceneError> {
    let mut found = Vec::with_capacity(spec.len());
    for (name, initial) in spec {
        let (kind, word, field) = match initial {
            InitialSpec::Displacement(f) => (InitialKind::Displacement, "displacement", f),
            InitialSpec::Velocity(f) => (InitialKind::Velocity, "velocity", f),
        };
        let place = format!("initial.{name}.{word}");
        if clock.pacing != Pacing::Moving {
            return Err(
                SceneError::conflict(format!("`{place}` in a scene that does not move"))
                    .label(name.span.clone(), "there is no time zero")
                    .help("add [solve.explicit] with duration = ..., or remove it"),
            );
        }
        let InitialFieldSpec {
            inside: shape,
            x,
            y,
            z,
        } = field;
        let components = components::<D>(&place, name, [x, y, z])?;
        for (axis, e) in ["x", "y", "z"].iter().zip(&components.0) {
            if let Some(e) = e {
                still(&format!("{place}.{axis}"), e)?;
            }
        }
        let region = match shape {
            Some(shape @ ShapeSpec::Set(_)) => {
                super::region::region(&format!("{place}.inside"), shape, mesh)?
            }
            Some(shape) => inside(&place, name, shape, mesh)?,
            None => Region::everywhere(),
        };
        let selected = region.select_nodes(mesh);
        let within = mesh.nodes.iter().zip(selected);
        let within = within.filter_map(|(x, selected)| selected.then_some(*x));
        let at = ConditionAt {
            place: &place,
            name,
            mesh,
            clock,
        };
        at.finite(&components, within)?;
        found.push(Initial {
            name: name.value.clone(),
            kind,
            region,
            components,
        });
    }
    Ok(found)
}
