//! Springs between nearest neighbours of a lattice, which stand in for long rows where a solver is preconditioned.
//!
//! Rows of a lattice share their blocks, and take four bytes for each bond. A solver that wants its own copy of a matrix takes 72 and more in 3D. A preconditioner has to move like the
//! stiffness only where fields change slowly: springs to the 3^D − 1 neighbours around each site do, once they hold the same energy in uniform strains, on average over these. Their matrix
//! is symmetric and not negative, and keeps rigid motions, whatever the signs in the rows of a state-based law.

use super::{BlockCsr, RankRows, Ranks, Spread, Symmetry};

/// Neighbours lie within so many spacings: the diagonal of a cube.
const NEAR: f64 = 1.8;

/// The nearest neighbours of all sites are as far away as each other to this part.
const ALIKE: f64 = 1e-3;

/// Rows of so many times the blocks of the springs are long.
const LONG: usize = 2;

/// Blocks that rows share this many times are worth sharing.
const SHARED: f64 = 4.0;

/// Returns true if so many rows with so many blocks in them, of which so many are distinct, are long and share their blocks.
pub(crate) fn share_long_rows(dimension: usize, [rows, blocks, distinct]: [f64; 3]) -> bool {
    let neighbours = 3usize.pow(dimension as u32);
    blocks >= (LONG * neighbours) as f64 * rows && blocks >= SHARED * distinct
}

impl RankRows<'_> {
    /// Collective: the rows of the own sites in the matrix of springs, if rows are symmetric, long, share their blocks, and sites lie as those of one lattice do.
    pub fn neighbour_springs(&self, ranks: &dyn Ranks) -> Option<BlockCsr> {
        let spread = Spread {
            ranks,
            partition: self.partition,
        };
        let (matrix, d) = (self.matrix, self.matrix.block);
        let sum = |n: usize| spread.sum(n as f64);
        let [rows, blocks] = [sum(matrix.rows()), sum(matrix.columns.len())];
        let distinct = sum(matrix.values.len()) / (d * d) as f64;
        if self.symmetry != Symmetry::Symmetric || !share_long_rows(d, [rows, blocks, distinct]) {
            return None;
        }
        let own = spread.own();
        let nearest = (0..own.len()).map(|r| self.nearest(r, own[r]));
        let (low, high) = nearest.fold((f64::INFINITY, 0.0f64), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        let (low, high) = (-spread.largest(-low), spread.largest(high));
        let is_lattice = high.is_finite() && high <= (1.0 + ALIKE) * low;
        if !is_lattice {
            return None;
        }
        let stiffness: Vec<f64> = (0..own.len())
            .map(|r| self.stiffness(r, own[r], NEAR * low))
            .collect();
        let is_right = stiffness.iter().all(|k| k.is_finite() && *k > 0.0);
        if !spread.all(is_right) {
            return None;
        }
        let mut all = vec![0.0; self.partition.sites()];
        spread.gather_sites(&stiffness, &mut all);
        Some(self.springs(own, &all, NEAR * low))
    }

    /// From one site to another \[m\].
    fn between(&self, from: u32, to: u32) -> [f64; 3] {
        let (a, b) = (&self.positions[from as usize], &self.positions[to as usize]);
        std::array::from_fn(|k| b[k] - a[k])
    }

    /// Distance of the nearest other site in a row \[m\].
    fn nearest(&self, row: usize, site: u32) -> f64 {
        let others = self.matrix.row(row).0.iter().filter(|c| **c != site);
        let distances = others.map(|&c| square(&self.between(site, c)));
        distances.fold(f64::INFINITY, f64::min).sqrt()
    }

    /// Energy of a row in uniform strains for each spring: of all displacement gradients of one entry, −Σ tr K |ξ|², over as many as there are near sites.
    fn stiffness(&self, row: usize, site: u32, near: f64) -> f64 {
        let (columns, blocks) = self.matrix.row(row);
        let d = self.matrix.block;
        let (mut energy, mut count) = (0.0, 0);
        for (&c, block) in columns.iter().zip(blocks.chunks_exact(d * d)) {
            let length = square(&self.between(site, c));
            let trace: f64 = (0..d).map(|a| block[a * d + a]).sum();
            energy -= trace * length;
            count += usize::from(c != site && length <= near * near);
        }
        energy / f64::from(count.max(1) as u32)
    }

    /// Rows of springs k n ⊗ n between sites that are near and in each other's rows; `stiffness` is k |ξ|² of each site.
    fn springs(&self, own: &[u32], stiffness: &[f64], near: f64) -> BlockCsr {
        let d = self.matrix.block;
        let mut springs = BlockCsr {
            block: d,
            row_offsets: vec![0],
            ..BlockCsr::default()
        };
        for (r, &site) in own.iter().enumerate() {
            let columns = self.matrix.row(r).0.iter().copied();
            let is_near = |c: &u32| *c == site || square(&self.between(site, *c)) <= near * near;
            let first = springs.values.len();
            let mut diagonal = (0, vec![0.0; d * d]);
            for c in columns.filter(is_near) {
                springs.columns.push(c);
                if c == site {
                    diagonal.0 = springs.values.len();
                    springs.values.resize(springs.values.len() + d * d, 0.0);
                    continue;
                }
                let bond = self.between(site, c);
                let mean = 0.5 * (stiffness[site as usize] + stiffness[c as usize]);
                let k = mean / square(&bond).powi(2);
                for (e, sum) in diagonal.1.iter_mut().enumerate() {
                    let entry = k * bond[e / d] * bond[e % d];
                    springs.values.push(-entry);
                    *sum += entry;
                }
            }
            debug_assert!(springs.values.len() > first, "a row with its own site");
            springs.values[diagonal.0..][..d * d].copy_from_slice(&diagonal.1);
            springs.row_offsets.push(springs.columns.len());
        }
        springs
    }
}

fn square(x: &[f64; 3]) -> f64 {
    x.iter().map(|x| x * x).sum()
}
