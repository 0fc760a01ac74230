//! Bonds that a scene shows as lines: those of the points in a shape, or of the point nearest to a probe.

use std::collections::BTreeMap;

use toml::Spanned;

use super::error::{SceneError, closest, quoted};
use super::file_name::part_of_a_file_name;
use super::places::inside;
use super::region::Region;
use super::spec::{BondLinesSpec, SceneSpec, ShapeSpec, ZonesNeeded};
use super::value::Text;
use crate::mesh::Mesh;
use crate::model::Zone;
use crate::tensor::Vector;

/// Bonds that a file shows.
#[derive(Clone, Debug, PartialEq)]
pub struct BondSelection<const D: usize> {
    /// Its name.
    pub name: String,
    /// Points whose bonds they are.
    pub of: BondOwners<D>,
}

/// Points whose bonds a file shows.
#[derive(Clone, Debug, PartialEq)]
pub enum BondOwners<const D: usize> {
    /// Those in a region.
    Inside(Region<D>),
    /// The nearest one to a position, if that lies within its horizon.
    Nearest(Vector<D>),
}

impl<const D: usize> BondSelection<D> {
    /// The beginning of the names of its files, in a scene whose files begin with `scene`.
    pub fn stem(&self, scene: &str) -> String {
        format!("{scene}_bonds_{}", self.name)
    }
}

/// The bonds that a scene shows, with its probes by name and position.
///
/// # Errors
/// [`SceneError`] for a scene without bonds, without VTU files or with a zone that moves, for an unknown probe, and for a shape beside the body.
pub(super) fn selections<const D: usize>(
    spec: &SceneSpec,
    probes: &[(String, Vector<D>)],
    mesh: &Mesh<D>,
) -> Result<Vec<BondSelection<D>>, SceneError> {
    let typed: &BTreeMap<Text, BondLinesSpec> = &spec.output.bonds;
    let Some(first) = typed.keys().next() else {
        return Ok(Vec::new());
    };
    let refuse = |why: &str, help: &str| {
        Err(
            SceneError::conflict(format!("`output.bonds.{first}` in {why}"))
                .label(first.span.clone(), "not there")
                .help(help),
        )
    };
    let coupling = spec.coupling.as_ref().map(Spanned::get_ref);
    let is_local = match coupling {
        Some(coupling) => coupling.traits().zones == ZonesNeeded::Everywhere(Zone::Local),
        None => spec.peridynamics.is_none() && spec.accuracy.is_none(),
    };
    if is_local {
        let help = "leave `output.bonds` out, or couple to peridynamics: coupling = \"splice\"";
        return refuse("a local scene, whose elements have no bonds", help);
    }
    if spec.output.vtu == Some(false) {
        let help = "leave out `output.vtu = false`: files of bonds lie beside those of the body";
        return refuse("a scene without VTU files", help);
    }
    if spec.zones.follow.is_some() {
        let help = "leave out `output.bonds` or `zones.follow`";
        return refuse("a scene whose zone follows the crack", help);
    }
    let one = |(name, of): (&Text, &BondLinesSpec)| {
        let place = format!("output.bonds.{name}");
        part_of_a_file_name(&place, name)?;
        let of = match of {
            BondLinesSpec::Inside(shape) => match &**shape {
                ShapeSpec::Set(set) => {
                    return Err(SceneError::conflict(format!(
                        "`{place}.inside` is the set `{set}`"
                    ))
                    .label(set.span.clone(), "no shape")
                    .help("give a shape such as `box`"));
                }
                shape => BondOwners::Inside(inside(&place, name, shape, mesh)?),
            },
            BondLinesSpec::Probe(probe) => BondOwners::Nearest(position(&place, probe, probes)?),
        };
        Ok(BondSelection {
            name: name.value.clone(),
            of,
        })
    };
    typed.iter().map(one).collect()
}

/// The position of a probe of the scene.
fn position<const D: usize>(
    place: &str,
    wanted: &Text,
    probes: &[(String, Vector<D>)],
) -> Result<Vector<D>, SceneError> {
    if let Some((_, at)) = probes.iter().find(|(name, _)| *name == wanted.value) {
        return Ok(*at);
    }
    let known: Vec<&str> = probes.iter().map(|(name, _)| name.as_str()).collect();
    let help = match (closest(&wanted.value, known.iter().copied()), &known[..]) {
        (Some(name), _) => format!("did you mean `{name}`?"),
        (None, []) => format!("add `output.probes.{wanted}.at`"),
        (None, known) => format!("known here: {}", quoted(known)),
    };
    Err(SceneError::choice(format!(
        "`{place}.probe`: the scene has no probe `{wanted}`"
    ))
    .label(wanted.span.clone(), "no probe")
    .help(help))
}
