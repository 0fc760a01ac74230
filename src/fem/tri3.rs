//! Three-node triangle on `ξ, η ≥ 0, ξ + η ≤ 1`: `N = (1 − ξ − η, ξ, η)`.

use super::cell::{PerNode, ReferenceCell, RulePoint};
use crate::mesh::CellShape;

/// The triangle.
pub static CELL: ReferenceCell = ReferenceCell {
    shape: CellShape::Tri3,
    corners: &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    centre: [1.0 / 3.0, 1.0 / 3.0, 0.0],
    values,
    gradients,
    outside: |xi| (-xi[0]).max(-xi[1]).max(xi[0] + xi[1] - 1.0),
    stiffness: &[([1.0 / 3.0, 1.0 / 3.0, 0.0], 0.5)],
    mass: &THREE,
};

/// Three inner points, exact to degree 2.
pub(super) const THREE: [RulePoint; 3] = [
    ([1.0 / 6.0, 1.0 / 6.0, 0.0], 1.0 / 6.0),
    ([2.0 / 3.0, 1.0 / 6.0, 0.0], 1.0 / 6.0),
    ([1.0 / 6.0, 2.0 / 3.0, 0.0], 1.0 / 6.0),
];

fn values(xi: &[f64; 3]) -> PerNode<f64> {
    let mut n = PerNode::<f64>::default();
    n[0] = 1.0 - xi[0] - xi[1];
    n[1] = xi[0];
    n[2] = xi[1];
    n
}

fn gradients(_xi: &[f64; 3]) -> PerNode<[f64; 3]> {
    let mut g = PerNode::<[f64; 3]>::default();
    g[0] = [-1.0, -1.0, 0.0];
    g[1] = [1.0, 0.0, 0.0];
    g[2] = [0.0, 1.0, 0.0];
    g
}
