//! A mesh in memory, with its named sets.

use std::sync::Arc;

use bondline::mesh::{CellShape, MeshParts};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

type Blocks<'py> = Vec<(String, PyReadonlyArray2<'py, u64>)>;
type Sets<'py> = Vec<(String, PyReadonlyArray1<'py, u64>)>;

/// A mesh in memory.
#[pyclass(frozen, module = "bondline._bondline")]
pub struct Mesh {
    /// The mesh as a scene takes it.
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
    CellShape::all()
        .find(|shape| shape.meshio_name() == name)
        .ok_or_else(|| PyValueError::new_err(format!("no cells of the type {name}")))
}
