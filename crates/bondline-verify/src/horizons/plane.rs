//! The same question in a plane: a strip of two square lattices, and a test if bonds that are pairs can balance every node under every uniform strain.
//!
//! The strip is periodic along the line at which the spacing changes. A bond between two nodes has the force `k ξ (ξ·η)`; under `η = G ξ` a node is balanced
//! for every `G` if and only if `Σ k ξ⊗ξ⊗ξ = 0` over its bonds. These are four conditions per node, linear in the bonds, which belong to two nodes each.

use nalgebra::{DMatrix, DVector};

use bondline::peridynamics::{Bound, bounded_least_norm::least_change};

/// Positions agree within this part of a horizon.
const TIE: f64 = 1e-9;

/// Exponents of the third moments.
const MOMENTS: [[i32; 2]; 4] = [[3, 0], [2, 1], [1, 2], [0, 3]];

#[derive(Clone, Copy, Debug)]
struct Node {
    at: [f64; 2],
    area: f64,
    wide: bool,
    /// True if its whole family is in the strip.
    whole: bool,
}

#[derive(Clone, Copy, Debug)]
struct PlaneBond {
    ends: [usize; 2],
    xi: [f64; 2],
    stiffness: f64,
}

/// Construction of the bonds between the lattices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Between {
    /// The mean of the bonds of both ends.
    DualHorizon,
    /// The horizon of the coarse node, times the factor of each fine node with which the stress across the line is right.
    MultiHorizon,
}

/// Least change of the bonds that balances every node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balanced {
    /// Conditions.
    pub conditions: usize,
    /// Largest force left.
    pub left: f64,
    /// Smallest and largest factor of a bond.
    pub factors: [f64; 2],
}

/// A strip of fine cells at x < 0 and coarse ones at x > 0; spacings 1 and `ratio`, one period of the coarse lattice wide.
#[derive(Clone, Debug)]
pub struct Strip {
    nodes: Vec<Node>,
    bonds: Vec<PlaneBond>,
}

/// The nodes of the strip: the fine lattice on the left, the coarse one on the right.
fn nodes(ratio: usize, m: usize) -> Vec<Node> {
    let coarse = ratio as f64;
    let reach = m as f64 * coarse;
    let columns = (2.0 * reach) as usize + 3;
    let mut nodes = Vec::new();
    for i in 0..columns {
        let x = i as f64 + 0.5;
        for j in 0..ratio {
            nodes.push(Node {
                at: [-x, j as f64 + 0.5],
                area: 1.0,
                wide: false,
                whole: x + m as f64 <= columns as f64,
            });
        }
    }
    let columns = 2 * m + 3;
    for i in 0..columns {
        let x = i as f64 + 0.5;
        nodes.push(Node {
            at: [x * coarse, 0.5 * coarse],
            area: coarse * coarse,
            wide: true,
            whole: x + m as f64 <= columns as f64,
        });
    }
    nodes
}

impl Strip {
    /// The strip for m = δ/h on both sides, kernel c/|ξ|³, both lattices with `C_1111 = 1`.
    pub fn new(ratio: usize, m: usize, between: Between) -> Self {
        let coarse = ratio as f64;
        let reach = m as f64 * coarse;
        let strength = |h: f64| {
            let n = m as i32;
            let square = |a: i32, b: i32| f64::from(a * a + b * b);
            let offsets = (-n..=n).flat_map(|a| (-n..=n).map(move |b| (a, b)));
            let inside = offsets
                .filter(|&(a, b)| (a, b) != (0, 0) && square(a, b) <= (m * m) as f64 * (1.0 + TIE));
            let sum: f64 = inside
                .map(|(a, b)| 0.5 * f64::from(a).powi(4) / square(a, b).powf(1.5) * h.powi(3))
                .sum();
            1.0 / sum
        };
        let strength = [strength(1.0), strength(coarse)];
        let kernel = |wide: bool, r: f64| {
            let delta = if wide { reach } else { m as f64 };
            if r <= delta * (1.0 + TIE) {
                strength[usize::from(wide)] / r.powi(3)
            } else {
                0.0
            }
        };
        let nodes = nodes(ratio, m);
        let mut strip = Self {
            nodes,
            bonds: Vec::new(),
        };
        let images = m as i32 + 2;
        for a in 0..strip.nodes.len() {
            for b in a..strip.nodes.len() {
                for image in -images..=images {
                    // a bond from a node to its own image is that of the image back
                    if a == b && image <= 0 {
                        continue;
                    }
                    let (from, to) = (strip.nodes[a], strip.nodes[b]);
                    let xi = [
                        to.at[0] - from.at[0],
                        to.at[1] + f64::from(image) * coarse - from.at[1],
                    ];
                    let r = xi[0].hypot(xi[1]);
                    let own = |wide| kernel(wide, r) * from.area * to.area;
                    let stiffness = match between {
                        _ if from.wide == to.wide => own(from.wide),
                        Between::DualHorizon => 0.5 * (own(true) + own(false)),
                        Between::MultiHorizon => own(true),
                    };
                    if stiffness > 0.0 {
                        let ends = [a, b];
                        strip.bonds.push(PlaneBond {
                            ends,
                            xi,
                            stiffness,
                        });
                    }
                }
            }
        }
        if between == Between::MultiHorizon {
            strip.scale_between();
        }
        strip
    }

