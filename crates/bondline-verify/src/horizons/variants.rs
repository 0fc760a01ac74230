//! Ways to change the horizon along a bar, each as the bonds that pull at every node.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::bar::{Bar, Layout, RATIO};
use bondline::peridynamics::{Bound, bounded_least_norm::least_change};

/// Rows of directed bonds: `rows[i]` holds `(j, k)`, the force on node `i` is `Σ k (u_j − u_i)`.
type Rows = Vec<Vec<(usize, f64)>>;

/// Stiffness of the bonds between two nodes, lower number first.
type Pairs = BTreeMap<(usize, usize), f64>;

/// Share of a state-based law that is dilatation; the rest is what each bond adds by itself.
const DILATATION: f64 = 0.5;
/// Length of the ramp of a horizon that changes gradually \[mm\].
pub const RAMP: f64 = 10.0;
/// A fitted bond keeps at least this part of itself.
pub const LEAST: f64 = 0.05;

/// A way to change the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// Each node its own horizon, forces not in pairs. Source: \[Bobaru2009\] section 4.2, normalised weights.
    SourceNode,
    /// Dual-horizon peridynamics, bond-based: a bond pulls at both ends with what either end says, which is the mean of both rules.
    DualHorizon,
    /// The same for an ordinary state-based law.
    DualHorizonState,
    /// The multi-horizon paper, bond-based: \[Jenabidehkordi2019\] eq. (7), bonds between the two lattices by the horizon of the coarse node.
    MultiHorizon,
    /// The same for an ordinary state-based law, α a ratio of volumes.
    MultiHorizonState,
    /// A variable-scale-homogeneous body on the fine lattice throughout, the horizon a ramp. Source: [SAND2015-7998] (2.14) and (2.15).
    Ramp,
    /// A splice of two lattices: each node the whole family of its own side, interpolated on the other. Source: [SAND2015-7998] section 2.5.
    Splice,
    /// The divergence of the partial stress, families as in the splice. Source: [SAND2015-7998] section 2.5.
    PartialStress,
    /// Bonds end at the change of horizon, with so many finite elements between the two faces.
    Truncated(usize),
    /// The bonds of dual-horizon peridynamics with the least change that balances every node.
    Fitted,
    /// The same for the bonds of the multi-horizon paper.
    FittedMulti,
}

/// A law of bars of one lattice, with nothing to reflect at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Uniform {
    /// Bonds.
    BondBased,
    /// An ordinary state-based law.
    StateBased,
    /// The divergence of the partial stress.
    PartialStress,
}

impl Uniform {
    /// All of them, in their order.
    pub const ALL: [Self; 3] = [Self::BondBased, Self::StateBased, Self::PartialStress];

    /// The bar of that spacing.
    pub fn bar(self, h: f64) -> Bar {
        let layout = Layout::uniform(h);
        let rows = match self {
            Self::BondBased => splice(&layout),
            Self::StateBased => state_based(&layout, |i| own_family(&layout, i)),
            Self::PartialStress => partial_stress(&layout),
        };
        layout.bar(&rows)
    }
}

impl Variant {
    /// All of them, published ones first.
    pub const ALL: [Self; 13] = [
        Self::SourceNode,
        Self::DualHorizon,
        Self::DualHorizonState,
        Self::MultiHorizon,
        Self::MultiHorizonState,
        Self::Ramp,
        Self::Splice,
        Self::PartialStress,
        Self::Truncated(0),
        Self::Truncated(1),
        Self::Truncated(4),
        Self::Fitted,
        Self::FittedMulti,
    ];

    /// Its name in tables.
    pub fn name(self) -> String {
        match self {
            Self::SourceNode => "source node".to_owned(),
            Self::DualHorizon => "dual horizon, bond-based".to_owned(),
            Self::DualHorizonState => "dual horizon, state-based".to_owned(),
            Self::MultiHorizon => "multi-horizon paper, bond-based".to_owned(),
            Self::MultiHorizonState => "multi-horizon paper, state-based".to_owned(),
            Self::Ramp => "variable scale, ramp, all fine".to_owned(),
            Self::Splice => "splice of two horizons".to_owned(),
            Self::PartialStress => "partial stress".to_owned(),
            Self::Truncated(0) => "bonds cut at the change".to_owned(),
            Self::Truncated(n) => format!("bonds cut, {n} element(s) between"),
            Self::Fitted => "least change of dual horizon".to_owned(),
            Self::FittedMulti => "least change of multi-horizon".to_owned(),
        }
    }

