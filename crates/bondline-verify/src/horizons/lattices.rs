//! State-based laws on two lattices that meet along a line or a face: a strip in two or three dimensions, periodic across.
//!
//! Every law here is an energy, hence reciprocal, whatever its families are:
//!
//! ```text
//! W = Σ V_i (½ K′ θ_i² + ½ Σ k_ij (ξ·η)²) ,   θ_i = Σ g_ij·η ,   g = D ω v ξ/m ,   k = D (D+2) μ ω v/(m |ξ|²) ,   K′ = λ − μ ,   ω = 1/|ξ|
//! ```
//!
//! with `v` what counts of the far cell. `K′ = 0` is bond-based. Under `η = G ξ` a node is balanced for every `G` if `Σ k ξ⊗ξ⊗ξ = 0` over all bonds that end there, and if θ is tr G everywhere and
//! a uniform pressure leaves nothing. Both are linear in factors of the bonds, which least change finds.

use std::collections::{BTreeMap, HashMap};

use nalgebra::{DMatrix, DVector};

use bondline::{
    peridynamics::{Bound, bounded_least_norm::least_change},
    tensor::{Tensor, Vector},
};

/// Positions agree within this part of a horizon.
const TIE: f64 = 1e-9;

/// Construction of the families where the horizon changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Families {
    /// Each node's own horizon; a bond pulls at both ends with what either end says.
    DualHorizon,
    /// Between the lattices the horizon of the coarse node, times the part of that which the fine node's own horizon has beyond the change. Source: \[Jenabidehkordi2019\] eq. (7).
    MultiHorizon,
}

/// The elastic constants of a strip; `λ + 2μ = 1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solid {
    /// λ = μ.
    BondBased,
    /// λ = 1.5 μ: a Poisson's ratio of 0.3 in solids and plane strain.
    StateBased,
}

impl Solid {
    /// λ and μ.
    fn lame(self) -> (f64, f64) {
        match self {
            Self::BondBased => (1.0 / 3.0, 1.0 / 3.0),
            Self::StateBased => (1.5 / 3.5, 1.0 / 3.5),
        }
    }
}

/// Parameters of the two lattices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Meeting {
    /// Coarse spacing over the fine one, which is 1.
    pub ratio: usize,
    /// Horizon over spacing, on both sides.
    pub m: usize,
    /// The families between the lattices.
    pub families: Families,
    /// The law.
    pub solid: Solid,
}

#[derive(Clone, Copy, Debug)]
struct Node<const D: usize> {
    at: Vector<D>,
    volume: f64,
    is_wide: bool,
}

#[derive(Clone, Copy, Debug)]
struct Bond<const D: usize> {
    end: usize,
    xi: Vector<D>,
    /// `k`.
    pair: f64,
    /// `g`.
    state: Vector<D>,
}

/// Fine cells at x < 0, coarse ones at x > 0, one coarse cell wide.
#[derive(Clone, Debug)]
pub struct Strip<const D: usize> {
    meeting: Meeting,
    nodes: Vec<Node<D>>,
    bonds: Vec<Vec<Bond<D>>>,
}

/// Volume of the part of a ball that lies beyond a plane at a distance from its middle.
fn cap<const D: usize>(radius: f64, distance: f64) -> f64 {
    if distance >= radius {
        return 0.0;
    }
    match D {
        1 => radius - distance,
        2 => {
            let across = (radius * radius - distance * distance).sqrt();
            radius * radius * (distance / radius).acos() - distance * across
        }
        _ => {
            let height = radius - distance;
            std::f64::consts::PI * height * height * (2.0 * radius + distance) / 3.0
        }
    }
}

impl<const D: usize> Strip<D> {
    /// A strip of so many coarse cells on the right and cells of the same length together on the left.
    pub fn new(meeting: Meeting, columns: usize) -> Self {
        let mut nodes = Self::columns(1.0, meeting.ratio, columns * meeting.ratio, -1.0);
        nodes.extend(Self::columns(meeting.ratio as f64, 1, columns, 1.0));
        Self::of_nodes(meeting, nodes)
    }

    /// The strip that is coarse on both sides.
    pub fn coarse(meeting: Meeting, columns: usize) -> Self {
        let spacing = meeting.ratio as f64;
        let mut nodes = Self::columns(spacing, 1, columns, -1.0);
        nodes.extend(Self::columns(spacing, 1, columns, 1.0));
        nodes.iter_mut().for_each(|n| n.is_wide = true);
        Self::of_nodes(meeting, nodes)
    }

