//! Parts of the nonlocal zone with a horizon and a lattice of their own, and the layers of elements between them.

use super::bounds_checks;
use super::error::SceneError;
use super::peridynamics::Peridynamics;
use super::places::extent;
use super::region;
use super::spec::{BodySpec, CouplingTraits, LatticeStart, SceneSpec};
use super::value::Text;
use crate::mesh::Mesh;
use crate::model::{HorizonChange, Lattice, PointSource, Zone};

/// The cells, the spacing and the horizon of a body.
fn body_region<const D: usize>(
    place: &str,
    body: &BodySpec,
    mesh: &Mesh<D>,
) -> Result<(Vec<bool>, f64, f64), SceneError> {
    let inside = region::region(&format!("{place}.inside"), &body.inside, mesh)?.select(mesh);
    let spacing = bounds_checks::positive(&format!("{place}.spacing"), &body.spacing)?;
    let horizon = bounds_checks::positive(&format!("{place}.horizon"), &body.horizon)?;
    if horizon < spacing * (1.0 - 1e-9) {
        return Err(SceneError::wrong_value(format!(
            "`{place}.horizon` is {horizon}, below the spacing {spacing} of its points"
        ))
        .label(body.horizon.span.clone(), "no point would have a neighbour")
        .help("make it two to six times the spacing"));
    }
    Ok((inside, spacing, horizon))
}

/// Refuses bodies, or a rest of the zone, of which the layers of elements between them leave nothing.
fn refuse_empty_zones<const D: usize>(
    spec: &SceneSpec,
    first: &Text,
    mesh: &Mesh<D>,
    zones: &[Zone],
    of_cell: &[u16],
) -> Result<(), SceneError> {
    for (l, name) in std::iter::once("the rest of `zones.nonlocal`")
        .chain(spec.zones.bodies.keys().map(|k| k.value.as_str()))
        .enumerate()
    {
        let holds = |c: usize| zones[c] == Zone::Nonlocal && usize::from(of_cell[c]) == l;
        if !(0..mesh.cell_count()).any(holds) {
            return Err(SceneError::empty(format!(
                "the layers of elements between bodies take every cell of {name}"
            ))
            .label(
                first.span.clone(),
                "bodies are kept apart by a layer one cell thick",
            )
            .help("refine the mesh, or move the bodies"));
        }
    }
    Ok(())
}

/// Gives the bodies of `zones.bodies` their lattices, and makes elements of the cells that touch a body from the rest of the zone.
pub(crate) fn bodies<const D: usize>(
    spec: &SceneSpec,
    traits: CouplingTraits,
    p: Peridynamics<D>,
    mesh: &Mesh<D>,
    zones: &mut [Zone],
) -> Result<Peridynamics<D>, SceneError> {
    let Some(first) = spec.zones.bodies.keys().next() else {
        return Ok(p);
    };
    let splices = p.horizon_change == HorizonChange::Splice;
    if traits.lattice != LatticeStart::Halfway && !splices {
        return Err(SceneError::conflict(format!(
            "`zones.bodies` is for the couplings `truncated`, `splice` and `nonlocal`; this is `{}`",
            traits.name
        ))
        .label(first.span.clone(), "has a horizon of its own")
        .help("use one of these, or a horizon in x, y, z"));
    }
    let (PointSource::Lattice { spacing, origin }, Some(horizon)) =
        (&p.points, p.horizon.as_constant())
    else {
        return Err(SceneError::conflict(
            "`zones.bodies` needs a lattice and one horizon in the rest of the nonlocal zone too",
        )
        .label(first.span.clone(), "is a body of its own")
        .help("give peridynamics.points.lattice a spacing and peridynamics.horizon a number"));
    };
    let mut lattices = vec![Lattice {
        spacing: *spacing,
        origin: *origin,
        horizon,
    }];
    // bodies that are spliced start at the same part of their spacing as the rest does
    let corner = mesh.bounds().0;
    let part = ((origin - corner) / *spacing).map(|k| k - k.floor());
    let mut of_cell = vec![0u16; mesh.cell_count()];
    for (name, body) in &spec.zones.bodies {
        let place = format!("zones.bodies.{name}");
        let (inside, spacing, horizon) = body_region(&place, body, mesh)?;
        let mut any = false;
        for c in (0..mesh.cell_count()).filter(|&c| inside[c] && zones[c] == Zone::Nonlocal) {
            of_cell[c] = lattices.len() as u16;
            any = true;
        }
        if !any {
            return Err(SceneError::empty(format!(
                "`{place}` is empty: no cell of the nonlocal zone has its centroid inside"
            ))
            .label(name.span.clone(), "selects no cell")
            .help(format!("move or enlarge it; {}", extent(mesh))));
        }
        lattices.push(Lattice {
            spacing,
            origin: match traits.lattice {
                LatticeStart::Halfway => mesh.bounds().0.add_scalar(0.5 * spacing),
                LatticeStart::OnCorner => corner + part * spacing,
            },
            horizon,
        });
    }
    if !splices {
        add_layers(mesh, zones, &of_cell);
    }
    refuse_empty_zones(spec, first, mesh, zones, &of_cell)?;
    Ok(Peridynamics {
        points: PointSource::Lattices { lattices, of_cell },
        ..p
    })
}

/// Makes elements of nonlocal cells that share a node with a body named later.
fn add_layers<const D: usize>(mesh: &Mesh<D>, zones: &mut [Zone], of_cell: &[u16]) {
    let mut latest = vec![0u16; mesh.nodes.len()];
    let nonlocal: Vec<usize> = (0..mesh.cell_count())
        .filter(|&c| zones[c] == Zone::Nonlocal)
        .collect();
    for &c in &nonlocal {
        for &n in mesh.cell(c) {
            latest[n as usize] = latest[n as usize].max(of_cell[c]);
        }
    }
    for c in nonlocal {
        let touches = |&n: &u32| latest[n as usize] > of_cell[c];
        if mesh.cell(c).iter().any(touches) {
            zones[c] = Zone::Local;
        }
    }
}
