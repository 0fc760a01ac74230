//! The model of each cell: local, transition or nonlocal.

use super::bounds_checks;
use super::default_horizon::horizon_of;
use super::error::SceneError;
use super::places::extent;
use super::region::{self, Region};
use super::source::Span;
use super::spec::{
    CouplingSpec, FormSpec, SceneSpec, ShapeSpec, SkinSpec, TransitionSpec, ZonesNeeded,
};
use crate::mesh::Mesh;
use crate::scene::selected_coupling::SelectedCoupling;
use crate::tensor::{Vector, padded};
use crate::{model::Zone, parallel};

/// The nonlocal zone that a scene needs.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    /// One entry per cell.
    pub nonlocal: Vec<bool>,
    /// Span at which the scene asks for it.
    pub span: Span,
    /// True if a patch lays the skin, and not the cells of the mesh.
    pub is_for_patch: bool,
}

/// The region of the nonlocal zone: placed, or drawn in the scene.
fn nonlocal_region<const D: usize>(
    spec: &SceneSpec,
    selected: &SelectedCoupling,
    mesh: &Mesh<D>,
    placed: Option<&Placed>,
) -> Result<(Region<D>, Span), SceneError> {
    Ok(match (placed, &spec.zones.nonlocal) {
        (Some(p), _) => {
            let cells = (0..mesh.cell_count() as u32).filter(|&c| p.nonlocal[c as usize]);
            (Region::Cells(cells.collect()), p.span.clone())
        }
        (None, Some(n)) => {
            let region = region::region("zones.nonlocal", n.get_ref(), mesh)?;
            (region, n.span())
        }
        // a partial stress lets the horizon vary throughout a body without a zone of whole families
        (None, None) if is_stress_alone(spec, selected) => {
            let span = spec.zones.transition.as_ref().map(|t| t.span());
            (Region::Cells(Vec::new()), span.unwrap_or(0..0))
        }
        (None, None) => {
            return Err(SceneError::missing(format!("coupling `{}` needs a nonlocal zone", selected.traits.name))
                .label(selected.span.clone(), "couples a local and a nonlocal zone")
                .help(
                    "add [zones.nonlocal] with a shape, for example box = { min = [...], max = [...] }, or zones = \"auto\"",
                ));
        }
    })
}

/// Returns true if elements carry a partial stress in a transition zone that is drawn by itself.
fn is_stress_alone(spec: &SceneSpec, selected: &SelectedCoupling) -> bool {
    let CouplingSpec::PartialStress(method) = &selected.coupling else {
        return false;
    };
    let transition = spec.zones.transition.as_ref().map(|t| t.get_ref());
    let is_drawn = transition.is_some_and(|t| !matches!(t, TransitionSpec::Around(_)));
    spec.zones.nonlocal.is_none() && is_drawn && method.form == FormSpec::Elements
}

/// The nonlocal zone as it is drawn or placed.
struct NonlocalZone<const D: usize> {
    region: Region<D>,
    /// One entry per cell.
    inner: Vec<bool>,
    /// Span at which the scene asks for it.
    span: Span,
}

/// Marks the cells of the transition zone: those that the scene draws, or around a zone that was placed as many as the coupling asks for.
fn mark_transition<const D: usize>(
    spec: &SceneSpec,
    selected: &SelectedCoupling,
    mesh: &Mesh<D>,
    placed: Option<&Placed>,
    nonlocal: &NonlocalZone<D>,
    zones: &mut [Zone],
) -> Result<(), SceneError> {
    let (traits, count) = (selected.traits, mesh.cell_count());
    let needs_transition = matches!(traits.zones, ZonesNeeded::Transition { .. });
    let NonlocalZone {
        region,
        inner,
        span: drawn,
    } = nonlocal;
    if let Some(transition) = &spec.zones.transition {
        let span = transition.span();
        let selected = transition_cells(transition.get_ref(), region, inner, mesh)?;
        let both: Vec<usize> = (0..count).filter(|&c| selected[c] && inner[c]).collect();
        let all = inner.iter().filter(|n| **n).count();
        if !both.is_empty() && both.len() != all {
            let at = mesh.centroid(both[0]);
            return Err(SceneError::conflict(format!(
                "`zones.transition` overlaps {} of the {all} cells of `zones.nonlocal`, the first at {:?}",
                both.len(),
                at.as_slice()
            ))
            .label(span, "overlaps in part")
            .label(drawn.clone(), "this zone")
            .help("let it enclose the nonlocal zone, or keep the two apart; around = 0.1 does the former"));
        }
        let mut any = false;
        // what is left of a cut cell lies beyond a rim that holds the whole transition zone, wherever its centroid lies
        let is_cut = |c: usize| mesh.embedded.cut_cell(c).is_some();
        for c in (0..count).filter(|&c| selected[c] && !inner[c] && !is_cut(c)) {
            zones[c] = Zone::Transition;
            any = true;
        }
        if !any && needs_transition {
            return Err(empty("zones.transition", span, mesh));
        }
    } else if let (Some(_), ZonesNeeded::Transition { width, .. }) = (placed, traits.zones) {
        // the width that the method asks for, and half a cell, so that cells make it up
        let horizon = (spec.peridynamics.as_ref()).map(|p| horizon_of(p, mesh, zones).0);
        let reach = |x: &Vector<D>| horizon.as_ref().map_or(0.0, |h| h.eval(&padded(x)));
        let largest = (0..count)
            .map(|c| reach(&mesh.centroid(c)))
            .fold(0.0, f64::max);
        let size = mesh.cell_volume(0).abs().powf(1.0 / D as f64);
        for (zone, close) in
            zones
                .iter_mut()
                .zip(around(region, inner, mesh, width * largest + 0.5 * size))
        {
            if close {
                *zone = Zone::Transition;
            }
        }
    } else if needs_transition {
        return Err(SceneError::missing(format!(
            "coupling `{}` needs a transition zone",
            traits.name
        ))
        .label(selected.span.clone(), "works where both models overlap")
        .help("add [zones.transition] with around = ..., at least one horizon"));
    }
    Ok(())
}

