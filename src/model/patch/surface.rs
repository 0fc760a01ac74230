//! Facets at the surface of the body of which a patch covers a part: the patch has faces there, on the same planes.

use std::collections::BTreeMap;

use super::{
    cells::{Face, PatchCells},
    cuts::Cuts,
};
use crate::{
    fem,
    mesh::{Mesh, boundary::BoundaryFacet, facet_corners},
    model::simplex::{Simplex, facet_simplices},
    tensor::{Tensor, Vector},
};

/// Distance into the body, in edges of a cell, at which facets are divided among cells: on the surface itself they lie between two.
const INWARDS: f64 = 1e-3;

/// Part of a facet below which it is nothing.
const NOTHING: f64 = 1e-9;

/// A facet of which the patch covers a part.
pub(super) struct MetFacet<const D: usize> {
    /// Faces of the patch on it, with the size that they have in common.
    pub faces: Vec<(Face<D>, f64)>,
    /// Places and weights that integrate over what is left; empty if nothing is.
    pub left: Vec<(Vector<D>, f64)>,
}

/// The facets at the surface of which the patch covers a part, by their sorted corners.
pub(super) fn met_facets<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    cuts: &Cuts,
) -> BTreeMap<Vec<u32>, MetFacet<D>> {
    let mut met = BTreeMap::new();
    for facet in mesh.outer_facets() {
        if !cuts.is_met(facet.cell) {
            continue;
        }
        let found = divided(mesh, patch, &facet);
        if !found.faces.is_empty() {
            let mut corners = facet_corners::<D>(&facet.nodes).to_vec();
            corners.sort_unstable();
            met.insert(corners, found);
        }
    }
    met
}

fn divided<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    facet: &BoundaryFacet,
) -> MetFacet<D> {
    let normal = mesh.facet_normal_area(facet).normalize();
    let axis = (0..D).max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()));
    let axis = axis.unwrap_or(0);
    let inwards = normal * (-INWARDS * patch.cells.spacing);
    let about = mesh.nodes[facet.nodes[0] as usize];
    let mut faces: BTreeMap<Face<D>, f64> = BTreeMap::new();
    let (mut size, mut first, mut second) = (0.0, Vector::<D>::zeros(), Tensor::<D>::zeros());
    let mut whole = 0.0;
    for simplex in facet_simplices(mesh, &facet.nodes) {
        let moved: Simplex<D> = simplex.shifted(&inwards);
        patch.cells.dice(&moved, &|_, _| true, &mut |index, part| {
            whole += part.size();
            if patch.all.contains(&index) {
                let face = Face {
                    cell: index,
                    axis,
                    is_upper: normal[axis] > 0.0,
                };
                *faces.entry(face).or_insert(0.0) += part.size();
                return;
            }
            part.quadrature(|x, w| {
                let x = x - inwards - about;
                size += w;
                first += x * w;
                second += x * x.transpose() * w;
            });
        });
    }
    faces.retain(|_, size| *size > NOTHING * whole);
    let mut left = Vec::new();
    if size > NOTHING * whole {
        let centroid = first / size;
        let second = second / size - centroid * centroid.transpose();
        let places = fem::places_of_part(about + centroid, &second);
        let weight = size / places.len() as f64;
        left.extend(places.into_iter().map(|x| (x, weight)));
    }
    MetFacet {
        faces: faces.into_iter().collect(),
        left,
    }
}
