//! Gmsh's numbers for kinds of elements.

use super::CellShape;
use super::raw::{OtherShape, RawShape};

/// Our shape for Gmsh's number, or its name and a remedy.
pub(super) fn shape(kind: i64) -> Result<RawShape, (&'static str, &'static str)> {
    const ORDER: &str =
        "elements of first and second order are read: set Mesh.ElementOrder = 2 and mesh again";
    const INNER: &str = "elements with nodes inside of faces are not read: set Mesh.SecondOrderIncomplete = 1 and mesh again";
    const KIND: &str = "supported are points, lines, triangles, quadrilaterals, tetrahedra, hexahedra, prisms and pyramids: mesh without it";
    if let Some(shape) = CellShape::of_gmsh(kind) {
        return Ok(RawShape::Cell(shape));
    }
    Err(match kind {
        6 => return Ok(RawShape::Other(OtherShape::Prism)),
        7 => return Ok(RawShape::Other(OtherShape::Pyramid)),
        10 => ("second-order quadrilateral of nine nodes", INNER),
        12 => ("second-order hexahedron of 27 nodes", INNER),
        13 | 18 => ("second-order prism", ORDER),
        14 | 19 => ("second-order pyramid", ORDER),
        20..=31 | 36..=66 | 71..=93 => ("element of a higher order", ORDER),
        _ => ("unknown", KIND),
    })
}

/// Puts the nodes of an element in Gmsh's order into ours, which is VTK's.
///
/// Source: the reference manual of Gmsh, "Node ordering"; they differ for tetrahedra and hexahedra of second order.
pub(super) fn reorder(shape: RawShape, nodes: &mut [u64]) {
    let RawShape::Cell(shape) = shape else {
        return;
    };
    let order = shape.gmsh_order();
    let mut sides = [0; 12];
    for (side, &at) in sides.iter_mut().zip(order) {
        *side = nodes[at];
    }
    let corners = nodes.len() - order.len();
    nodes[corners..].copy_from_slice(&sides[..order.len()]);
}