    /// Returns true if a uniform strain must leave no force.
    pub fn is_patch_exact(self) -> bool {
        matches!(
            self,
            Self::Splice
                | Self::PartialStress
                | Self::Truncated(_)
                | Self::Fitted
                | Self::FittedMulti
        )
    }

    /// Returns true if forces must be pairs.
    pub fn is_reciprocal(self) -> bool {
        !matches!(self, Self::SourceNode | Self::Splice | Self::PartialStress)
    }

    /// The law that it has where the horizon does not change.
    pub fn alone(self) -> Uniform {
        match self {
            Self::DualHorizonState | Self::MultiHorizonState => Uniform::StateBased,
            Self::PartialStress => Uniform::PartialStress,
            _ => Uniform::BondBased,
        }
    }

    /// The bar whose middle has `ratio` times the spacing and the horizon of its ends, where the spacing is `fine`; `None` where a fit does not exist.
    pub fn bar(self, ratio: usize, fine: f64) -> Option<Bar> {
        let layout = match self {
            Self::Ramp => Layout::uniform(fine),
            _ => Layout::new(ratio, fine),
        };
        let l = &layout;
        let rows = match self {
            Self::SourceNode => source(l, |i| l.horizon(i)),
            Self::DualHorizon => of_pairs(l, &shared(&source(l, |i| l.horizon(i)))),
            Self::Ramp => of_pairs(l, &shared(&source(l, |i| ramp(l.x[i], ratio, fine)))),
            Self::DualHorizonState => state_based(l, |i| own_family(l, i)),
            Self::MultiHorizon => of_pairs(l, &multi_horizon(l)),
            Self::MultiHorizonState => state_based(l, |i| multi_family(l, i)),
            Self::Splice => splice(l),
            Self::PartialStress => partial_stress(l),
            Self::Truncated(layer) => of_pairs(l, &truncated(l, layer)),
            Self::Fitted => of_pairs(l, &balanced(l, shared(&source(l, |i| l.horizon(i))))?),
            Self::FittedMulti => of_pairs(l, &balanced(l, multi_horizon(l))?),
        };
        Some(layout.bar(&rows))
    }
}

/// The horizon of the gradual change, with straight ramps about the two changes.
fn ramp(x: f64, ratio: usize, fine: f64) -> f64 {
    let narrow = RATIO as f64 * fine;
    let middle = 0.5 * super::bar::LENGTH;
    let half = middle - super::bar::CHANGES[0];
    let t = ((half + 0.5 * RAMP - (x - middle).abs()) / RAMP).clamp(0.0, 1.0);
    narrow * (1.0 + t * (ratio as f64 - 1.0))
}

/// The constant micromodulus on a whole lattice: `w_k` with the force density `Σ w_k (u_j − u_i)` over the neighbours `k = 1 … m` on either side, the last
/// one with half of its cell, so that Young's modulus is 1.
fn lattice_weights(h: f64) -> Vec<f64> {
    let raw: Vec<f64> = (1..=RATIO)
        .map(|k| if k == RATIO { 0.5 } else { 1.0 } / k as f64)
        .collect();
    let sum: f64 = raw
        .iter()
        .zip(1..)
        .map(|(w, k)| w * (f64::from(k) * h).powi(2))
        .sum();
    raw.iter().map(|w| w / sum).collect()
}

fn source(l: &Layout, horizon: impl Fn(usize) -> f64) -> Rows {
    (0..l.count())
        .map(|i| {
            let delta = horizon(i);
            let mut row: Vec<(usize, f64)> = l
                .within(i, delta)
                .map(|j| (j, l.covered(i, j, delta) / (l.x[j] - l.x[i]).abs()))
                .collect();
            let modulus: f64 = row
                .iter()
                .map(|&(j, w)| 0.5 * w * (l.x[j] - l.x[i]).powi(2))
                .sum();
            row.iter_mut().for_each(|b| b.1 *= l.volume[i] / modulus);
            row
        })
        .collect()
}