    fn columns(spacing: f64, across: usize, count: usize, side: f64) -> Vec<Node<D>> {
        let rows = across.pow(D as u32 - 1);
        let node = |k: usize| {
            let (column, mut row) = (k / rows, k % rows);
            let mut at = Vector::<D>::zeros();
            at[0] = side * (column as f64 + 0.5) * spacing;
            for i in 1..D {
                at[i] = ((row % across) as f64 + 0.5) * spacing;
                row /= across;
            }
            Node {
                at,
                volume: spacing.powi(D as i32),
                is_wide: side > 0.0,
            }
        };
        (0..count * rows).map(node).collect()
    }

    fn of_nodes(meeting: Meeting, mut nodes: Vec<Node<D>>) -> Self {
        nodes.sort_by(|a, b| a.at[0].total_cmp(&b.at[0]));
        let mut strip = Self {
            meeting,
            nodes,
            bonds: Vec::new(),
        };
        strip.bonds = (0..strip.nodes.len()).map(|i| strip.family(i)).collect();
        strip
    }

    fn horizon(&self, is_wide: bool) -> f64 {
        (self.meeting.m * if is_wide { self.meeting.ratio } else { 1 }) as f64
    }

    /// Returns the part of the cell of node `j`, at the distance `r`, that counts in the family of node `i`.
    fn counted(&self, i: usize, j: usize, r: f64) -> f64 {
        let (a, b) = (&self.nodes[i], &self.nodes[j]);
        let between = a.is_wide != b.is_wide && self.meeting.families == Families::MultiHorizon;
        let horizon = self.horizon(a.is_wide || between);
        if r > horizon * (1.0 + TIE) {
            return 0.0;
        }
        if !between {
            return b.volume;
        }
        let fine = if a.is_wide { b } else { a };
        let distance = fine.at[0].abs();
        b.volume * cap::<D>(self.horizon(false), distance) / cap::<D>(self.horizon(true), distance)
    }

    fn family(&self, i: usize) -> Vec<Bond<D>> {
        let here = self.nodes[i].at;
        let (reach, period) = (self.horizon(true) * (1.0 + TIE), self.meeting.ratio as f64);
        let from = self.nodes.partition_point(|n| n.at[0] < here[0] - reach);
        let images = self.meeting.m as i32 + 1;
        let width = (2 * images + 1) as usize;
        let mut bonds: Vec<(usize, Vector<D>, f64)> = Vec::new();
        for j in from..self.nodes.len() {
            if self.nodes[j].at[0] > here[0] + reach {
                break;
            }
            for image in 0..width.pow(D as u32 - 1) {
                let mut xi = self.nodes[j].at - here;
                let mut rest = image;
                for k in 1..D {
                    xi[k] += f64::from((rest % width) as i32 - images) * period;
                    rest /= width;
                }
                let r = xi.norm();
                let volume = if r > 0.0 { self.counted(i, j, r) } else { 0.0 };
                if volume > 0.0 {
                    bonds.push((j, xi, volume));
                }
            }
        }
        let m: f64 = bonds.iter().map(|(_, xi, v)| xi.norm() * v).sum();
        let (d, mu) = (D as f64, self.meeting.solid.lame().1);
        bonds
            .into_iter()
            .map(|(end, xi, v)| {
                let omega = v / (xi.norm() * m);
                Bond {
                    end,
                    xi,
                    pair: d * (d + 2.0) * mu * omega / xi.norm_squared(),
                    state: xi * (d * omega),
                }
            })
            .collect()
    }

    fn remainder(&self) -> f64 {
        let (lambda, mu) = self.meeting.solid.lame();
        lambda - mu
    }

    /// Returns the distance from the change within which bonds are examined: families of families.
    fn zone(&self) -> f64 {
        2.0 * self.horizon(true)
    }

