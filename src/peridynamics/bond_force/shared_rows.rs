//! Families that are spread over processes: the data of all of them that a pass needs, and the families of all where a pass needs these.
//!
//! A lattice asks for numbers of its offsets and for the bits of all bonds, a quarter of a byte for each. Lists hold the bonds of all points.

use super::force_problem::{
    BondCriterion, BondForce, BondFunction, BondSetup, DistributedRows, Failure,
};
use crate::peridynamics::{Families, offset_table::OffsetTable};
use crate::system::all_say;
use crate::tensor::Vector;

/// Weight and limit of the bonds of an offset, and the bond that they are from.
pub(super) type Known = ((f64, f64), usize, u32);

impl<const D: usize> BondSetup<'_, D> {
    /// Bonds of a point, whoever holds its family.
    pub(super) fn family_size(&self, i: usize) -> usize {
        match self.shared {
            Some(shared) => shared.sizes[i] as usize,
            None => self.families.of(i).len(),
        }
    }

    /// Returns true if a point has a family, whoever holds it.
    pub(super) fn has_family(&self, i: usize) -> bool {
        self.family_size(i) > 0
    }

    /// Returns true if a condition holds on all processes; `here` where there are no others.
    pub(super) fn holds_on_all(&self, here: bool) -> bool {
        self.shared
            .map_or(here, |shared| all_say(shared.ranks, here))
    }

    /// The family of a point, whoever holds it.
    pub(super) fn family_of_any(&self, i: usize) -> Vec<u32> {
        let held = self.families.of(i);
        let Some(shared) = self.shared else {
            return held.to_vec();
        };
        let words = match shared.own[i] {
            true => held.iter().map(|&j| u64::from(j)).collect(),
            false => Vec::new(),
        };
        let all = shared.ranks.gather_words(&words).concat();
        all.into_iter().map(|j| j as u32).collect()
    }
}

impl DistributedRows<'_> {
    /// Merges the numbers of all processes for the bonds of each offset; none where one of them has found no lattice. Of several bonds that of the first point counts, as in one process.
    pub(super) fn merged<const D: usize>(
        &self,
        found: Option<&OffsetTable<Known, D>>,
    ) -> Option<OffsetTable<Known, D>> {
        let mut words = Vec::new();
        if let Some(found) = found {
            words.push(1);
            for (steps, ((weight, limit), i, j)) in found.known() {
                words.extend(steps.map(|s| u64::from(s as u32)));
                words.extend([weight.to_bits(), limit.to_bits(), i as u64, u64::from(j)]);
            }
        }
        let parts = self.ranks.gather_words(&words);
        let mut known: Vec<([i32; D], Known)> = Vec::new();
        for part in &parts {
            for entry in part.get(1..)?.chunks_exact(D + 4) {
                let steps = std::array::from_fn(|a| entry[a] as u32 as i32);
                let numbers = (f64::from_bits(entry[D]), f64::from_bits(entry[D + 1]));
                known.push((steps, (numbers, entry[D + 2] as usize, entry[D + 3] as u32)));
            }
        }
        // the last entry of an offset stays
        known.sort_unstable_by_key(|(_, (_, i, _))| std::cmp::Reverse(*i));
        Some(OffsetTable::new(&known))
    }

    /// Collective: gives a word of each bond of all points to `put`, with the place of the bond among all, which begin at `offsets`; of own points, `word` makes it of a point and the place in its family.
    fn each_bond(
        &self,
        offsets: &[usize],
        word: impl Fn(usize, usize) -> u64,
        mut put: impl FnMut(usize, u64),
    ) {
        /// Points whose bonds are exchanged at a time.
        const AT_A_TIME: usize = 1 << 14;
        let points = self.own.len();
        for first in (0..points).step_by(AT_A_TIME) {
            let mut words = Vec::new();
            let some = first..(first + AT_A_TIME).min(points);
            for i in some.filter(|&i| self.own[i]) {
                words.push(i as u64);
                words.extend((0..self.sizes[i] as usize).map(|k| word(i, k)));
            }
            for told in self.ranks.gather_words(&words) {
                let mut rest = told.as_slice();
                while let Some((&i, tail)) = rest.split_first() {
                    let (start, end) = (offsets[i as usize], offsets[i as usize + 1]);
                    let (bonds, tail) = tail.split_at(end - start);
                    (start..end)
                        .zip(bonds)
                        .for_each(|(place, &word)| put(place, word));
                    rest = tail;
                }
            }
        }
    }

    /// Collective: sets in `bits`, `width` bytes for each group, what other processes have set in groups of which they have points.
    pub(super) fn merge_bits(&self, width: usize, is_own: impl Fn(usize) -> bool, bits: &mut [u8]) {
        /// Bytes of bits that are exchanged at a time.
        const AT_A_TIME: usize = 1 << 23;
        let step = (AT_A_TIME / width.max(1)).max(1) * width.max(1);
        for (part, bits) in bits.chunks_mut(step).enumerate() {
            let first = part * step / width.max(1);
            let mut words = Vec::new();
            let groups = bits.chunks_exact(width.max(1)).enumerate();
            for (g, bits) in groups.filter(|(g, _)| is_own(first + g)) {
                words.push(g as u64);
                words.extend(super::pack(bits, 0));
            }
            let length = width.div_ceil(8) + 2;
            for told in self.ranks.gather_words(&words) {
                for told in told.chunks_exact(length) {
                    let own = &mut bits[told[0] as usize * width..][..width];
                    for (bits, word) in own.chunks_mut(8).zip(&told[1..]) {
                        let others = word.to_le_bytes();
                        bits.iter_mut().zip(others).for_each(|(b, o)| *b |= o);
                    }
                }
            }
        }
    }
}