    /// Gives the bonds of each fine node into the coarse lattice the factor with which its balance along x is right.
    fn scale_between(&mut self) {
        let crosses = |s: &Self, b: &PlaneBond| s.nodes[b.ends[0]].wide != s.nodes[b.ends[1]].wide;
        for n in (0..self.nodes.len()).filter(|&n| !self.nodes[n].wide && self.nodes[n].whole) {
            let (mut own, mut far) = (0.0, 0.0);
            for b in &self.bonds {
                let sum = if crosses(self, b) { &mut far } else { &mut own };
                *sum += pull(b, n, MOMENTS[0]);
            }
            let factor = if far.abs() > 0.0 {
                (-own / far).max(0.0)
            } else {
                1.0
            };
            for k in 0..self.bonds.len() {
                if self.bonds[k].ends[0] == n && crosses(self, &self.bonds[k]) {
                    self.bonds[k].stiffness *= factor;
                }
            }
        }
        self.bonds.retain(|b| b.stiffness > 1e-14);
    }

    /// Number of bonds.
    pub fn bonds(&self) -> usize {
        self.bonds.len()
    }

    /// Largest force on a node under a uniform strain, per volume, times the fine spacing, over the modulus.
    pub fn ghost_force(&self) -> f64 {
        self.moments().amax()
    }

    /// Third moments of the nodes with whole families, over their areas.
    fn moments(&self) -> DVector<f64> {
        let whole: Vec<usize> = self.whole();
        let moment = |c: usize| {
            let n = whole[c / 4];
            let sum: f64 = self.bonds.iter().map(|b| pull(b, n, MOMENTS[c % 4])).sum();
            sum / self.nodes[n].area
        };
        DVector::from_fn(4 * whole.len(), |c, _| moment(c))
    }

    fn whole(&self) -> Vec<usize> {
        (0..self.nodes.len())
            .filter(|&n| self.nodes[n].whole)
            .collect()
    }

    /// Changes bonds by as little as balances every node, none below `least` of itself; `None` where there is no such change.
    pub fn balanced(&self, least: f64) -> Option<Balanced> {
        let whole = self.whole();
        // bonds of nodes whose families the strip cuts stay what they are
        let free: Vec<&PlaneBond> = self
            .bonds
            .iter()
            .filter(|b| b.ends.iter().all(|&n| self.nodes[n].whole))
            .collect();
        let size = |b: &PlaneBond| b.stiffness * b.xi[0].hypot(b.xi[1]).powi(3);
        let shares: Vec<f64> = free.iter().map(|b| size(b)).collect();
        let rows = DMatrix::from_fn(4 * whole.len(), free.len(), |c, k| {
            let n = whole[c / 4];
            pull(free[k], n, MOMENTS[c % 4]) / shares[k] / self.nodes[n].area
        });
        let moments = self.moments();
        let change = least_change(&rows, &shares, &(-&moments), Bound::AtLeast(least)).ok()?;
        let moved = DVector::from_fn(free.len(), |k, _| shares[k] * change[k]);
        let range = change.iter().fold([f64::INFINITY, 0.0], |r: [f64; 2], c| {
            [r[0].min(1.0 + c), r[1].max(1.0 + c)]
        });
        Some(Balanced {
            conditions: rows.nrows(),
            left: (rows * moved + moments).amax(),
            factors: range,
        })
    }
}

/// Returns the contribution of a bond to a third moment of a node, either end counted.
fn pull(b: &PlaneBond, n: usize, moment: [i32; 2]) -> f64 {
    let value = b.stiffness * b.xi[0].powi(moment[0]) * b.xi[1].powi(moment[1]);
    let mut sum = 0.0;
    if b.ends[0] == n {
        sum += value;
    }
    if b.ends[1] == n {
        sum -= value;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_lattice_is_balanced_as_it_is() {
        for between in [Between::DualHorizon, Between::MultiHorizon] {
            let strip = Strip::new(1, 3, between);
            assert!(strip.ghost_force() < 1e-14, "{between:?}");
            let balanced = strip.balanced(0.05).unwrap();
            assert!((balanced.factors[0] - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn two_lattices_are_not_and_can_be() {
        let strip = Strip::new(2, 2, Between::DualHorizon);
        assert!(strip.ghost_force() > 0.05);
        let balanced = strip.balanced(0.05).unwrap();
        assert!(
            balanced.left < 1e-12 && balanced.factors[0] > 0.05,
            "{balanced:?}"
        );
    }
}
