//! Sums of a step over the sites of a motion.

use super::Energies;
use crate::system::ExactSum;

/// Partial sums of one chunk.
#[derive(Clone, Debug, Default)]
pub(super) struct Sums {
    /// `Σ m v²` after the step.
    pub kinetic: f64,
    /// `Σ m v²` before the last half kick.
    pub kinetic_half: f64,
    /// `Σ u_n F_{n+1}`.
    pub pair: f64,
    pub power: Power,
}

/// Power of external forces.
#[derive(Clone, Debug, Default)]
pub(super) struct Power {
    /// `Σ f v`.
    pub sum: ExactSum,
    /// `Σ |f v|`.
    pub absolute: ExactSum,
    /// True if a load does work here: most chunks have none.
    is_there: bool,
}

impl Power {
    pub fn clear(&mut self) {
        if self.is_there {
            *self = Self::default();
        }
    }

    /// That of sites with `d` numbers each.
    pub fn add(&mut self, d: usize, force: &[f64], v: &[f64]) {
        // all bits but those of signs: one pass, where a loop that may end early is not made of vectors
        let all = force.iter().fold(0, |all, f| all | f.to_bits() << 1);
        if all != 0 {
            let sites = force.chunks_exact(d).zip(v.chunks_exact(d));
            sites.for_each(|(force, v)| self.add_site(force, v));
        }
    }

    fn add_site(&mut self, force: &[f64], v: &[f64]) {
        if force.iter().all(|f| *f == 0.0) {
            return;
        }
        let (mut sum, mut absolute) = (0.0, 0.0);
        for (f, v) in force.iter().zip(v) {
            sum += f * v;
            absolute += (f * v).abs();
        }
        self.sum.add(sum);
        self.absolute.add(absolute);
        self.is_there = true;
    }

    fn merge(&mut self, chunk: &Self) {
        if chunk.is_there {
            self.sum.merge(&chunk.sum);
            self.absolute.merge(&chunk.absolute);
            self.is_there = true;
        }
    }
}

/// Adds the chunks in their order.
pub(super) fn total(sums: &[Sums]) -> Sums {
    let mut all = Sums::default();
    for chunk in sums {
        all.kinetic += chunk.kinetic;
        all.kinetic_half += chunk.kinetic_half;
        all.pair += chunk.pair;
        all.power.merge(&chunk.power);
    }
    all
}

impl Energies {
    /// By the sums of a step.
    pub(super) fn of(sums: &Sums, work: f64, work_half: f64) -> Self {
        Self {
            kinetic: 0.5 * sums.kinetic,
            kinetic_half: 0.5 * sums.kinetic_half,
            discrete: 0.5 * (sums.kinetic_half + sums.pair),
            work,
            work_half,
        }
    }
}