/// The families of all points with the numbers of their bonds, on every process.
struct Whole {
    families: Families,
    /// Coefficient of each bond by the law.
    coefficient: Vec<f64>,
    /// The stretch at which a bond breaks; empty where it is one for all or none.
    stretch: Vec<f64>,
}

impl Whole {
    /// Collective.
    fn of<const D: usize>(setup: &BondSetup<'_, D>, shared: &DistributedRows<'_>) -> Self {
        let mut offsets = vec![0];
        offsets.extend(shared.sizes.iter().scan(0, |end, &n| {
            *end += n as usize;
            Some(*end)
        }));
        let all = offsets[shared.sizes.len()];
        let bond = |i: usize, k: usize| setup.bond(i, setup.families.of(i)[k] as usize);
        let numbers = |f: &BondFunction<'_, D>| {
            let mut numbers = vec![0.0; all];
            shared.each_bond(
                &offsets,
                |i, k| f(i, k, &bond(i, k)).to_bits(),
                |place, word| numbers[place] = f64::from_bits(word),
            );
            numbers
        };
        let coefficient = match setup.force {
            BondForce::Pairwise { coefficient } => numbers(coefficient),
            BondForce::Solid { omega, .. } => numbers(omega),
            BondForce::Law { .. } => Vec::new(),
        };
        let stretch = match setup.failure.map(|f| f.critical) {
            Some(BondCriterion::PerBond(f)) => numbers(f),
            Some(BondCriterion::Uniform(_) | BondCriterion::State(_)) | None => Vec::new(),
        };
        let mut neighbours = vec![0; all];
        shared.each_bond(
            &offsets,
            |i, k| u64::from(setup.families.of(i)[k]),
            |place, word| neighbours[place] = word as u32,
        );
        Self {
            families: Families {
                offsets,
                neighbours,
            },
            coefficient,
            stretch,
        }
    }
}

/// Collective: hands on a setup with the families of all points.
pub(super) fn with_all_families<const D: usize, T>(
    setup: &BondSetup<'_, D>,
    then: impl FnOnce(&BondSetup<'_, D>) -> T,
) -> T {
    let Some(shared) = &setup.shared else {
        return then(setup);
    };
    let whole = Whole::of(setup, shared);
    let offsets = &whole.families.offsets;
    let coefficient = |i: usize, k: usize, _: &Vector<D>| whole.coefficient[offsets[i] + k];
    let stretch = |i: usize, k: usize, _: &Vector<D>| whole.stretch[offsets[i] + k];
    let force = match setup.force {
        BondForce::Pairwise { .. } => BondForce::Pairwise {
            coefficient: &coefficient,
        },
        BondForce::Solid { bulk, shear, .. } => BondForce::Solid {
            omega: &coefficient,
            bulk,
            shear,
        },
        law => law,
    };
    let failure = setup.failure.map(|failure| Failure {
        critical: match failure.critical {
            BondCriterion::PerBond(_) => BondCriterion::PerBond(&stretch),
            BondCriterion::Uniform(s) => BondCriterion::Uniform(s),
            BondCriterion::State(state) => BondCriterion::State(state),
        },
        ..failure
    });
    then(&BondSetup {
        families: &whole.families,
        force,
        failure,
        shared: None,
        ..*setup
    })
}
