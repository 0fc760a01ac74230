//! Eight-node quadrilateral on `[-1, 1]²` (serendipity): `N_a = ¼ (1 + ξ_a ξ) (1 + η_a η) (ξ_a ξ + η_a η − 1)` at corners, `½ (1 − ξ²) (1 + η_a η)` and `½ (1 + ξ_a ξ) (1 − η²)` between them.

use super::cell::{GAUSS_3, PerNode, ReferenceCell, RulePoint};
use crate::mesh::CellShape;

/// The quadrilateral.
pub static CELL: ReferenceCell = ReferenceCell {
    shape: CellShape::Quad8,
    corners: &NODES,
    centre: [0.0; 3],
    values,
    gradients,
    outside: |xi| 0.5 * (xi[0].abs().max(xi[1].abs()) - 1.0),
    stiffness: &GAUSS_3X3,
    mass: &GAUSS_3X3,
};

const NODES: [[f64; 3]; 8] = [
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [-1.0, 0.0, 0.0],
];

/// Three Gauss points in each coordinate, exact to degree 5 in each.
const GAUSS_3X3: [RulePoint; 9] = {
    const LINE: [(f64, f64); 3] = [
        (-GAUSS_3, 5.0 / 9.0),
        (0.0, 8.0 / 9.0),
        (GAUSS_3, 5.0 / 9.0),
    ];
    let mut rule = [([0.0; 3], 0.0); 9];
    let mut q = 0;
    while q < 9 {
        let ((x, wx), (y, wy)) = (LINE[q / 3], LINE[q % 3]);
        rule[q] = ([x, y, 0.0], wx * wy);
        q += 1;
    }
    rule
};

fn values(xi: &[f64; 3]) -> PerNode<f64> {
    let [x, y, _] = *xi;
    let mut n = PerNode::<f64>::default();
    for (n, c) in n.iter_mut().zip(&NODES) {
        let (s, t) = (c[0] * x, c[1] * y);
        *n = match (c[0] == 0.0, c[1] == 0.0) {
            (true, _) => 0.5 * (1.0 - x * x) * (1.0 + t),
            (_, true) => 0.5 * (1.0 + s) * (1.0 - y * y),
            _ => 0.25 * (1.0 + s) * (1.0 + t) * (s + t - 1.0),
        };
    }
    n
}

fn gradients(xi: &[f64; 3]) -> PerNode<[f64; 3]> {
    let [x, y, _] = *xi;
    let mut g = PerNode::<[f64; 3]>::default();
    for (g, c) in g.iter_mut().zip(&NODES) {
        let (s, t) = (c[0] * x, c[1] * y);
        let slopes = match (c[0] == 0.0, c[1] == 0.0) {
            (true, _) => [-x * (1.0 + t), 0.5 * (1.0 - x * x) * c[1]],
            (_, true) => [0.5 * c[0] * (1.0 - y * y), -y * (1.0 + s)],
            _ => [
                0.25 * c[0] * (1.0 + t) * (2.0 * s + t),
                0.25 * c[1] * (1.0 + s) * (s + 2.0 * t),
            ],
        };
        g[..2].copy_from_slice(&slopes);
    }
    g
}
