//! Cells, points and fields of a solution as numpy arrays. Arrays take over the memory in which the library computed them, and cannot be written to.

use bondline::mesh::CellShape;
use bondline::observe::csv::Entry;
use bondline::observe::vtu::{Field, Snapshot, Values};
use bondline::tensor::Vector;
use numpy::ndarray::{Array1, Array2};
use numpy::{Element, IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::attend::Table;
use crate::errors::defect;

/// Numbers of `columns` per entry as an array that cannot be written to: of one dimension for one column, else of two.
fn array<T: Element>(
    py: Python<'_>,
    numbers: Vec<T>,
    columns: usize,
) -> PyResult<Bound<'_, PyAny>> {
    if columns == 1 {
        let array = Array1::from_vec(numbers).into_pyarray(py);
        array.readwrite().make_nonwriteable();
        return Ok(array.into_any());
    }
    let rows = numbers.len() / columns.max(1);
    let array = Array2::from_shape_vec((rows, columns), numbers)
        .map_err(|e| defect(py, &format!("a field has a wrong number of values: {e}")))?
        .into_pyarray(py);
    array.readwrite().make_nonwriteable();
    Ok(array.into_any())
}

fn fields(py: Python<'_>, fields: Vec<Field>) -> PyResult<Bound<'_, PyDict>> {
    let found = PyDict::new(py);
    for field in fields {
        let n = field.components;
        let values = match field.values {
            Values::Real(v) => array(py, v, n),
            Values::Byte(v) => array(py, v, n),
            Values::Integer(v) => array(py, v, n),
            Values::Identifier(v) => array(py, v, n),
        };
        found.set_item(field.name, values?)?;
    }
    Ok(found)
}

/// The columns of a table by name: integers where all entries are, else reals.
pub fn columns(py: Python<'_>, table: Table) -> PyResult<Bound<'_, PyDict>> {
    let found = PyDict::new(py);
    for (k, name) in table.columns.iter().enumerate() {
        let entries = || table.rows.iter().filter_map(|row| row.get(k));
        let whole = |entry: &Entry| match entry {
            Entry::Integer(n) => Some(*n),
            Entry::Real(_) | Entry::Text(_) => None,
        };
        let real = |entry: &Entry| match entry {
            Entry::Integer(n) => *n as f64,
            Entry::Real(x) => *x,
            // no table of a run holds words
            Entry::Text(_) => f64::NAN,
        };
        let integers: Option<Vec<i64>> = entries().map(whole).collect();
        let column = match integers {
            Some(integers) => array(py, integers, 1)?,
            None => array(py, entries().map(real).collect(), 1)?,
        };
        found.set_item(name, column)?;
    }
    Ok(found)
}

/// Time, points, cells by type, VTK's number of the type of each cell, fields over points, fields over cells.
pub fn frame(py: Python<'_>, snapshot: Snapshot) -> PyResult<Bound<'_, PyTuple>> {
    let cells = PyDict::new(py);
    let mut types = vec![0u8; snapshot.shapes.len()];
    // a file has points last, too
    let is_cell = |shape: &CellShape| *shape != CellShape::Vertex;
    let last = [CellShape::Vertex];
    for shape in CellShape::all().filter(is_cell).chain(last) {
        if !snapshot.shapes.contains(&shape) {
            continue;
        }
        let of_shape = types.iter_mut().zip(&snapshot.shapes);
        of_shape
            .filter(|(_, s)| **s == shape)
            .for_each(|(t, _)| *t = shape.vtk_type());
        // VTK and meshio take node numbers as signed
        let mut nodes: Vec<i64> = Vec::new();
        let mut at = 0;
        for of_cell in &snapshot.shapes {
            let end = at + of_cell.node_count();
            if *of_cell == shape {
                nodes.extend(snapshot.connectivity[at..end].iter().map(|&n| i64::from(n)));
            }
            at = end;
        }
        let nodes = match shape {
            CellShape::Vertex => {
                let array = Array2::from_shape_vec((nodes.len(), 1), nodes)
                    .map_err(|e| defect(py, &e.to_string()))?
                    .into_pyarray(py);
                array.readwrite().make_nonwriteable();
                array.into_any()
            }
            _ => array(py, nodes, shape.node_count())?,
        };
        cells.set_item(shape.meshio_name(), nodes)?;
    }
    (
        snapshot.time,
        array(py, snapshot.points.into_flattened(), 3)?,
        cells,
        array(py, types, 1)?,
        fields(py, snapshot.point_fields)?,
        fields(py, snapshot.cell_fields)?,
    )
        .into_pyobject(py)
}

/// A frame of so many vertices with a field `displacement`, and the address at which the library holds that: for a test that nothing is copied.
#[pyfunction]
pub fn frame_of_vertices(py: Python<'_>, count: usize) -> PyResult<(Bound<'_, PyTuple>, usize)> {
    let mut snapshot = Snapshot::default();
    let places: Vec<Vector<1>> = (0..count).map(|i| Vector::<1>::new(i as f64)).collect();
    snapshot.push_vertices(&places);
    snapshot.point_fields = vec![Field::vector("displacement", &places)];
    let address = match &snapshot.point_fields[0].values {
        Values::Real(values) => values.as_ptr() as usize,
        _ => 0,
    };
    Ok((frame(py, snapshot)?, address))
}
