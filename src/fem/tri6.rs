//! Six-node triangle on `ξ, η ≥ 0, ξ + η ≤ 1`, with `L = (1 − ξ − η, ξ, η)`: `N_a = L_a (2 L_a − 1)` at corners, `4 L_a L_b` between a and b.

use super::cell::{PerNode, ReferenceCell, RulePoint};
use crate::mesh::CellShape;

/// The triangle.
pub static CELL: ReferenceCell = ReferenceCell {
    shape: CellShape::Tri6,
    corners: &[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.5, 0.0, 0.0],
        [0.5, 0.5, 0.0],
        [0.0, 0.5, 0.0],
    ],
    centre: [1.0 / 3.0, 1.0 / 3.0, 0.0],
    values,
    gradients,
    outside: |xi| (-xi[0]).max(-xi[1]).max(xi[0] + xi[1] - 1.0),
    stiffness: &super::tri3::THREE,
    mass: &SIX,
};

/// Two orbits `(a, a, 1 − 2a)` with their weights: exact to degree 4.
///
/// Source: \[Dunavant1985\] table II, p = 4.
const ORBITS: [(f64, f64); 2] = [
    (0.445_948_490_915_964_9, 0.111_690_794_839_005_73),
    (0.091_576_213_509_770_74, 0.054_975_871_827_660_93),
];

/// The six points of the orbits.
const SIX: [RulePoint; 6] = {
    let mut rule = [([0.0; 3], 0.0); 6];
    let mut orbit = 0;
    while orbit < 2 {
        let (a, w) = ORBITS[orbit];
        let b = 1.0 - 2.0 * a;
        rule[3 * orbit] = ([a, a, 0.0], w);
        rule[3 * orbit + 1] = ([b, a, 0.0], w);
        rule[3 * orbit + 2] = ([a, b, 0.0], w);
        orbit += 1;
    }
    rule
};

fn values(xi: &[f64; 3]) -> PerNode<f64> {
    let l = [1.0 - xi[0] - xi[1], xi[0], xi[1]];
    let mut n = PerNode::<f64>::default();
    for a in 0..3 {
        n[a] = l[a] * (2.0 * l[a] - 1.0);
        n[3 + a] = 4.0 * l[a] * l[(a + 1) % 3];
    }
    n
}

fn gradients(xi: &[f64; 3]) -> PerNode<[f64; 3]> {
    const SLOPE: [[f64; 2]; 3] = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
    let l = [1.0 - xi[0] - xi[1], xi[0], xi[1]];
    let mut g = PerNode::<[f64; 3]>::default();
    for a in 0..3 {
        let b = (a + 1) % 3;
        for k in 0..2 {
            g[a][k] = (4.0 * l[a] - 1.0) * SLOPE[a][k];
            g[3 + a][k] = 4.0 * (SLOPE[a][k] * l[b] + l[a] * SLOPE[b][k]);
        }
    }
    g
}
