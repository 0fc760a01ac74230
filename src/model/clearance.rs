//! Sizes of sites, and how far their points lie below the surface.

use rustc_hash::FxHashSet;

use crate::mesh::facet_corners;
use crate::model::{Bins, Model, PointSource, SiteKind};
use crate::shape::{Shape, distance_to_segment};
use crate::tensor::Vector;

/// The size of every site \[m\]: the edge of a point's whole cell, or the shortest edge of the cells around a node, half of it where they have nodes in the middle.
pub(crate) fn sizes<const D: usize>(model: &Model<D>) -> Vec<f64> {
    let whole = whole_cells(model);
    let of_site = |site: usize| match model.point_of(site) {
        Some((body, p)) => {
            let of_lattice = whole.get(body.cloud.horizon.lattice_of(p));
            let volume = of_lattice.unwrap_or(&body.cloud.volume[p]);
            volume.powf(1.0 / D as f64)
        }
        None => shortest_edge(model, site),
    };
    (0..model.sites.len()).map(of_site).collect()
}

/// The largest volume of a point of each lattice, where points lie on some: surfaces cut the cells of some.
fn whole_cells<const D: usize>(model: &Model<D>) -> Vec<f64> {
    let mut whole = Vec::new();
    let is_lattice = (model.peridynamics.as_ref()).is_some_and(|p| p.points != PointSource::Cells);
    if let (Some(body), true) = (model.body(), is_lattice) {
        for (p, volume) in body.cloud.volume.iter().enumerate() {
            let lattice = body.cloud.horizon.lattice_of(p);
            whole.resize(whole.len().max(lattice + 1), 0.0);
            whole[lattice] = volume.max(whole[lattice]);
        }
    }
    whole
}

fn shortest_edge<const D: usize>(model: &Model<D>, site: usize) -> f64 {
    let mesh = &model.mesh;
    let mut shortest = f64::INFINITY;
    for (cell, _) in model.cells_of_site(site) {
        let corners = mesh.corners(cell);
        let part = match mesh.shapes[cell].is_quadratic() {
            true => 0.5,
            false => 1.0,
        };
        for (k, &a) in corners.iter().enumerate() {
            for &b in &corners[k + 1..] {
                let edge = (mesh.nodes[a as usize] - mesh.nodes[b as usize]).norm();
                if edge > 0.0 {
                    shortest = shortest.min(part * edge);
                }
            }
        }
    }
    shortest
}

/// Nearer to the surface than this part of its size, a point is one of the first layer.
const FIRST_LAYER: f64 = 1.0 - 1e-6;

/// Returns the distance by which the body extends beyond every site \[m\]: zero at a node, and negative at one of the rim of a zone that lies outside of the body. A point of the first layer reaches to the surface of the mesh, any other half of its size.
pub(crate) fn clearances<const D: usize>(model: &Model<D>, sizes: &[f64]) -> Vec<f64> {
    let mesh = &model.mesh;
    let mut of_cut: FxHashSet<u32> = FxHashSet::default();
    for &c in mesh.embedded.pieces.keys() {
        of_cut.extend(mesh.cell(c as usize));
    }
    let is_asked = |site: &usize| match model.sites[*site].kind {
        SiteKind::Node(n) => of_cut.contains(&n),
        _ => model.point_of(*site).is_some(),
    };
    let asked: Vec<usize> = (0..model.sites.len()).filter(is_asked).collect();
    let mut clearance = vec![0.0; model.sites.len()];
    if asked.is_empty() {
        return clearance;
    }
    let positions: Vec<Vector<D>> = asked.iter().map(|&s| model.sites[s].position).collect();
    let largest = asked.iter().map(|&s| sizes[s]).fold(0.0, f64::max);
    // the nearest facet, and whether the place lies beyond it
    let mut nearest = vec![(f64::INFINITY, false); asked.len()];
    let bins = Bins::new(&positions, largest);
    for facet in mesh.outer_facets() {
        let corners: Vec<Vector<D>> = facet_corners::<D>(&facet.nodes)
            .iter()
            .map(|&n| mesh.nodes[n as usize])
            .collect();
        let middle = corners.iter().sum::<Vector<D>>() / corners.len() as f64;
        let radius = corners.iter().map(|x| (x - middle).norm());
        let radius = radius.fold(0.0, f64::max) + largest;
        let normal = mesh.facet_normal_area(&facet);
        for k in bins.around(&middle, radius) {
            let d = distance(&corners, &positions[k]);
            if d < nearest[k].0 {
                nearest[k] = (d, (positions[k] - middle).dot(&normal) > 0.0);
            }
        }
    }
    for (&site, (d, is_beyond)) in asked.iter().zip(nearest) {
        clearance[site] = match model.point_of(site) {
            Some(_) if d < FIRST_LAYER * sizes[site] => d,
            Some(_) => 0.5 * sizes[site],
            None if is_beyond => -d,
            None => 0.0,
        };
    }
    clearance
}

/// The distance of a place from a facet, triangle by triangle.
fn distance<const D: usize>(corners: &[Vector<D>], x: &Vector<D>) -> f64 {
    match corners {
        [a] => (x - a).norm(),
        [a, b] => distance_to_segment(x, a, b),
        [a, rest @ ..] => rest
            .windows(2)
            .map(|w| Shape::Polygon(vec![*a, w[0], w[1]]).signed_distance(x))
            .fold(f64::INFINITY, f64::min),
        [] => f64::INFINITY,
    }
}
