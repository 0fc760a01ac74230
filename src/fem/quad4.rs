//! Four-node quadrilateral on `[-1, 1]²`: `N_a = ¼ (1 + ξ_a ξ) (1 + η_a η)`.

use super::cell::{GAUSS, PerNode, ReferenceCell, RulePoint};
use crate::mesh::CellShape;

/// The quadrilateral.
pub static CELL: ReferenceCell = ReferenceCell {
    shape: CellShape::Quad4,
    corners: &CORNERS,
    centre: [0.0; 3],
    values,
    gradients,
    outside: |xi| 0.5 * (xi[0].abs().max(xi[1].abs()) - 1.0),
    stiffness: &GAUSS_2X2,
    mass: &GAUSS_2X2,
};

const CORNERS: [[f64; 3]; 4] = [
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
];

/// Two by two Gauss points, exact to degree 3 in each coordinate.
const GAUSS_2X2: [RulePoint; 4] = [
    ([-GAUSS, -GAUSS, 0.0], 1.0),
    ([GAUSS, -GAUSS, 0.0], 1.0),
    ([GAUSS, GAUSS, 0.0], 1.0),
    ([-GAUSS, GAUSS, 0.0], 1.0),
];

fn values(xi: &[f64; 3]) -> PerNode<f64> {
    let mut n = PerNode::<f64>::default();
    for (n, c) in n.iter_mut().zip(&CORNERS) {
        *n = 0.25 * (1.0 + c[0] * xi[0]) * (1.0 + c[1] * xi[1]);
    }
    n
}

fn gradients(xi: &[f64; 3]) -> PerNode<[f64; 3]> {
    let mut g = PerNode::<[f64; 3]>::default();
    for (g, c) in g.iter_mut().zip(&CORNERS) {
        g[0] = 0.25 * c[0] * (1.0 + c[1] * xi[1]);
        g[1] = 0.25 * c[1] * (1.0 + c[0] * xi[0]);
    }
    g
}