/// The mean of what both ends of a bond say.
fn shared(rows: &Rows) -> Pairs {
    let mut pairs = Pairs::new();
    for (i, row) in rows.iter().enumerate() {
        for &(j, k) in row {
            *pairs.entry((i.min(j), i.max(j))).or_insert(0.0) += 0.5 * k;
        }
    }
    pairs
}

fn of_pairs(l: &Layout, pairs: &Pairs) -> Rows {
    let mut rows = vec![Vec::new(); l.count()];
    for (&(i, j), &k) in pairs {
        rows[i].push((j, k));
        rows[j].push((i, k));
    }
    rows
}

/// The stress that the far side of a change gives a fine node under a unit strain: its whole family's bonds that reach so far.
fn missing_pull(weights: &[f64], h: f64, distance: f64) -> f64 {
    let bond = |(w, k): (&f64, i32)| {
        let length = f64::from(k) * h;
        if length >= distance - 1e-9 {
            w * length
        } else {
            0.0
        }
    };
    weights.iter().zip(1..).map(bond).sum()
}

/// The bonds of the multi-horizon paper: each lattice its own, and between them those of the coarse nodes' horizons, all bonds of a fine node times the one
/// factor with which they pull as its family in the fine lattice would.
fn multi_horizon(l: &Layout) -> Pairs {
    let weights = l.spacing.map(lattice_weights);
    let mut pairs = Pairs::new();
    for i in 0..l.count() {
        let (h, w) = (l.spacing_of(i), &weights[usize::from(l.wide[i])]);
        for j in l
            .within(i, l.horizon(i))
            .filter(|&j| j > i && l.wide[j] == l.wide[i])
        {
            let k = ((l.x[j] - l.x[i]) / h).round() as usize;
            pairs.insert((i, j), w[k - 1] * l.volume[i] * l.volume[j] / h);
        }
        let reach = RATIO as f64 * l.spacing[1];
        let distance = l.to_change(i);
        if l.wide[i] || distance > reach {
            continue;
        }
        let far: Vec<(usize, f64)> = l
            .within(i, reach)
            .filter(|&j| l.wide[j])
            .map(|j| (j, l.covered(i, j, reach)))
            .collect();
        let alpha = missing_pull(&weights[0], h, distance) / far.iter().map(|f| f.1).sum::<f64>();
        for (j, covered) in far.into_iter().filter(|_| alpha > 0.0) {
            let k = alpha * covered / (l.x[j] - l.x[i]).abs() * l.volume[i];
            *pairs.entry((i.min(j), i.max(j))).or_insert(0.0) += k;
        }
    }
    pairs
}

/// The family of a node's own horizon: neighbours with what it covers of their cells.
fn own_family(l: &Layout, i: usize) -> Vec<(usize, f64)> {
    l.within(i, l.horizon(i) + l.spacing[1])
        .map(|j| (j, l.covered(i, j, l.horizon(i))))
        .filter(|b| b.1 > 0.0)
        .collect()
}

/// The family of a node in the multi-horizon paper: neighbours with what counts of their cells.
fn multi_family(l: &Layout, i: usize) -> Vec<(usize, f64)> {
    let wide = RATIO as f64 * l.spacing[1];
    // α of a fine node: the volume that its own horizon has on the far side, over that of its interaction horizon
    let alpha = |fine: usize, coarse: usize| {
        let distance = l.to_change(fine);
        let own = l.horizon(fine) - distance;
        let far: f64 = l.covered(fine, coarse, wide);
        far * own.max(0.0) / (wide - distance)
    };
    l.within(i, wide + l.spacing[1])
        .filter_map(|j| {
            let volume = match (l.wide[i], l.wide[j]) {
                (false, true) => alpha(i, j),
                (true, false) => alpha(j, i) * l.volume[j] / l.volume[i],
                _ => l.covered(i, j, l.horizon(i)),
            };
            (volume > 0.0).then_some((j, volume))
        })
        .collect()
}

