//! Voids and cracks of a scene.

use super::error::SceneError;
use super::places::extent;
use super::region;
use super::spec::{SceneSpec, ShapeSpec, VoidSpec};
use super::value::Text;
use crate::fem::Locator;
use crate::mesh::Mesh;
use crate::model::Zone;
use crate::shape::{Barrier, Shape};
use crate::tensor::Vector;

/// Empty regions, and what cuts bonds.
type Obstacles<const D: usize> = (Vec<Shape<D>>, Vec<Barrier<D>>);

/// The shape of a void, which has a volume and lies in nonlocal cells.
fn void_shape<const D: usize>(
    name: &Text,
    v: &VoidSpec,
    mesh: &Mesh<D>,
    zones: &[Zone],
) -> Result<Shape<D>, SceneError> {
    let place = format!("voids.{name}.inside");
    let shape = region::shape(&place, &v.inside, mesh, &name.span)?;
    if !matches!(
        shape,
        Shape::Box { .. } | Shape::Ball { .. } | Shape::Polygon(_)
    ) {
        return Err(SceneError::wrong_value(format!("`{place}` has no volume"))
            .label(name.span.clone(), "nothing lies inside")
            .help("use `box`, `ball` or, in 2D, `polygon`; a surface is a crack: [cracks.NAME]"));
    }
    let inside = |c: &usize| shape.signed_distance(&mesh.centroid(*c)) < 0.0;
    if let Some(c) = (0..mesh.cell_count())
        .filter(|&c| zones[c] != Zone::Nonlocal)
        .find(inside)
    {
        return Err(SceneError::conflict(format!(
            "`{place}` covers cell {c} at {:?}, which is not nonlocal",
            mesh.centroid(c).as_slice()
        ))
        .label(name.span.clone(), "finite elements cannot be emptied")
        .help("enlarge [zones.nonlocal] around the void, or leave it out of the mesh (cutouts)"));
    }
    Ok(shape)
}

/// Voids, and the barriers that they and cracks are.
pub(crate) fn obstacles<const D: usize>(
    spec: &SceneSpec,
    mesh: &Mesh<D>,
    zones: &[Zone],
) -> Result<Obstacles<D>, SceneError> {
    let (mut voids, mut barriers) = (Vec::new(), Vec::new());
    for (name, v) in &spec.voids {
        let shape = void_shape(name, v, mesh, zones)?;
        if v.cut_bonds {
            barriers.push(Barrier::Void(shape.clone()));
        }
        voids.push(shape);
    }
    let locator = Locator::new(mesh, 0..mesh.cell_count());
    for (name, c) in &spec.cracks {
        let place = format!("cracks.{name}");
        let shape = region::shape(&place, c, mesh, &name.span)?;
        let thin = matches!(
            (&shape, c, D),
            (Shape::Segment { .. }, ShapeSpec::Point(_), 1)
                | (Shape::Segment { .. }, ShapeSpec::Segment(_), 2)
                | (Shape::Polyline(_), _, 2)
                | (Shape::Polygon(_), _, 3)
        );
        if !thin {
            return Err(SceneError::wrong_value(format!("`{place}` is no surface in a scene of dimension {D}"))
                .label(name.span.clone(), "cuts nothing")
                .help([
                    "give a point: point = 0.5",
                    "give a segment = { from, to } or a polyline; what has an area is a void: [voids.NAME]",
                    "give a plane polygon = [[x, y, z], ...]; what has a volume is a void: [voids.NAME]",
            ][D - 1]));
        }
        let samples = samples(&shape);
        let tolerance = 1e-9 * (mesh.bounds().1 - mesh.bounds().0).norm();
        let cells: Vec<(Vector<D>, usize)> = samples
            .iter()
            .filter_map(|x| locator.locate(mesh, x, tolerance).map(|l| (*x, l.cell)))
            .collect();
        if cells.is_empty() {
            return Err(
                SceneError::empty(format!("`{place}` lies outside the mesh"))
                    .label(name.span.clone(), "cuts nothing")
                    .help(extent(mesh)),
            );
        }
        if let Some((x, _)) = cells.iter().find(|(_, cell)| zones[*cell] == Zone::Local) {
            return Err(SceneError::conflict(format!("`{place}` passes through the local zone at {:?}", x.as_slice()))
                .label(name.span.clone(), "finite elements cannot be cut")
                .help("enlarge [zones.nonlocal], for example near = { segment = ..., within = 3 horizons }"));
        }
        barriers.push(Barrier::Crack(shape));
    }
    Ok((voids, barriers))
}

/// Points on a thin shape, dense enough to meet every zone it passes through.
fn samples<const D: usize>(shape: &Shape<D>) -> Vec<Vector<D>> {
    const PER_EDGE: usize = 64;
    let edge = |a: &Vector<D>, b: &Vector<D>| -> Vec<Vector<D>> {
        (0..=PER_EDGE)
            .map(|i| a.lerp(b, i as f64 / PER_EDGE as f64))
            .collect()
    };
    match shape {
        Shape::Segment { a, b } => edge(a, b),
        Shape::Polyline(points) => points.windows(2).flat_map(|w| edge(&w[0], &w[1])).collect(),
        Shape::Polygon(points) => {
            let centre = points.iter().sum::<Vector<D>>() / points.len().max(1) as f64;
            let closed = points.iter().zip(points.iter().cycle().skip(1));
            closed
                .flat_map(|(a, b)| edge(a, b))
                .flat_map(|x| [x, x.lerp(&centre, 0.5)])
                .chain([centre])
                .collect()
        }
        _ => Vec::new(),
    }
}
