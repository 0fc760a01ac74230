//! A mesh in memory, with its named sets.

use std::sync::Arc;

use bondline::mesh::{CellShape, MeshParts};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Name in meshio, name in a `Mesh`, and number in VTK of each shape.
pub const SHAPES: [(CellShape, &str, u8); 11] = [
    (CellShape::Line2, "line", 3),
    (CellShape::Tri3, "triangle", 5),
    (CellShape::Quad4, "quad", 9),
    (CellShape::Tet4, "tetra", 10),
    (CellShape::Hex8, "hexahedron", 12),
    (CellShape::Line3, "line3", 21),
    (CellShape::Tri6, "triangle6", 22),
    (CellShape::Quad8, "quad8", 23),
    (CellShape::Tet10, "tetra10", 24),
    (CellShape::Hex20, "hexahedron20", 25),
    // a file has them last, too
    (CellShape::Vertex, "vertex", 1),
];

type Blocks<'py> = Vec<(String, PyReadonlyArray2<'py, u64>)>;
type Sets<'py> = Vec<(String, PyReadonlyArray1<'py, u64>)>;

/// A mesh in memory.
#[pyclass(frozen, module = "bondline._bondline")]
pub struct Mesh {
    /// What a scene takes.
    pub parts: Arc<MeshParts>,
}

#[pymethods]
impl Mesh {
    /// From positions `(n, 3)`, blocks of elements by their names in meshio, and sets by numbers of elements and points.
    #[new]
    fn new(
        name: String,
        points: PyReadonlyArray2<'_, f64>,
        blocks: Blocks<'_>,
        element_sets: Sets<'_>,
        point_sets: Sets<'_>,
    ) -> PyResult<Self> {
        if points.as_array().ncols() != 3 {
            return Err(PyValueError::new_err("points are of shape (n, 3)"));
        }
        let points = points.as_array();
        let points = points.rows().into_iter();
        let blocks: PyResult<Vec<(CellShape, Vec<u64>)>> = blocks
            .iter()
            .map(|(name, nodes)| Ok((shape(name)?, nodes.as_array().iter().copied().collect())))
            .collect();
        let sets = |sets: &Sets<'_>| -> Vec<(String, Vec<u64>)> {
            let sets = sets.iter();
            sets.map(|(name, set)| (name.clone(), set.as_array().iter().copied().collect()))
                .collect()
        };
        Ok(Self {
            parts: Arc::new(MeshParts {
                name,
                points: points.map(|x| [x[0], x[1], x[2]]).collect(),
                blocks: blocks?,
                element_sets: sets(&element_sets),
                point_sets: sets(&point_sets),
            }),
        })
    }
}

fn shape(name: &str) -> PyResult<CellShape> {
    let found = SHAPES.iter().find(|(_, known, _)| *known == name);
    found
        .map(|(shape, _, _)| *shape)
        .ok_or_else(|| PyValueError::new_err(format!("no cells of the type {name}")))
}