/// The forces of an energy: dilatation and bonds, both by the families given, ω = 1/|ξ|.
fn state_based(l: &Layout, family: impl Fn(usize) -> Vec<(usize, f64)>) -> Rows {
    let mut rows: Vec<BTreeMap<usize, f64>> = vec![BTreeMap::new(); l.count()];
    let mut add = |i: usize, j: usize, k: f64| {
        if i != j {
            *rows[i].entry(j).or_insert(0.0) += k;
        }
    };
    for i in 0..l.count() {
        let bonds = family(i);
        let length = |j: usize| (l.x[j] - l.x[i]).abs();
        let m: f64 = bonds.iter().map(|&(j, v)| length(j) * v).sum();
        if bonds.is_empty() {
            continue;
        }
        for &(j, v) in &bonds {
            let k = (1.0 - DILATATION) * l.volume[i] * v / (length(j) * m);
            add(i, j, k);
            add(j, i, k);
        }
        // θ = Σ g (u_j − u_i); its energy ½ κ V θ² pulls at every node of the family
        let g = |j: usize, v: f64| (l.x[j] - l.x[i]).signum() * v / m;
        let mut theta: Vec<(usize, f64)> = bonds.iter().map(|&(j, v)| (j, g(j, v))).collect();
        theta.push((i, -theta.iter().map(|t| t.1).sum::<f64>()));
        for &(a, ga) in &theta {
            for &(b, gb) in &theta {
                add(a, b, -DILATATION * l.volume[i] * ga * gb);
            }
        }
    }
    rows.into_iter()
        .map(|row| row.into_iter().collect())
        .collect()
}

fn splice(l: &Layout) -> Rows {
    let weights = l.spacing.map(lattice_weights);
    (0..l.count())
        .map(|i| {
            let (h, w) = (l.spacing_of(i), &weights[usize::from(l.wide[i])]);
            let mut row = Vec::new();
            for (w, k) in w.iter().zip(1..) {
                for p in [l.x[i] - f64::from(k) * h, l.x[i] + f64::from(k) * h] {
                    if p > l.x[0] && p < l.x[l.count() - 1] {
                        let ends = l.at(p).into_iter();
                        row.extend(ends.map(|(j, s)| (j, w * s * l.volume[i])));
                    }
                }
            }
            row
        })
        .collect()
}

/// `ν = ½ Σ w ξ η` of the splice's families, and the force of a node half of the difference between the stresses beside it.
fn partial_stress(l: &Layout) -> Rows {
    let stress: Rows = splice(l)
        .into_iter()
        .enumerate()
        .map(|(i, row)| {
            let part = |(j, k): (usize, f64)| (j, 0.5 * k / l.volume[i] * (l.x[j] - l.x[i]));
            row.into_iter().map(part).collect()
        })
        .collect();
    let exact = |i: usize, row: Vec<(usize, f64)>| -> Vec<(usize, f64)> {
        // interpolated ends lie beside the neighbour they stand for: the weights of a family add up to the slope of a line again
        let slope: f64 = row.iter().map(|&(j, g)| g * (l.x[j] - l.x[i])).sum();
        row.into_iter().map(|(j, g)| (j, g / slope)).collect()
    };
    let stress: Rows = stress
        .into_iter()
        .enumerate()
        .map(|(i, r)| exact(i, r))
        .collect();
    (0..l.count())
        .map(|i| {
            let mut row = BTreeMap::new();
            if i == 0 || i + 1 == l.count() {
                return Vec::new();
            }
            for (side, sign) in [(i + 1, 0.5), (i - 1, -0.5)] {
                let own: f64 = stress[side].iter().map(|s| s.1).sum();
                *row.entry(side).or_insert(0.0) -= sign * own;
                for &(j, g) in &stress[side] {
                    *row.entry(j).or_insert(0.0) += sign * g;
                }
            }
            row.remove(&i);
            row.into_iter().collect()
        })
        .collect()
}

/// Each lattice ends at a face, and goes on behind it in thought; a bond that leaves it ends on the face and pulls as before. Between the faces lie `layer`
/// elements of the coarse spacing.
fn truncated(l: &Layout, layer: usize) -> Pairs {
    let mut pairs = Pairs::new();
    let mut add = |i: usize, j: usize, k: f64| *pairs.entry((i, j)).or_insert(0.0) += k;
    // runs of nodes from face to face
    let change = |c: &f64| l.at(*c)[0].0;
    let faces: Vec<usize> = l.changes.iter().map(change).collect();
    let last = l.count() - 1;
    let zones = [
        (0, faces[0], 0),
        (faces[0] + layer, faces[1] - layer, 1),
        (faces[1], last, 0),
    ];
    for (from, to, side) in zones {
        let (h, count) = (l.spacing[side], (to - from) as i64);
        let weights = lattice_weights(h);
        for p in -(RATIO as i64)..=count {
            for (w, k) in weights.iter().zip(1i64..) {
                let (start, end) = (p.max(0), (p + k).min(count));
                if start < end {
                    let stiffness = w * h * k as f64 / (end - start) as f64;
                    add(from + start as usize, from + end as usize, stiffness);
                }
            }
        }
    }
    for e in (faces[0]..faces[0] + layer).chain(faces[1] - layer..faces[1]) {
        add(e, e + 1, 1.0 / (l.x[e + 1] - l.x[e]));
    }
    pairs
}

