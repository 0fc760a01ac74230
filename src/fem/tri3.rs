//! Three-node triangle on `ξ, η ≥ 0, ξ + η ≤ 1`: `N = (1 − ξ − η, ξ, η)`.

use super::cell::{ReferenceCell, RulePoint};
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
const THREE: [RulePoint; 3] = [
    ([1.0 / 6.0, 1.0 / 6.0, 0.0], 1.0 / 6.0),
    ([2.0 / 3.0, 1.0 / 6.0, 0.0], 1.0 / 6.0),
    ([1.0 / 6.0, 2.0 / 3.0, 0.0], 1.0 / 6.0),
];

fn values(xi: &[f64; 3]) -> [f64; 8] {
    let mut n = [0.0; 8];
    n[0] = 1.0 - xi[0] - xi[1];
    n[1] = xi[0];
    n[2] = xi[1];
    n
}

fn gradients(_xi: &[f64; 3]) -> [[f64; 3]; 8] {
    let mut g = [[0.0; 3]; 8];
    g[0] = [-1.0, -1.0, 0.0];
    g[1] = [1.0, 0.0, 0.0];
    g[2] = [0.0, 1.0, 0.0];
    g
}
