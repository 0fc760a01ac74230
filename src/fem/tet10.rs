//! Ten-node tetrahedron on `ξ, η, ζ ≥ 0, ξ + η + ζ ≤ 1`, with `L = (1 − ξ − η − ζ, ξ, η, ζ)`: `N_a = L_a (2 L_a − 1)` at corners, `4 L_a L_b` between a and b.

use super::cell::{PerNode, ReferenceCell, RulePoint};
use crate::mesh::CellShape;

/// The tetrahedron.
pub static CELL: ReferenceCell = ReferenceCell {
    shape: CellShape::Tet10,
    corners: &[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.5, 0.0, 0.0],
        [0.5, 0.5, 0.0],
        [0.0, 0.5, 0.0],
        [0.0, 0.0, 0.5],
        [0.5, 0.0, 0.5],
        [0.0, 0.5, 0.5],
    ],
    centre: [0.25; 3],
    values,
    gradients,
    outside: |xi| {
        (-xi[0])
            .max(-xi[1])
            .max(-xi[2])
            .max(xi[0] + xi[1] + xi[2] - 1.0)
    },
    stiffness: &super::tet4::FOUR,
    mass: &FOURTEEN,
};

/// The corners of each edge with a node, in the order of the nodes.
const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];

/// Fourteen inner points of positive weight, exact to degree 5.
///
/// Source: \[Walkington2000\], two orbits of four points and one of six.
const FOURTEEN: [RulePoint; 14] = {
    const VERTEX: [(f64, f64); 2] = [
        (0.310_885_919_263_300_6, 0.018_781_320_953_002_643),
        (0.092_735_250_310_891_23, 0.012_248_840_519_393_66),
    ];
    const EDGE: (f64, f64) = (0.045_503_704_125_649_65, 0.007_091_003_462_846_911);
    let mut rule = [([0.0; 3], 0.0); 14];
    let mut orbit = 0;
    while orbit < 2 {
        let (a, w) = VERTEX[orbit];
        let b = 1.0 - 3.0 * a;
        rule[4 * orbit] = ([a, a, a], w);
        rule[4 * orbit + 1] = ([b, a, a], w);
        rule[4 * orbit + 2] = ([a, b, a], w);
        rule[4 * orbit + 3] = ([a, a, b], w);
        orbit += 1;
    }
    let (a, w) = EDGE;
    let b = 0.5 - a;
    rule[8] = ([a, b, b], w);
    rule[9] = ([b, a, b], w);
    rule[10] = ([b, b, a], w);
    rule[11] = ([b, a, a], w);
    rule[12] = ([a, b, a], w);
    rule[13] = ([a, a, b], w);
    rule
};

fn values(xi: &[f64; 3]) -> PerNode<f64> {
    let l = [1.0 - xi[0] - xi[1] - xi[2], xi[0], xi[1], xi[2]];
    let mut n = PerNode::<f64>::default();
    for a in 0..4 {
        n[a] = l[a] * (2.0 * l[a] - 1.0);
    }
    for (n, [a, b]) in n[4..].iter_mut().zip(EDGES) {
        *n = 4.0 * l[a] * l[b];
    }
    n
}

fn gradients(xi: &[f64; 3]) -> PerNode<[f64; 3]> {
    const SLOPE: [[f64; 3]; 4] = [
        [-1.0, -1.0, -1.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    let l = [1.0 - xi[0] - xi[1] - xi[2], xi[0], xi[1], xi[2]];
    let mut g = PerNode::<[f64; 3]>::default();
    for k in 0..3 {
        for a in 0..4 {
            g[a][k] = (4.0 * l[a] - 1.0) * SLOPE[a][k];
        }
        for (g, [a, b]) in g[4..].iter_mut().zip(EDGES) {
            g[k] = 4.0 * (SLOPE[a][k] * l[b] + l[a] * SLOPE[b][k]);
        }
    }
    g
}
