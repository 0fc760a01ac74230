//! Eight-node hexahedron on `[-1, 1]³`: `N_a = ⅛ (1 + ξ_a ξ) (1 + η_a η) (1 + ζ_a ζ)`.

use super::cell::{GAUSS, PerNode, ReferenceCell, RulePoint};
use crate::mesh::CellShape;

/// The hexahedron.
pub static CELL: ReferenceCell = ReferenceCell {
    shape: CellShape::Hex8,
    corners: &CORNERS,
    centre: [0.0; 3],
    values,
    gradients,
    outside: |xi| 0.5 * (xi[0].abs().max(xi[1].abs()).max(xi[2].abs()) - 1.0),
    stiffness: &GAUSS_2X2X2,
    mass: &GAUSS_2X2X2,
};

const CORNERS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// Two Gauss points in each coordinate, exact to degree 3 in each; one beside each corner, in the corners' order.
const GAUSS_2X2X2: [RulePoint; 8] = {
    let mut rule = [([0.0; 3], 1.0); 8];
    let mut a = 0;
    while a < 8 {
        let c = CORNERS[a];
        rule[a].0 = [GAUSS * c[0], GAUSS * c[1], GAUSS * c[2]];
        a += 1;
    }
    rule
};

fn values(xi: &[f64; 3]) -> PerNode<f64> {
    let mut n = PerNode::<f64>::default();
    for (n, c) in n.iter_mut().zip(&CORNERS) {
        *n = 0.125 * (1.0 + c[0] * xi[0]) * (1.0 + c[1] * xi[1]) * (1.0 + c[2] * xi[2]);
    }
    n
}

fn gradients(xi: &[f64; 3]) -> PerNode<[f64; 3]> {
    let mut g = PerNode::<[f64; 3]>::default();
    for (g, c) in g.iter_mut().zip(&CORNERS) {
        let f = [1.0 + c[0] * xi[0], 1.0 + c[1] * xi[1], 1.0 + c[2] * xi[2]];
        g[0] = 0.125 * c[0] * f[1] * f[2];
        g[1] = 0.125 * c[1] * f[2] * f[0];
        g[2] = 0.125 * c[2] * f[0] * f[1];
    }
    g
}
