//! Three-node line on `[-1, 1]`: `N = (−½ ξ (1 − ξ), ½ ξ (1 + ξ), 1 − ξ²)`.

use super::cell::{GAUSS_3, PerNode, ReferenceCell, RulePoint};
use crate::mesh::CellShape;

/// The line.
pub static CELL: ReferenceCell = ReferenceCell {
    shape: CellShape::Line3,
    corners: &[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    centre: [0.0; 3],
    values,
    gradients,
    outside: |xi| 0.5 * (xi[0].abs() - 1.0),
    stiffness: &THREE,
    mass: &THREE,
};

/// Three Gauss points, exact to degree 5.
const THREE: [RulePoint; 3] = [
    ([-GAUSS_3, 0.0, 0.0], 5.0 / 9.0),
    ([0.0, 0.0, 0.0], 8.0 / 9.0),
    ([GAUSS_3, 0.0, 0.0], 5.0 / 9.0),
];

fn values(xi: &[f64; 3]) -> PerNode<f64> {
    let mut n = PerNode::<f64>::default();
    n[0] = -0.5 * xi[0] * (1.0 - xi[0]);
    n[1] = 0.5 * xi[0] * (1.0 + xi[0]);
    n[2] = 1.0 - xi[0] * xi[0];
    n
}

fn gradients(xi: &[f64; 3]) -> PerNode<[f64; 3]> {
    let mut g = PerNode::<[f64; 3]>::default();
    g[0][0] = xi[0] - 0.5;
    g[1][0] = xi[0] + 0.5;
    g[2][0] = -2.0 * xi[0];
    g
}
