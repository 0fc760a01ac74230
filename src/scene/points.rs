//! Positions of the points of a scene.

use crate::model::Lattice;
use crate::tensor::Vector;

/// Positions of the peridynamic points.
#[derive(Clone, Debug, PartialEq)]
pub enum Points<const D: usize> {
    /// At the centroids of cells.
    Cells,
    /// On a lattice of this spacing through this point.
    Lattice {
        /// Distance of neighbours.
        spacing: f64,
        /// Any point of the lattice.
        origin: Vector<D>,
    },
    /// On several lattices, each with its horizon.
    Lattices {
        /// The lattices; the first one is that of the scene's `[peridynamics]`.
        lattices: Vec<Lattice<D>>,
        /// The lattice of each cell.
        of_cell: Vec<u16>,
    },
}