/// The least relative change of the bonds about each change of the horizon with which the tensions over every cut between two nodes add up to the stress,
/// which is what balances every node.
fn balanced(l: &Layout, mut pairs: Pairs) -> Option<Pairs> {
    let reach = 3.0 * RATIO as f64 * l.spacing[1];
    for &c in &l.changes {
        let from = l.x.partition_point(|&x| x < c - reach);
        let to = l.x.partition_point(|&x| x <= c + reach) - 1;
        let inside: Vec<(usize, usize)> = pairs
            .keys()
            .copied()
            .filter(|&(i, j)| i >= from && j <= to)
            .collect();
        let tension = |key: &(usize, usize), k: f64| k * (l.x[key.1] - l.x[key.0]);
        let mut missing = DVector::from_element(to - from, 1.0);
        for (key, &k) in &pairs {
            for cut in key.0.max(from)..key.1.min(to) {
                missing[cut - from] -= tension(key, k);
            }
        }
        let rows = DMatrix::from_fn(to - from, inside.len(), |cut, b| {
            let (i, j) = inside[b];
            if (i..j).contains(&(from + cut)) {
                1.0
            } else {
                0.0
            }
        });
        let shares: Vec<f64> = inside.iter().map(|key| tension(key, pairs[key])).collect();
        let change = least_change(&rows, &shares, &missing, Bound::AtLeast(LEAST)).ok()?;
        for (key, change) in inside.iter().zip(change) {
            if let Some(k) = pairs.get_mut(key) {
                *k *= 1.0 + change;
            }
        }
    }
    Some(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::horizons::bar::FINE;

    #[test]
    fn horizons_of_the_ramp_meet_both_ends() {
        assert!((ramp(0.0, 4, FINE) - 0.3).abs() < 1e-12);
        assert!((ramp(50.0, 4, FINE) - 1.2).abs() < 1e-12);
        assert!((ramp(24.0, 4, FINE) - 0.75).abs() < 1e-12);
        assert!((ramp(76.0, 4, FINE) - 0.75).abs() < 1e-12);
    }

    #[test]
    fn fine_nodes_of_the_multi_horizon_paper_are_balanced_and_coarse_ones_are_not() {
        // eq. (7) for a uniform strain, summed bond by bond
        let l = Layout::new(4, FINE);
        let rows = of_pairs(&l, &multi_horizon(&l));
        let pull = |i: usize| -> f64 { rows[i].iter().map(|&(j, k)| k * (l.x[j] - l.x[i])).sum() };
        let (mut fine, mut coarse) = (0.0f64, 0.0f64);
        for i in (0..l.count()).filter(|&i| l.to_change(i) < 3.0) {
            let worst = if l.wide[i] { &mut coarse } else { &mut fine };
            *worst = worst.max(pull(i).abs());
        }
        assert!(fine < 1e-12 && coarse > 0.1, "{fine:e} {coarse}");
    }

    #[test]
    fn every_variant_is_what_it_claims_to_be() {
        for variant in Variant::ALL {
            let bar = variant.bar(4, FINE).unwrap();
            let name = variant.name();
            let (ghost, asymmetry) = (bar.ghost_force(), bar.asymmetry());
            assert_eq!(ghost < 1e-11, variant.is_patch_exact(), "{name}: {ghost:e}");
            assert_eq!(
                asymmetry < 1e-12,
                variant.is_reciprocal(),
                "{name}: {asymmetry:e}"
            );
            if variant.is_reciprocal() {
                assert!(bar.out_of_balance() < 1e-12, "{name}");
            }
        }
    }
}
