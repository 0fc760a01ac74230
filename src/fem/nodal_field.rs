//! A scalar field by its values at the nodes of a mesh, at one instant or several.

use std::sync::Arc;

use super::cell::{PerNode, Rule};
use super::element::for_each_point;
use super::locate::Locator;
use crate::mesh::Mesh;
use crate::tensor::Vector;

/// Distances outside of a cell, relative to its extent, within which the field goes on as in the cell: the closest cell is found first.
const BESIDE: [f64; 5] = [1e-9, 1e-3, 1e-2, 0.1, 0.5];

/// A scalar field by its values at the nodes of a mesh, interpolated in cells and linearly between instants.
///
/// Its gradient is continuous: that of a node is the mean of its cells' by their volumes (exact of affine fields, of second order inside of a regular mesh, of first order at its surface), interpolated between nodes.
#[derive(Debug)]
pub struct NodalField<const D: usize> {
    mesh: Arc<Mesh<D>>,
    locator: Locator<D>,
    /// Instants, ascending; never empty.
    times: Vec<f64>,
    /// Values of all nodes at each.
    values: Vec<Vec<f64>>,
    slopes: Slopes<D>,
}

/// The gradient at each node as a sum over nodes, `∇T_a = Σ_b G_ab T_b` [1/m].
#[derive(Debug)]
struct Slopes<const D: usize> {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    weights: Vec<Vector<D>>,
}

impl<const D: usize> NodalField<D> {
    /// The field of `values` at `times`, ascending.
    ///
    /// Shapes: as many `values` as `times`, one or more, each with a number per node.
    pub fn new(mesh: Arc<Mesh<D>>, times: Vec<f64>, values: Vec<Vec<f64>>) -> Self {
        Self {
            locator: Locator::new(&mesh, 0..mesh.cell_count()),
            slopes: Slopes::of(&mesh),
            mesh,
            times,
            values,
        }
    }

    /// Returns true if there are several instants.
    pub fn varies_in_time(&self) -> bool {
        self.times.len() > 1
    }

    /// The value at `x` and the time `t`. Outside of the mesh it goes on as in the closest cell, before the first and after the last instant it stays.
    pub fn value(&self, x: &Vector<D>, t: f64) -> f64 {
        let at = self.instant(t);
        let (nodes, shape) = self.around(x);
        nodes
            .iter()
            .zip(shape)
            .map(|(&n, w)| w * self.at_node(n, at))
            .sum()
    }

    /// Value and gradient at `x` and the time `t`.
    pub fn value_and_gradient(&self, x: &Vector<D>, t: f64) -> (f64, Vector<D>) {
        let at = self.instant(t);
        let (nodes, shape) = self.around(x);
        let (mut value, mut gradient) = (0.0, Vector::zeros());
        for (&n, w) in nodes.iter().zip(shape).filter(|(_, w)| *w != 0.0) {
            value += w * self.at_node(n, at);
            for (&m, g) in self.slopes.row(n) {
                gradient += g * (w * self.at_node(m, at));
            }
        }
        (value, gradient)
    }

    /// The instant before `t`, the one after, and the part of the way between them.
    fn instant(&self, t: f64) -> (usize, usize, f64) {
        let last = self.times.len() - 1;
        let after = self.times.partition_point(|&s| s <= t).min(last);
        let before = after.saturating_sub(1);
        let length = self.times[after] - self.times[before];
        match length > 0.0 {
            true => (
                before,
                after,
                ((t - self.times[before]) / length).clamp(0.0, 1.0),
            ),
            false => (before, after, 0.0),
        }
    }

    fn at_node(&self, n: u32, (before, after, part): (usize, usize, f64)) -> f64 {
        let [a, b] = [before, after].map(|k| self.values[k][n as usize]);
        a + part * (b - a)
    }

