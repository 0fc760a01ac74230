//! Two-node line on `[-1, 1]`: `N_a = ½ (1 + ξ_a ξ)`.

use super::cell::{GAUSS, PerNode, ReferenceCell, RulePoint};
use crate::mesh::CellShape;

/// The line.
pub static CELL: ReferenceCell = ReferenceCell {
    shape: CellShape::Line2,
    corners: &[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
    centre: [0.0; 3],
    values,
    gradients,
    outside: |xi| 0.5 * (xi[0].abs() - 1.0),
    stiffness: &GAUSS_2,
    mass: &GAUSS_2,
};

/// Two Gauss points, exact to degree 3.
const GAUSS_2: [RulePoint; 2] = [([-GAUSS, 0.0, 0.0], 1.0), ([GAUSS, 0.0, 0.0], 1.0)];

fn values(xi: &[f64; 3]) -> PerNode<f64> {
    let mut n = PerNode::<f64>::default();
    n[0] = 0.5 * (1.0 - xi[0]);
    n[1] = 0.5 * (1.0 + xi[0]);
    n
}

fn gradients(_xi: &[f64; 3]) -> PerNode<[f64; 3]> {
    let mut g = PerNode::<[f64; 3]>::default();
    g[0][0] = -0.5;
    g[1][0] = 0.5;
    g
}