    /// Largest force per volume about the change under uniform strains, times the fine spacing; C_1111 is 1.
    pub fn ghost_force(&self) -> f64 {
        let mut largest: f64 = 0.0;
        for k in 0..D {
            for l in k..D {
                let mut g = Tensor::<D>::zeros();
                g[(k, l)] = 0.5;
                g[(l, k)] += 0.5;
                let mut force = vec![Vector::<D>::zeros(); self.nodes.len()];
                for (i, bonds) in self.bonds.iter().enumerate() {
                    let theta: f64 = bonds.iter().map(|b| b.state.dot(&(g * b.xi))).sum();
                    for b in bonds {
                        let stretch = b.pair * b.xi.dot(&(g * b.xi));
                        let t = (b.xi * stretch + b.state * (self.remainder() * theta))
                            * self.nodes[i].volume;
                        force[i] += t;
                        force[b.end] -= t;
                    }
                }
                for (n, f) in self.nodes.iter().zip(&force) {
                    if n.at[0].abs() <= self.zone() {
                        largest = largest.max(f.norm() / n.volume);
                    }
                }
            }
        }
        largest
    }

    /// Changes bonds and dilatations about the change by as little as balances every node; smallest and largest factor of a bond, none below `least`. None where there is no such change.
    pub fn balance(&mut self, least: f64) -> Option<[f64; 2]> {
        let inside: Vec<usize> = (0..self.nodes.len())
            .filter(|&n| self.nodes[n].at[0].abs() <= self.zone())
            .collect();
        let number: HashMap<usize, usize> =
            inside.iter().enumerate().map(|(c, &n)| (n, c)).collect();
        let range = self.balance_pairs(&inside, &number, least)?;
        if self.remainder() != 0.0 {
            self.balance_states(&inside, &number)?;
        }
        Some(range)
    }

    fn balance_pairs(
        &mut self,
        inside: &[usize],
        number: &HashMap<usize, usize>,
        least: f64,
    ) -> Option<[f64; 2]> {
        // third moments: exponents that add up to 3
        let moments: Vec<[i32; 3]> = (0..=3)
            .flat_map(|a| (0..=3 - a).map(move |b| [a, b, 3 - a - b]))
            .filter(|p| p[D..].iter().all(|&e| e == 0))
            .collect();
        let power =
            |xi: &Vector<D>, p: &[i32; 3]| -> f64 { (0..D).map(|k| xi[k].powi(p[k])).product() };
        // both directions of a bond are one unknown; it is named by its ends and by ξ from the lower one
        let name = |i: usize, b: &Bond<D>| {
            let sign = if (i, b.end) <= (b.end, i) { 1.0 } else { -1.0 };
            let key: Vec<i64> = (0..D)
                .map(|k| (sign * b.xi[k] * 64.0).round() as i64)
                .collect();
            let back: Vec<i64> = key.iter().map(|c| -c).collect();
            // a bond from a node to its own image goes both ways
            let key = if i == b.end { key.max(back) } else { key };
            (i.min(b.end), i.max(b.end), key)
        };
        let mut unknowns: BTreeMap<(usize, usize, Vec<i64>), (Vector<D>, f64)> = BTreeMap::new();
        let mut missing = DVector::zeros(moments.len() * inside.len());
        for (i, bonds) in self.bonds.iter().enumerate() {
            for b in bonds {
                let size = self.nodes[i].volume * b.pair;
                for (node, sign) in [(i, 1.0), (b.end, -1.0)] {
                    if let Some(&c) = number.get(&node) {
                        for (p, moment) in moments.iter().enumerate() {
                            missing[c * moments.len() + p] -=
                                sign * size * power(&b.xi, moment) / self.nodes[node].volume;
                        }
                    }
                }
                if number.contains_key(&i) && number.contains_key(&b.end) {
                    let sign = if i <= b.end { 1.0 } else { -1.0 };
                    unknowns.entry(name(i, b)).or_insert((b.xi * sign, 0.0)).1 += size;
                }
            }
        }
        let mut rows = DMatrix::zeros(missing.len(), unknowns.len());
        let mut shares = Vec::new();
        for (k, ((i, j, _), (xi, size))) in unknowns.iter().enumerate() {
            let share = size * xi.norm().powi(3);
            for (node, sign) in [(*i, 1.0), (*j, -1.0)] {
                for (p, moment) in moments.iter().enumerate() {
                    rows[(number[&node] * moments.len() + p, k)] +=
                        sign * size * power(xi, moment) / share / self.nodes[node].volume;
                }
            }
            shares.push(share);
        }
        let change = least_change(&rows, &shares, &missing, Bound::AtLeast(least)).ok()?;
        let factors: HashMap<(usize, usize, Vec<i64>), f64> = unknowns
            .into_keys()
            .zip(change.iter().map(|c| 1.0 + c))
            .collect();
        for (i, bonds) in self.bonds.iter_mut().enumerate() {
            for b in bonds {
                if let Some(factor) = factors.get(&name(i, b)) {
                    b.pair *= factor;
                }
            }
        }
        Some(
            factors
                .values()
                .fold([f64::INFINITY, 0.0], |r, &f| [r[0].min(f), r[1].max(f)]),
        )
    }

