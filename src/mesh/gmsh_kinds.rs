//! Gmsh's numbers for kinds of elements.

use super::CellShape;

/// Our shape for Gmsh's number, or its name and a remedy.
pub(super) fn shape(kind: i64) -> Result<CellShape, (&'static str, &'static str)> {
    const ORDER: &str =
        "elements of first and second order are read: set Mesh.ElementOrder = 2 and mesh again";
    const INNER: &str = "elements with nodes inside of faces are not read: set Mesh.SecondOrderIncomplete = 1 and mesh again";
    const KIND: &str = "supported are points, lines, triangles, quadrilaterals, tetrahedra and hexahedra: mesh without it";
    Ok(match kind {
        1 => CellShape::Line2,
        2 => CellShape::Tri3,
        3 => CellShape::Quad4,
        4 => CellShape::Tet4,
        5 => CellShape::Hex8,
        15 => CellShape::Vertex,
        6 => return Err(("prism", KIND)),
        7 => return Err(("pyramid", KIND)),
        8 => CellShape::Line3,
        9 => CellShape::Tri6,
        11 => CellShape::Tet10,
        16 => CellShape::Quad8,
        17 => CellShape::Hex20,
        10 => return Err(("second-order quadrilateral of nine nodes", INNER)),
        12 => return Err(("second-order hexahedron of 27 nodes", INNER)),
        13 | 18 => return Err(("second-order prism", ORDER)),
        14 | 19 => return Err(("second-order pyramid", ORDER)),
        20..=31 | 36..=66 | 71..=93 => return Err(("element of a higher order", ORDER)),
        _ => return Err(("unknown", KIND)),
    })
}

/// Puts the nodes of an element in Gmsh's order into ours, which is VTK's.
///
/// Source: the reference manual of Gmsh, "Node ordering"; they differ for tetrahedra and hexahedra of second order.
pub(super) fn reorder(shape: CellShape, nodes: &mut [u64]) {
    /// Where Gmsh has the nodes after the corners.
    const TET: [usize; 6] = [4, 5, 6, 7, 9, 8];
    const HEX: [usize; 12] = [8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15];
    let order: &[usize] = match shape {
        CellShape::Tet10 => &TET,
        CellShape::Hex20 => &HEX,
        _ => return,
    };
    let mut sides = [0; 12];
    for (side, &at) in sides.iter_mut().zip(order) {
        *side = nodes[at];
    }
    let corners = nodes.len() - order.len();
    nodes[corners..].copy_from_slice(&sides[..order.len()]);
}
