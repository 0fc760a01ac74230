//! Whether parts of a scene that are right alone agree: materials with zones, horizons with spacings.

use super::error::{SceneError, SceneErrorKind};
use super::materials::Material;
use super::peridynamics::Peridynamics;
use super::source::Span;
use super::spec::{CouplingSpec, SceneSpec, ZonesNeeded};
use crate::coupling::Zone;
use crate::mesh::Mesh;
use crate::observe::report::number;
use crate::scene::points::Points;

/// The core gives all points one law.
pub(crate) fn one_peridynamic_material<const D: usize>(
    spec: &SceneSpec,
    found: &[Material<D>],
    cell_material: &[u16],
    zones: &[Zone],
) -> Result<(), SceneError> {
    let mut used = cell_material
        .iter()
        .zip(zones)
        .filter(|(_, zone)| **zone != Zone::Local)
        .map(|(m, _)| *m);
    let Some(first) = used.next() else {
        return Ok(());
    };
    let Some(other) = used.find(|m| *m != first) else {
        return Ok(());
    };
    let (a, b) = (&found[first as usize].name, &found[other as usize].name);
    let span = |name: &str| -> Span {
        spec.materials
            .get_key_value(name)
            .map_or(0..0, |(k, _)| k.span.clone())
    };
    Err(SceneError::new(
        SceneErrorKind::Later,
        format!("the materials `{a}` and `{b}` both reach into the peridynamic zones"),
    )
    .label(span(a), "one")
    .label(span(b), "another")
    .help("keep the nonlocal and transition zones within one material; bonds between materials come later"))
}

/// Refuses a law that is not linear where rows at the seam would not balance it: those of splice, blending, balanced and partial stress hold a uniform strain whatever stress the two sides have.
pub(crate) fn balanced_seam<const D: usize>(
    spec: &SceneSpec,
    coupling: &CouplingSpec,
    material: &Material<D>,
) -> Result<(), SceneError> {
    let joining = coupling.joining();
    let balances = matches!(coupling, CouplingSpec::Truncated(_))
        || matches!(joining.zones, ZonesNeeded::Everywhere(_));
    if balances || material.law.is_linear() {
        return Ok(());
    }
    let name = spec.materials.get_key_value(material.name.as_str());
    Err(SceneError::new(
        SceneErrorKind::Conflict,
        format!(
            "the law of the material `{}`, {}, is not linear, finite elements are linear, and coupling `{}` does not balance the stresses of the two",
            material.name,
            material.law.name(),
            joining.name
        ),
    )
    .label(name.map_or(0..0, |(k, _)| k.span.clone()), "of this material")
    .help("use coupling = \"truncated\", whose seam is in equilibrium at any stretch, or \"nonlocal\""))
}

/// Refuses finite elements of a law whose classical stress is not linear: they would stay elastic where the points yield.
pub(crate) fn elastic_elements<const D: usize>(
    spec: &SceneSpec,
    materials: &[Material<D>],
    cell_material: &[u16],
    zones: &[Zone],
) -> Result<(), SceneError> {
    let bends = |m: &Material<D>| !m.law.is_linear() && !m.law.linearised().is_ordinary();
    let cells = zones.iter().zip(cell_material);
    let local = cells.filter(|(zone, _)| **zone == Zone::Local);
    let mut of_local = local.map(|(_, &m)| &materials[m as usize]);
    let Some(material) = of_local.find(|m| bends(m)) else {
        return Ok(());
    };
    let name = spec.materials.get_key_value(material.name.as_str());
    Err(SceneError::new(
        SceneErrorKind::Conflict,
        format!(
            "finite elements of the material `{}` would stay elastic, and its law, {}, is not",
            material.name,
            material.law.name()
        ),
    )
    .label(
        name.map_or(0..0, |(k, _)| k.span.clone()),
        "of this material",
    )
    .help("use coupling = \"nonlocal\", or give these cells an elastic material of their own"))
}

/// Refuses a horizon below the spacing of the points.
pub(crate) fn horizon<const D: usize>(
    spec: &SceneSpec,
    p: &Peridynamics<D>,
    mesh: &Mesh<D>,
    zones: &[Zone],
) -> Result<(), SceneError> {
    for c in (0..mesh.cell_count()).filter(|&c| zones[c] != Zone::Local) {
        let x = mesh.centroid(c);
        let delta = p.horizon_at(&x);
        let spacing = match &p.points {
            Points::Lattice { spacing, .. } => *spacing,
            // checked body by body
            Points::Lattices { .. } => continue,
            Points::Cells if zones[c] == Zone::Nonlocal => {
                mesh.cell_volume(c).abs().powf(1.0 / D as f64)
            }
            Points::Cells => 0.0,
        };
        if delta.is_finite() && delta > 0.0 && delta >= spacing * (1.0 - 1e-9) {
            continue;
        }
        return Err(SceneError::new(
            SceneErrorKind::WrongValue,
            if delta.is_finite() && delta > 0.0 {
                format!(
                    "`peridynamics.horizon` is {delta} at {:?}, below the spacing {spacing} of the points there",
                    x.as_slice()
                )
            } else {
                format!("`peridynamics.horizon` is {delta} at {:?}", x.as_slice())
            },
        )
        .label(
            spec.peridynamics.as_ref().map_or(0..0, |p| p.horizon.span.clone()),
            "no point would have a neighbour",
        )
        .help(if delta.is_finite() && delta > 0.0 {
            let third = number(delta / 3.0);
            let points = match &p.points {
                Points::Cells => format!("refine the mesh there, or use points.lattice = {{ spacing = {third} }}, a third of the horizon"),
                _ => format!("use a spacing of {third}, a third of the horizon, or less"),
            };
            format!("{points}; or a horizon of {} to {}, three to six spacings", number(3.0 * spacing), number(6.0 * spacing))
        } else {
            "give a horizon above zero everywhere, three to six spacings".to_owned()
        }));
    }
    Ok(())
}
