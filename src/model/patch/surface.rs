//! Facets at the surface of the body that a patch covers, divided among its cells.
//!
//! The patch has faces of its own where a facet lies in a plane between lattice cells. Elsewhere the parts of the facet are the surface of the cells that they cross.

use std::collections::BTreeMap;

use super::{
    cells::{Face, Index, PatchCells},
    cuts::Cuts,
    moments::PartMoments,
};
use crate::{
    mesh::{IN_PLANE, Mesh, boundary::BoundaryFacet, facet_corners},
    model::simplex::{Simplex, around_middle, facet_simplices},
    tensor::Vector,
};

/// Distance into the body, in edges of a cell, at which facets in planes between cells are divided among these.
const INWARDS: f64 = 1e-3;

/// Size of a part, over that of a face of a cell, below which it has no normal.
const SLIVER: f64 = 1e-13;

/// Part of a facet below which it is nothing.
const NOTHING: f64 = 1e-9;

/// A facet of which the patch covers a part.
pub(super) struct MetFacet<const D: usize> {
    /// Its cell.
    pub cell: u32,
    /// Faces of the patch on it, with the size that they have in common.
    pub faces: Vec<(Face<D>, f64)>,
    /// The rest of it: one part, or as many as it has simplices where its cell is divided.
    pub left: Vec<PartMoments<D>>,
    /// True if nothing is left of it.
    pub is_gone: bool,
}

/// The surface of a patch.
pub(super) struct PatchSurface<const D: usize> {
    /// The facets of which it covers a part, by their sorted corners.
    pub met: BTreeMap<Vec<u32>, MetFacet<D>>,
    /// Faces of cells at the surface of the body, with the part of each that is surface.
    pub faces: BTreeMap<Face<D>, PartMoments<D>>,
    /// Parts of other facets, each with its cell and the outward normal, by the corners of the facet.
    pub parts: Vec<(Vec<u32>, Index<D>, Simplex<D>, Vector<D>)>,
}

impl<const D: usize> PatchSurface<D> {
    pub fn new(mesh: &Mesh<D>, patch: &PatchCells<D>, cuts: &Cuts) -> Self {
        let mut surface = Self {
            met: BTreeMap::new(),
            faces: BTreeMap::new(),
            parts: Vec::new(),
        };
        for facet in mesh.outer_facets() {
            if cuts.is_met(facet.cell) {
                surface.divide(mesh, patch, &facet);
            }
        }
        surface
    }

    fn divide(&mut self, mesh: &Mesh<D>, patch: &PatchCells<D>, facet: &BoundaryFacet) {
        let normal = mesh.facet_normal_area(facet).normalize();
        let edge = patch.cells.spacing;
        let axis = (0..D).max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()));
        let axis = axis.unwrap_or(0);
        let in_plane = |&n: &u32| {
            let at = (mesh.nodes[n as usize] - patch.node(&[0; D]))[axis] / edge;
            (at - at.round()).abs() < IN_PLANE
        };
        let is_face = facet.nodes.iter().all(in_plane) && normal[axis].abs() > 1.0 - 1e-9;
        let inwards = match is_face {
            true => normal * (-INWARDS * edge),
            false => Vector::zeros(),
        };
        let is_divided = mesh.embedded.is_divided(facet.cell as usize);
        let simplices = match (is_divided, facet_corners::<D>(&facet.nodes)) {
            (true, corners @ [_, _, _, _]) => {
                let x = corners.iter().map(|&n| mesh.nodes[n as usize]);
                around_middle(&x.collect::<Vec<_>>())
            }
            (_, corners) => facet_simplices(mesh, corners),
        };
        let about = mesh.nodes[facet.nodes[0] as usize];
        let mut left =
            vec![PartMoments::about(about); if is_divided { simplices.len() } else { 1 }];
        let mut faces: BTreeMap<Face<D>, PartMoments<D>> = BTreeMap::new();
        let mut corners = facet_corners::<D>(&facet.nodes).to_vec();
        corners.sort_unstable();
        let (mut whole, mut is_met) = (0.0, false);
        for (k, simplex) in simplices.iter().enumerate() {
            let left = &mut left[if is_divided { k } else { 0 }];
            patch.cells.dice(
                &simplex.shifted(&inwards),
                &|_, _| true,
                &mut |index, part| {
                    let part = part.shifted(&-inwards);
                    if part.size() <= SLIVER * edge.powi(D as i32 - 1) {
                        return;
                    }
                    whole += part.size();
                    if !patch.all.contains(&index) {
                        left.add(&part);
                        return;
                    }
                    is_met = true;
                    if !is_face {
                        self.parts.push((corners.clone(), index, part, normal));
                        return;
                    }
                    let face = Face {
                        cell: index,
                        axis,
                        is_upper: normal[axis] > 0.0,
                    };
                    let about = || PartMoments::about(patch.cells.centre(&index));
                    faces.entry(face).or_insert_with(about).add(&part);
                },
            );
        }
        if !is_met {
            return;
        }
        faces.retain(|_, part| part.size > NOTHING * whole);
        for (face, part) in &faces {
            let about = || PartMoments::about(patch.cells.centre(&face.cell));
            self.faces.entry(*face).or_insert_with(about).join(part);
        }
        left.retain(|part| part.size > 0.0);
        let found = MetFacet {
            cell: facet.cell,
            faces: (faces.into_iter())
                .map(|(face, part)| (face, part.size))
                .collect(),
            is_gone: left.iter().map(|part| part.size).sum::<f64>() <= NOTHING * whole,
            left,
        };
        self.met.insert(corners, found);
    }
}
