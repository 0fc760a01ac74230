//! Meshes of separate boxes, one around each of some places.

use super::{CellShape, Mesh};
use crate::tensor::Vector;

/// Corners of a box in the order of its cell, in halves of its edge.
const CORNERS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// The cell of a segment, square or cube around a place \[m\], of half an edge \[m\], and its corners.
pub(crate) fn around<const D: usize>(
    centre: &Vector<D>,
    half: f64,
) -> (CellShape, impl Iterator<Item = Vector<D>>) {
    let shape = [CellShape::Line2, CellShape::Quad4, CellShape::Hex8][D - 1];
    let corners = CORNERS[..1 << D].iter();
    let corners = corners.map(move |s| Vector::from_fn(|a, _| centre[a] + half * s[a]));
    (shape, corners)
}

impl<const D: usize> Mesh<D> {
    /// The mesh whose cell `k` is a segment, square or cube around `centres[k]`, of the size `volumes[k]`; cells share no nodes.
    ///
    /// Shapes: one entry per cell in both. Units: \[m\], [m^D]; volumes are above zero.
    pub(crate) fn of_boxes(centres: &[Vector<D>], volumes: &[f64]) -> Self {
        let mut mesh = Self::default();
        for (centre, volume) in centres.iter().zip(volumes) {
            let (shape, corners) = around(centre, 0.5 * volume.powf(1.0 / D as f64));
            let first = mesh.nodes.len() as u32;
            mesh.nodes.extend(corners);
            let nodes: Vec<u32> = (first..mesh.nodes.len() as u32).collect();
            mesh.push_cell(shape, &nodes);
        }
        mesh
    }
}