    /// The nodes that a place takes its value from, with their weights.
    fn around(&self, x: &Vector<D>) -> (&[u32], PerNode<f64>) {
        let in_cell = |tolerance: &f64| self.locator.locate(&self.mesh, x, *tolerance);
        if let Some(found) = BESIDE.iter().find_map(in_cell) {
            return (&self.mesh.cell(found.cell)[..found.nodes], found.shape);
        }
        // far outside: the closest node that has a cell
        let distance = |&k: &usize| {
            let n = self.mesh.connectivity[k];
            (self.mesh.nodes[n as usize] - x).norm_squared()
        };
        let closest =
            (0..self.mesh.connectivity.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let mut shape = PerNode::<f64>::default();
        shape[0] = 1.0;
        let nodes = closest.map_or(&[][..], |k| &self.mesh.connectivity[k..=k]);
        (nodes, shape)
    }
}

impl<const D: usize> Slopes<D> {
    fn of(mesh: &Mesh<D>) -> Self {
        // ∫ ∇N_b dV of each cell, by its nodes
        let mut integrals = vec![Vector::zeros(); mesh.connectivity.len()];
        let mut volumes = vec![0.0; mesh.cell_count()];
        for (c, volume) in volumes.iter_mut().enumerate() {
            let start = mesh.offsets[c] as usize;
            for_each_point(mesh, c, Rule::Stiffness, |p| {
                *volume += p.weight;
                for (b, gradient) in p.gradient[..p.nodes].iter().enumerate() {
                    integrals[start + b] += gradient * p.weight;
                }
            });
        }
        let (starts, cells) = mesh.node_cells();
        let mut found = Self {
            offsets: vec![0],
            columns: Vec::new(),
            weights: Vec::new(),
        };
        let mut row: Vec<(u32, Vector<D>)> = Vec::new();
        for around in starts.windows(2) {
            let cells = &cells[around[0] as usize..around[1] as usize];
            let volume: f64 = cells.iter().map(|&c| volumes[c as usize]).sum();
            row.clear();
            for &c in cells {
                let start = mesh.offsets[c as usize] as usize;
                let nodes = mesh.cell(c as usize).iter().zip(&integrals[start..]);
                row.extend(nodes.map(|(&b, integral)| (b, integral / volume)));
            }
            row.sort_by_key(|entry| entry.0);
            for same in row.chunk_by(|a, b| a.0 == b.0) {
                found.columns.push(same[0].0);
                found.weights.push(same.iter().map(|entry| entry.1).sum());
            }
            found.offsets.push(found.columns.len());
        }
        found
    }

    fn row(&self, n: u32) -> impl Iterator<Item = (&u32, &Vector<D>)> {
        let row = self.offsets[n as usize]..self.offsets[n as usize + 1];
        self.columns[row.clone()].iter().zip(&self.weights[row])
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample::boxes;
    use super::*;

    fn affine_fields_are_exact<const D: usize>() {
        let slope = Vector::<D>::from_fn(|i, _| 2.0 - i as f64);
        for mesh in boxes::<D>(3, 0.2) {
            let mesh = Arc::new(mesh);
            let at = |x: &Vector<D>, t: f64| (1.0 + t) * (0.5 + slope.dot(x));
            let values = |t: f64| mesh.nodes.iter().map(|x| at(x, t)).collect();
            let times = vec![0.0, 1.0, 3.0];
            let each = times.iter().map(|&t| values(t)).collect();
            let field = NodalField::new(Arc::clone(&mesh), times, each);
            assert!(field.varies_in_time());
            // inside, on a corner, and beside the mesh
            for x in [0.37, 0.0, 1.02] {
                let x = Vector::repeat(x);
                for (t, same_as) in [
                    (-1.0, 0.0),
                    (0.25, 0.25),
                    (1.0, 1.0),
                    (2.5, 2.5),
                    (9.0, 3.0),
                ] {
                    let (value, gradient) = field.value_and_gradient(&x, t);
                    assert!(
                        (value - at(&x, same_as)).abs() < 1e-11,
                        "{x:?} {t}: {value}"
                    );
                    assert!((gradient - slope * (1.0 + same_as)).amax() < 1e-10);
                    assert!((field.value(&x, t) - value).abs() < 1e-13);
                }
            }
            let far = Vector::repeat(50.0);
            let corner = Vector::repeat(1.0);
            assert!((field.value(&far, 0.0) - at(&corner, 0.0)).abs() < 1e-12);
        }
    }

    #[test]
    fn affine_fields_are_interpolated_exactly() {
        affine_fields_are_exact::<1>();
        affine_fields_are_exact::<2>();
        affine_fields_are_exact::<3>();
    }
}
