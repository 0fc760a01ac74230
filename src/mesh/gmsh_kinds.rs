//! Gmsh's numbers for kinds of elements.

use super::CellShape;

/// Our shape for Gmsh's number, or its name and a remedy.
pub(super) fn shape(kind: i64) -> Result<CellShape, (&'static str, &'static str)> {
    const ORDER: &str =
        "only first-order elements are read: set Mesh.ElementOrder = 1 and mesh again";
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
        8 => return Err(("second-order line", ORDER)),
        9 => return Err(("second-order triangle", ORDER)),
        10 | 16 => return Err(("second-order quadrilateral", ORDER)),
        11 => return Err(("second-order tetrahedron", ORDER)),
        12 | 17 => return Err(("second-order hexahedron", ORDER)),
        13 | 18 => return Err(("second-order prism", ORDER)),
        14 | 19 => return Err(("second-order pyramid", ORDER)),
        20..=31 | 36..=66 | 71..=93 => return Err(("element of a higher order", ORDER)),
        _ => return Err(("unknown", KIND)),
    })
}
