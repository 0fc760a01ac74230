//! Four-node tetrahedron on `ξ, η, ζ ≥ 0, ξ + η + ζ ≤ 1`: `N = (1 − ξ − η − ζ, ξ, η, ζ)`.

use super::cell::{PerNode, ReferenceCell, RulePoint};
use crate::mesh::CellShape;

/// The tetrahedron.
pub static CELL: ReferenceCell = ReferenceCell {
    shape: CellShape::Tet4,
    corners: &[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
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
    stiffness: &[([0.25; 3], 1.0 / 6.0)],
    mass: &FOUR,
};

/// `(5 + 3 √5) / 20` and `(5 − √5) / 20`.
const NEAR: f64 = 0.585_410_196_624_968_5;
const FAR: f64 = 0.138_196_601_125_010_5;

/// Four inner points, exact to degree 2.
pub(super) const FOUR: [RulePoint; 4] = [
    ([FAR, FAR, FAR], 1.0 / 24.0),
    ([NEAR, FAR, FAR], 1.0 / 24.0),
    ([FAR, NEAR, FAR], 1.0 / 24.0),
    ([FAR, FAR, NEAR], 1.0 / 24.0),
];

fn values(xi: &[f64; 3]) -> PerNode<f64> {
    let mut n = PerNode::<f64>::default();
    n[0] = 1.0 - xi[0] - xi[1] - xi[2];
    n[1..4].copy_from_slice(xi);
    n
}

fn gradients(_xi: &[f64; 3]) -> PerNode<[f64; 3]> {
    let mut g = PerNode::<[f64; 3]>::default();
    g[0] = [-1.0; 3];
    g[1][0] = 1.0;
    g[2][1] = 1.0;
    g[3][2] = 1.0;
    g
}
