//! Twenty-node hexahedron on `[-1, 1]³` (serendipity): `N_a = ⅛ (1 + ξ_a ξ) (1 + η_a η) (1 + ζ_a ζ) (ξ_a ξ + η_a η + ζ_a ζ − 2)` at corners, `¼ (1 − ξ²) (1 + η_a η) (1 + ζ_a ζ)` in the middle of an edge along ξ.

use super::cell::{GAUSS_3, PerNode, ReferenceCell, RulePoint};
use crate::mesh::CellShape;

/// The hexahedron.
pub static CELL: ReferenceCell = ReferenceCell {
    shape: CellShape::Hex20,
    corners: &NODES,
    centre: [0.0; 3],
    values,
    gradients,
    outside: |xi| 0.5 * (xi[0].abs().max(xi[1].abs()).max(xi[2].abs()) - 1.0),
    stiffness: &GAUSS_3X3X3,
    mass: &GAUSS_3X3X3,
};

const NODES: [[f64; 3]; 20] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [0.0, -1.0, -1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, -1.0],
    [-1.0, 0.0, -1.0],
    [0.0, -1.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [-1.0, 0.0, 1.0],
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
];

/// Three Gauss points in each coordinate, exact to degree 5 in each.
const GAUSS_3X3X3: [RulePoint; 27] = {
    const LINE: [(f64, f64); 3] = [
        (-GAUSS_3, 5.0 / 9.0),
        (0.0, 8.0 / 9.0),
        (GAUSS_3, 5.0 / 9.0),
    ];
    let mut rule = [([0.0; 3], 0.0); 27];
    let mut q = 0;
    while q < 27 {
        let ((x, wx), (y, wy), (z, wz)) = (LINE[q / 9], LINE[q / 3 % 3], LINE[q % 3]);
        rule[q] = ([x, y, z], wx * wy * wz);
        q += 1;
    }
    rule
};

/// The factor of one coordinate and its slope: `1 + c x` at an end, `1 − x²` in the middle.
fn factor(c: f64, x: f64) -> (f64, f64) {
    match c == 0.0 {
        true => (1.0 - x * x, -2.0 * x),
        false => (1.0 + c * x, c),
    }
}

fn values(xi: &[f64; 3]) -> PerNode<f64> {
    let mut n = PerNode::<f64>::default();
    for (a, (n, c)) in n.iter_mut().zip(&NODES).enumerate() {
        let product: f64 = (0..3).map(|k| factor(c[k], xi[k]).0).product();
        *n = match a < 8 {
            true => 0.125 * product * (c[0] * xi[0] + c[1] * xi[1] + c[2] * xi[2] - 2.0),
            false => 0.25 * product,
        };
    }
    n
}

fn gradients(xi: &[f64; 3]) -> PerNode<[f64; 3]> {
    let mut g = PerNode::<[f64; 3]>::default();
    for (a, (g, c)) in g.iter_mut().zip(&NODES).enumerate() {
        let f: [(f64, f64); 3] = std::array::from_fn(|k| factor(c[k], xi[k]));
        let sum = c[0] * xi[0] + c[1] * xi[1] + c[2] * xi[2] - 2.0;
        for k in 0..3 {
            let others = f[(k + 1) % 3].0 * f[(k + 2) % 3].0;
            g[k] = match a < 8 {
                true => 0.125 * others * (f[k].1 * sum + f[k].0 * c[k]),
                false => 0.25 * others * f[k].1,
            };
        }
    }
    g
}
