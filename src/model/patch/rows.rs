//! Rows of nodes that follow others.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::cells::Index;
use crate::{
    fem,
    mesh::Mesh,
    tensor::{Vector, padded},
};

/// A node, of the mesh or of the patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Place<const D: usize> {
    Mesh(u32),
    Patch(Index<D>),
}

/// Weights of nodes.
pub(super) type Row<const D: usize> = Vec<(Place<D>, f64)>;

/// The row of each node that follows others.
pub(super) type Rows<const D: usize> = BTreeMap<Place<D>, Row<D>>;

/// Weights, over the largest of their row, that rounding leaves.
const ROUNDING: f64 = 1e-15;

/// Adds up the weights of each node.
pub(super) fn gathered<const D: usize>(row: impl IntoIterator<Item = (Place<D>, f64)>) -> Row<D> {
    let mut sums: FxHashMap<Place<D>, f64> = FxHashMap::default();
    for (n, w) in row {
        *sums.entry(n).or_insert(0.0) += w;
    }
    let largest = sums.values().fold(0.0, |most: f64, w| most.max(w.abs()));
    let own = sums.into_iter();
    let mut row: Row<D> = own.filter(|e| e.1.abs() > ROUNDING * largest).collect();
    row.sort_unstable_by_key(|e| e.0);
    row
}

/// The shape functions of a cell at a place, which may lie outside.
pub(super) fn row_of_cell<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    x: &Vector<D>,
) -> Option<Row<D>> {
    let xi = fem::reference_of(mesh, c, x)?;
    let (shape, _) = fem::shape_values(mesh, c, &xi);
    let nodes = mesh.cell(c).iter().map(|&n| Place::Mesh(n));
    Some(nodes.zip(shape).collect())
}

/// As [`row_of_cell`], for masses: of a cell of second order, whose shape functions are negative inside of it too, those of its corners, of which the nodes in the middle of edges take the same from both ends, as far as all are positive.
/// They are exact for affine fields, and near what shape functions of second order make of a uniform force.
pub(super) fn mass_row<const D: usize>(mesh: &Mesh<D>, c: usize, x: &Vector<D>) -> Option<Row<D>> {
    if !mesh.shapes[c].is_quadratic() {
        return row_of_cell(mesh, c, x);
    }
    let xi = fem::reference_of(mesh, c, x)?;
    let linear = fem::reference_cell(mesh.shapes[c].linear())?;
    let values = (linear.values)(&padded(&xi));
    let corners = mesh.corners(c).len();
    let mut weights = values[..corners].to_vec();
    for &[a, b] in mesh.shapes[c].mid_sides() {
        // as many edges meet in a corner as there are axes
        let part = values[a].min(values[b]).max(0.0) / D as f64;
        weights[a] -= part;
        weights[b] -= part;
        weights.push(2.0 * part);
    }
    let nodes = mesh.cell(c).iter().map(|&n| Place::Mesh(n));
    Some(nodes.zip(weights).collect())
}
