//! The cells that a file shows around peridynamic points, so that viewers slice and shade them.
//!
//! A point of a lattice has the whole cell of the lattice around it: a segment, a square or a cube with edges of the spacing, also where the body's surface, a void or a seam passes
//! through it. A point at the centroid of a cell of the mesh has the corners of that cell. Cells do not share corners: each shows the values of its own point, and a crack opens between
//! them.

use rustc_hash::FxHashMap;

use crate::mesh::{CellShape, boxes};
use crate::model::{CellRole, Model, PointSource};
use crate::tensor::{Vector, padded};

/// Source of the cells of a model's points.
pub(super) struct PointCells<'a, const D: usize> {
    model: &'a Model<D>,
    /// The cell of the mesh by its centroid, where points lie at centroids.
    cell_at: Option<FxHashMap<[u64; D], u32>>,
}

/// Returns the key by which a position is found.
fn key<const D: usize>(x: &Vector<D>) -> [u64; D] {
    std::array::from_fn(|i| x[i].to_bits())
}

impl<'a, const D: usize> PointCells<'a, D> {
    pub fn of(model: &'a Model<D>) -> Self {
        let points = model.peridynamics.as_ref().map(|p| &p.points);
        let cell_at = matches!(points, Some(PointSource::Cells)).then(|| {
            let cells =
                (0..model.mesh.cell_count()).filter(|&c| model.roles[c] == CellRole::Points);
            cells
                .map(|c| (key(&model.mesh.centroid(c)), c as u32))
                .collect()
        });
        Self { model, cell_at }
    }

    /// The edge of the cell of a point \[m\]: the spacing of its lattice, or the root of its volume.
    pub fn size(&self, point: usize) -> f64 {
        match (&self.cell_at, self.model.body()) {
            (Some(_), Some(body)) => body.cloud.volume[point].powf(1.0 / D as f64),
            _ => self.model.spacing_at(point as u32),
        }
    }

    /// Shape and corners of the cell of a point at `x`.
    pub fn cell(&self, point: usize, x: &Vector<D>) -> (CellShape, Vec<[f64; 3]>) {
        let mesh = &self.model.mesh;
        let cell = self.cell_at.as_ref().and_then(|known| known.get(&key(x)));
        if let Some(&c) = cell {
            let corners = mesh.corners(c as usize).iter();
            let corners = corners.map(|&n| padded(&mesh.nodes[n as usize])).collect();
            return (mesh.shapes[c as usize].linear(), corners);
        }
        let (shape, corners) = boxes::around(x, 0.5 * self.size(point));
        (shape, corners.map(|corner| padded(&corner)).collect())
    }
}