    /// `θ = tr G` everywhere, and no force under a uniform pressure; what a bond hands to a dilatation may have any sign.
    fn balance_states(&mut self, inside: &[usize], number: &HashMap<usize, usize>) -> Option<()> {
        let count = D * D + D;
        let mut missing = DVector::zeros(count * inside.len());
        for c in 0..inside.len() {
            for k in 0..D {
                missing[c * count + k * D + k] = 1.0;
            }
        }
        let mut free: Vec<(usize, usize)> = Vec::new();
        for (i, bonds) in self.bonds.iter().enumerate() {
            for (n, b) in bonds.iter().enumerate() {
                if number.contains_key(&i) && number.contains_key(&b.end) {
                    free.push((i, n));
                }
                for (row, value) in self.of_state(i, b, number, count) {
                    missing[row] -= value;
                }
            }
        }
        let mut rows = DMatrix::zeros(missing.len(), free.len());
        let mut shares = Vec::new();
        for (k, &(i, n)) in free.iter().enumerate() {
            let b = &self.bonds[i][n];
            let share = self.nodes[i].volume * b.state.norm() * b.xi.norm();
            for (row, value) in self.of_state(i, b, number, count) {
                rows[(row, k)] += value / share;
            }
            shares.push(share);
        }
        let change = least_change(&rows, &shares, &missing, Bound::Free).ok()?;
        for (&(i, n), change) in free.iter().zip(change) {
            self.bonds[i][n].state *= 1.0 + change;
        }
        Some(())
    }

    /// Returns the contribution of a bond to the conditions of the dilatations.
    fn of_state(
        &self,
        i: usize,
        b: &Bond<D>,
        number: &HashMap<usize, usize>,
        count: usize,
    ) -> Vec<(usize, f64)> {
        let mut parts = Vec::new();
        if let Some(&c) = number.get(&i) {
            for k in 0..D {
                for l in 0..D {
                    parts.push((c * count + k * D + l, b.state[k] * b.xi[l]));
                }
            }
        }
        for (node, sign) in [(i, 1.0), (b.end, -1.0)] {
            if let Some(&c) = number.get(&node) {
                for k in 0..D {
                    let force = sign * self.nodes[i].volume * b.state[k] / self.nodes[node].volume;
                    parts.push((c * count + D * D + k, force));
                }
            }
        }
        parts
    }

    /// The stiffness, row by row.
    fn rows(&self) -> Vec<Vec<(usize, Tensor<D>)>> {
        let mut rows: Vec<BTreeMap<usize, Tensor<D>>> = vec![BTreeMap::new(); self.nodes.len()];
        let mut add = |a: usize, b: usize, k: Tensor<D>| {
            *rows[a].entry(b).or_insert_with(Tensor::zeros) += k;
        };
        for (i, bonds) in self.bonds.iter().enumerate() {
            let volume = self.nodes[i].volume;
            let mut theta: BTreeMap<usize, Vector<D>> = BTreeMap::new();
            for b in bonds {
                *theta.entry(b.end).or_insert_with(Vector::zeros) += b.state;
                *theta.entry(i).or_insert_with(Vector::zeros) -= b.state;
                let k = b.xi * b.xi.transpose() * (b.pair * volume);
                add(i, i, k);
                add(b.end, b.end, k);
                add(i, b.end, -k);
                add(b.end, i, -k);
            }
            let factor = self.remainder() * volume;
            if factor != 0.0 {
                for (&a, ga) in &theta {
                    for (&b, gb) in &theta {
                        add(a, b, ga * gb.transpose() * factor);
                    }
                }
            }
        }
        rows.into_iter().map(|r| r.into_iter().collect()).collect()
    }

    /// Largest difference between what two nodes owe each other, over the largest stiffness.
    pub fn asymmetry(&self) -> f64 {
        let rows = self.rows();
        let (mut differ, mut largest) = (0.0f64, 0.0f64);
        for (i, row) in rows.iter().enumerate() {
            for (j, k) in row {
                let back = rows[*j].iter().find(|e| e.0 == i);
                let back = back.map_or_else(Tensor::zeros, |e| e.1.transpose());
                differ = differ.max((k - back).amax());
                largest = largest.max(k.amax());
            }
        }
        differ / largest
    }