/// The model of each cell; `placed` is the nonlocal zone of a scene that does not draw it.
pub(crate) fn zones<const D: usize>(
    spec: &SceneSpec,
    selected: &SelectedCoupling,
    mesh: &Mesh<D>,
    placed: Option<&Placed>,
) -> Result<Vec<Zone>, SceneError> {
    let traits = selected.traits;
    let count = mesh.cell_count();
    if let ZonesNeeded::Everywhere(zone) = traits.zones {
        return Ok(vec![zone; count]);
    }
    let (region, span) = nonlocal_region(spec, selected, mesh, placed)?;
    let inner = region.select(mesh);
    if !inner.contains(&true) && !is_stress_alone(spec, selected) {
        return Err(empty("zones.nonlocal", span, mesh));
    }
    let mut zones: Vec<Zone> = inner
        .iter()
        .map(|n| if *n { Zone::Nonlocal } else { Zone::Local })
        .collect();
    let is_of_patch = placed.is_some_and(|p| p.is_for_patch);
    if spec.zones.skin == Some(SkinSpec::FreeSurfaces) && !is_of_patch {
        for (zone, outer) in zones.iter_mut().zip(mesh.cells_at_boundary()) {
            if outer {
                *zone = Zone::Local;
            }
        }
        if !zones.contains(&Zone::Nonlocal) {
            return Err(
                SceneError::empty("`zones.skin` takes every cell of `zones.nonlocal`")
                    .label(span.clone(), "is nowhere thicker than two cells")
                    .help("refine the mesh, enlarge the zone or leave the skin out"),
            );
        }
    }
    let nonlocal = NonlocalZone {
        region,
        inner,
        span: span.clone(),
    };
    mark_transition(spec, selected, mesh, placed, &nonlocal, &mut zones)?;
    // partial stress needs no elements: it lets the horizon vary throughout a body
    let needs_elements = !matches!(selected.coupling, CouplingSpec::PartialStress(_));
    if needs_elements && !zones.contains(&Zone::Local) {
        return Err(SceneError::conflict(
            "the nonlocal and transition zones hold every cell: nothing is local",
        )
        .label(span, "reaches everywhere")
        .help("make the zones smaller, or use coupling = \"nonlocal\""));
    }
    Ok(zones)
}

fn empty<const D: usize>(place: &str, span: Span, mesh: &Mesh<D>) -> SceneError {
    SceneError::empty(format!(
        "`{place}` is empty: no cell has its centroid inside"
    ))
    .label(span, "selects no cell")
    .help(format!(
        "move or enlarge it, or refine the mesh there; {}",
        extent(mesh)
    ))
}

fn transition_cells<const D: usize>(
    spec: &TransitionSpec,
    nonlocal: &Region<D>,
    inner: &[bool],
    mesh: &Mesh<D>,
) -> Result<Vec<bool>, SceneError> {
    let place = "zones.transition";
    let shape = match spec.clone() {
        TransitionSpec::Around(width) => {
            let width = bounds_checks::positive("zones.transition.around", &width)?;
            return Ok(around(nonlocal, inner, mesh, width));
        }
        TransitionSpec::Box(s) => ShapeSpec::Box(s),
        TransitionSpec::Ball(s) => ShapeSpec::Ball(s),
        TransitionSpec::Point(s) => ShapeSpec::Point(s),
        TransitionSpec::Segment(s) => ShapeSpec::Segment(s),
        TransitionSpec::Polyline(s) => ShapeSpec::Polyline(s),
        TransitionSpec::Polygon(s) => ShapeSpec::Polygon(s),
        TransitionSpec::Everywhere(s) => ShapeSpec::Everywhere(s),
        TransitionSpec::Near(s) => ShapeSpec::Near(s),
        TransitionSpec::Set(s) => ShapeSpec::Set(s),
        TransitionSpec::Any(s) => ShapeSpec::Any(s),
        TransitionSpec::Without(s) => ShapeSpec::Without(s),
    };
    Ok(region::region(place, &shape, mesh)?.select(mesh))
}

/// The cells outside `inner` within `width` of it.
fn around<const D: usize>(
    nonlocal: &Region<D>,
    inner: &[bool],
    mesh: &Mesh<D>,
    width: f64,
) -> Vec<bool> {
    let facets = match nonlocal.distance(&mesh.centroid(0)) {
        Some(_) => Vec::new(),
        // a set has no shape: measure from the facets of its boundary
        None => mesh.boundary_facets((0..mesh.cell_count() as u32).filter(|&c| inner[c as usize])),
    };
    parallel::map(mesh.cell_count(), 1, |c| {
        let x = mesh.centroid(c);
        if inner[c] {
            return false;
        }
        match nonlocal.distance(&x) {
            Some(d) => d <= width,
            None => facets
                .iter()
                .any(|f| mesh.distance_to_facet(&x, &f.nodes) <= width),
        }
    })
}
