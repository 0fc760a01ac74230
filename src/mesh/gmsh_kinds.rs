//! Gmsh's numbers for kinds of elements.

use super::raw::{OtherShape, RawShape};
use super::{CellShape, Order};

/// Our shape for Gmsh's number and the number of nodes after those that it has, which are left out; or the name of the element and a remedy.
///
/// Elements with nodes inside of faces, and prisms and pyramids of second order, are read by their corners alone, where cells are to be linear.
pub(super) fn shape(
    kind: i64,
    order: Order,
) -> Result<(RawShape, usize), (&'static str, &'static str)> {
    const ORDER: &str =
        "elements of first and second order are read: set Mesh.ElementOrder = 2 and mesh again";
    const INNER: &str = "elements with nodes inside of faces are not read: set Mesh.SecondOrderIncomplete = 1 and mesh again, or read corners alone by mesh.file.order = \"linear\"";
    const LINEAR: &str = "elements of first and second order are read, but of these corners alone: set mesh.file.order = \"linear\"";
    const KIND: &str = "supported are points, lines, triangles, quadrilaterals, tetrahedra, hexahedra, prisms and pyramids: mesh without it";
    if let Some(shape) = CellShape::of_gmsh(kind) {
        return Ok((RawShape::Cell(shape), 0));
    }
    let of_corners = match kind {
        6 => return Ok((RawShape::Other(OtherShape::Prism), 0)),
        7 => return Ok((RawShape::Other(OtherShape::Pyramid), 0)),
        10 => Some((RawShape::Cell(CellShape::Quad4), 5)),
        12 => Some((RawShape::Cell(CellShape::Hex8), 19)),
        13 => Some((RawShape::Other(OtherShape::Prism), 12)),
        18 => Some((RawShape::Other(OtherShape::Prism), 9)),
        14 => Some((RawShape::Other(OtherShape::Pyramid), 9)),
        19 => Some((RawShape::Other(OtherShape::Pyramid), 8)),
        _ => None,
    };
    if let Some(found) = of_corners.filter(|_| order == Order::Linear) {
        return Ok(found);
    }
    Err(match kind {
        10 => ("second-order quadrilateral of nine nodes", INNER),
        12 => ("second-order hexahedron of 27 nodes", INNER),
        13 | 18 => ("second-order prism", LINEAR),
        14 | 19 => ("second-order pyramid", LINEAR),
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