    /// Displacement along `direction` of the coarse nodes right of the change, after a plane pulse `exp(−((x − start)/width)²)` of that direction has gone left for a time.
    fn after(&self, direction: usize, start: f64, width: f64, time: f64) -> Vec<f64> {
        let rows = self.rows();
        let (lambda, mu) = self.meeting.solid.lame();
        let speed = if direction == 0 {
            (lambda + 2.0 * mu).sqrt()
        } else {
            mu.sqrt()
        };
        let n = self.nodes.len();
        let mut u = vec![Vector::<D>::zeros(); n];
        let mut v = u.clone();
        for (i, node) in self.nodes.iter().enumerate() {
            let x = (node.at[0] - start) / width;
            u[i][direction] = (-x * x).exp();
            v[i][direction] = -2.0 * x / width * u[i][direction] * speed;
        }
        let step = 0.4;
        let kick = |u: &[Vector<D>], v: &mut [Vector<D>], part: f64| {
            for i in 0..n {
                let mut force = Vector::<D>::zeros();
                for (j, k) in &rows[i] {
                    force -= k * u[*j];
                }
                v[i] += force * (part * step / self.nodes[i].volume);
            }
        };
        kick(&u, &mut v, 0.5);
        for _ in 0..(time / speed / step).round() as usize {
            for i in 0..n {
                u[i] += v[i] * step;
            }
            kick(&u, &mut v, 1.0);
        }
        let right = self.nodes.iter().zip(&u).filter(|(n, _)| n.at[0] > 0.0);
        right.map(|(_, u)| u[direction]).collect()
    }

    /// The largest displacement that the change sends back of a plane pulse from the coarse side, two horizons wide: of pressure, then of shear (0 in one dimension).
    pub fn reflected(&self) -> [f64; 2] {
        let columns = self.nodes.iter().filter(|n| n.at[0] > 0.0).count();
        let half = (columns * self.meeting.ratio) as f64;
        let width = 2.0 * self.horizon(true);
        let pure = Self::coarse(self.meeting, columns);
        [0, 1].map(|direction| {
            if direction >= D {
                return 0.0;
            }
            let ours = self.after(direction, 0.5 * half, width, half);
            let alone = pure.after(direction, 0.5 * half, width, half);
            let margin = (3.0 * width / self.meeting.ratio as f64) as usize;
            let window = margin..columns - margin;
            window
                .map(|k| (ours[k] - alone[k]).abs())
                .fold(0.0, f64::max)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meeting(ratio: usize, families: Families) -> Meeting {
        Meeting {
            ratio,
            m: 2,
            families,
            solid: Solid::StateBased,
        }
    }

    #[test]
    fn caps_are_halves_at_the_middle_and_nothing_at_the_rim() {
        let pi = std::f64::consts::PI;
        assert!((cap::<2>(2.0, 0.0) - 2.0 * pi).abs() < 1e-14);
        assert!((cap::<3>(2.0, 0.0) - 16.0 / 3.0 * pi).abs() < 1e-13);
        assert_eq!(cap::<2>(2.0, 2.0), 0.0);
        // by slices
        let sum: f64 = (0..2000)
            .map(|k| 0.7 + (k as f64 + 0.5) * 1.3 / 2000.0)
            .map(|x| pi * (4.0 - x * x) * 1.3 / 2000.0)
            .sum();
        assert!((cap::<3>(2.0, 0.7) - sum).abs() < 1e-5);
    }

    #[test]
    fn one_lattice_is_balanced_and_two_can_be() {
        for families in [Families::DualHorizon, Families::MultiHorizon] {
            // a ratio of 1 has a change of nothing
            let same = Strip::<2>::new(meeting(1, Families::DualHorizon), 12);
            assert!(same.ghost_force() < 1e-13);
            let mut strip = Strip::<2>::new(meeting(2, families), 12);
            assert!(strip.ghost_force() > 0.02, "{}", strip.ghost_force());
            let [least, _] = strip.balance(0.05).unwrap();
            assert!(least > 0.049);
            assert!(strip.ghost_force() < 1e-11, "{:e}", strip.ghost_force());
            assert!(strip.asymmetry() < 1e-13);
        }
    }

    #[test]
    fn nothing_comes_back_from_no_change() {
        let strip = Strip::<2>::coarse(meeting(2, Families::DualHorizon), 40);
        assert_eq!(strip.reflected(), [0.0; 2]);
    }
}
