//! Bonds past the onset of softening, which the bits of a fast pass no longer hold: one by one, since they are those of a process zone.
//!
//! With `κ` the largest stretch so far, a bond keeps the part `g(κ)/κ` of its force and of the extension that enters the dilatation of its ends, by the [`Envelope`] of a line from
//! the stretch `s_e` to `s_c = r s_e`; the ratio r is that of the material. Under compression its pair force keeps all, until it breaks at `κ = s_c`. So both follow from one energy per point,
//!
//! ```text
//! W = ½ K′ θ² + ½ α Σ h ω e² V′ ,    θ = D/m Σ (1 − φ) ω |ξ| e V′ ,    φ = 1 − g(κ)/κ ,    h = 1 − φ where e > 0, else 1 ,
//! ```
//!
//! which no change of the sign of e makes jump,
//!
//! and a bond dissipates `½ s_e s_c` of its stiffness on the way, as a brittle one does at `s_0 = √(s_e s_c)`.

use crate::material::Envelope;
use crate::system::BondChanges;

/// Softening of bonds between the onset and the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BondSoftening {
    /// `s_c/s_e`, above 1.
    pub ratio: f64,
    /// Growth of the largest stretch below which it stays, in parts of `s_c − s_e`: 0 in time; in load steps, whose equilibria are sought with bonds held, what they may be off.
    pub tolerance: f64,
}

impl BondSoftening {
    /// The stretch `s_e` at which a bond begins to soften that would break at `brittle` for the same energy.
    pub fn onset(&self, brittle: f64) -> f64 {
        brittle / self.ratio.sqrt()
    }

    /// The stretch beyond which a pass hands a bond over.
    pub(crate) fn limit(&self, brittle: f64) -> f64 {
        self.onset(brittle) * (1.0 + self.slack())
    }

    /// The stretches `s_e` and `s_c` of a bond that is handed over beyond `limit`.
    pub(crate) fn ends_of(&self, limit: f64) -> [f64; 2] {
        let onset = limit / (1.0 + self.slack());
        [onset, onset * self.ratio]
    }

    /// Growth of the largest stretch that is let pass, over `s_e`.
    fn slack(&self) -> f64 {
        self.tolerance * (self.ratio - 1.0)
    }
}

/// A directed bond past the onset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SoftenedBond {
    /// Point whose force it is part of.
    pub near: u32,
    /// Its other end.
    pub far: u32,
    /// Its number in the pass.
    pub slot: u64,
    /// s_e.
    pub onset: f64,
    /// s_c.
    end: f64,
    /// κ.
    largest: f64,
    /// True if it was compressed when bonds could change last.
    is_closed: bool,
}

impl SoftenedBond {
    /// One that softens from the first of two stretches to the second.
    pub fn new([near, far]: [u32; 2], slot: u64, [onset, end]: [f64; 2]) -> Self {
        Self {
            near,
            far,
            slot,
            onset,
            end,
            largest: onset,
            is_closed: false,
        }
    }

    fn key(&self) -> (u32, u64) {
        (self.near, self.slot)
    }
}

/// Loss of a bond in the last pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Loss {
    /// The bond, as it was.
    pub bond: SoftenedBond,
    /// Part of its stiffness that it lost.
    pub part: f64,
    /// True if it broke.
    pub is_broken: bool,
}

/// All bonds of a pass past the onset, ascending by point and number.
#[derive(Clone, Debug)]
pub(crate) struct SoftenedBonds {
    law: BondSoftening,
    bonds: Vec<SoftenedBond>,
    /// Those that the last pass took stiffness from, in the same order.
    pub losses: Vec<Loss>,
}

impl SoftenedBonds {
    /// None yet.
    pub fn new(law: BondSoftening) -> Self {
        Self {
            law,
            bonds: Vec::new(),
            losses: Vec::new(),
        }
    }

    /// Law of their softening.
    pub fn law(&self) -> BondSoftening {
        self.law
    }

    /// Those that have not broken.
    pub fn bonds(&self) -> &[SoftenedBond] {
        &self.bonds
    }

    /// Those of a point.
    pub fn of(&self, point: usize) -> &[SoftenedBond] {
        let from = self.bonds.partition_point(|b| (b.near as usize) < point);
        let all = &self.bonds[from..];
        &all[..all.partition_point(|b| b.near as usize == point)]
    }

    /// A bond, if it is among them.
    pub fn find(&self, near: usize, slot: u64) -> Option<&SoftenedBond> {
        let key = (near as u32, slot);
        let found = self.bonds.binary_search_by_key(&key, |b| b.key());
        found.ok().map(|k| &self.bonds[k])
    }

    fn envelope(bond: &SoftenedBond) -> Envelope {
        Envelope::linear(bond.onset, bond.end / bond.onset - 1.0)
    }

    /// Parts of its stiffness that a bond has: of its pair force, h, and of the dilatation, `1 − φ`.
    pub fn left(bond: &SoftenedBond) -> [f64; 2] {
        let open = Self::left_in_tension(bond);
        [if bond.is_closed { 1.0 } else { open }, open]
    }

    /// Part of its stiffness that a bond has under tension, `1 − φ`.
    pub fn left_in_tension(bond: &SoftenedBond) -> f64 {
        1.0 - Self::envelope(bond).damage(bond.largest)
    }

    /// Takes bonds that a pass has handed over, and follows the stretches of all.
    pub fn advance(
        &mut self,
        new: impl Iterator<Item = SoftenedBond>,
        stretch: impl Fn(&SoftenedBond) -> f64,
    ) -> BondChanges {
        let before = self.bonds.len();
        self.bonds.extend(new);
        if self.bonds.len() > before {
            self.bonds.sort_unstable_by_key(SoftenedBond::key);
        }
        self.losses.clear();
        let mut changes = BondChanges::default();
        let mut bonds = std::mem::take(&mut self.bonds);
        bonds.retain_mut(|bond| {
            let s = stretch(bond);
            let slack = self.law.tolerance * (bond.end - bond.onset);
            if (s < 0.0) != bond.is_closed && s.abs() > slack {
                bond.is_closed = s < 0.0;
                // in time a bond closes where it carries nothing
                changes.softened += u64::from(slack > 0.0);
            }
            // one that has just come has nothing of what it may lose yet
            if s <= bond.largest + slack && s < bond.end {
                return true;
            }
            let was = *bond;
            let before = Self::left_in_tension(bond);
            bond.largest = s;
            let is_broken = s >= bond.end;
            let part = match is_broken {
                true => before,
                false => before - Self::left_in_tension(bond),
            };
            changes.broken += u64::from(is_broken);
            changes.softened += u64::from(!is_broken);
            self.losses.push(Loss {
                bond: was,
                part,
                is_broken,
            });
            !is_broken
        });
        self.bonds = bonds;
        changes
    }

    /// Lets all of them be as they are.
    pub fn hold(&mut self) -> BondChanges {
        self.losses.clear();
        BondChanges::default()
    }

    /// Bonds that the last pass broke.
    pub fn last_broken(&self) -> Vec<(u32, u32)> {
        let broken = self.losses.iter().filter(|loss| loss.is_broken);
        broken.map(|l| (l.bond.near, l.bond.far)).collect()
    }

    /// Bytes that they take.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.bonds[..]) + size_of_val(&self.losses[..])
    }

    /// Words for a checkpoint, their number last.
    pub fn state(&self) -> Vec<u64> {
        let mut words = Vec::with_capacity(WORDS * self.bonds.len() + 1);
        for bond in &self.bonds {
            words.extend([
                u64::from(bond.near) | u64::from(bond.far) << 32,
                bond.slot << 1 | u64::from(bond.is_closed),
                bond.onset.to_bits(),
                bond.end.to_bits(),
                bond.largest.to_bits(),
            ]);
        }
        words.push(self.bonds.len() as u64);
        words
    }

    /// Splits the words of [`SoftenedBonds::state`] off the end of others; none of a pass whose bonds break at once.
    pub fn split<'w>(softened: Option<&Self>, state: &'w [u64]) -> Option<(&'w [u64], &'w [u64])> {
        if softened.is_none() {
            return Some((state, &[]));
        }
        let (&count, rest) = state.split_last()?;
        let words = usize::try_from(count).ok()?.checked_mul(WORDS)?;
        Some(rest.split_at(rest.len().checked_sub(words)?))
    }

    /// Puts back what [`SoftenedBonds::split`] has split off.
    pub fn restore(&mut self, of_bonds: &[u64]) {
        let bond = |words: &[u64]| SoftenedBond {
            near: words[0] as u32,
            far: (words[0] >> 32) as u32,
            slot: words[1] >> 1,
            onset: f64::from_bits(words[2]),
            end: f64::from_bits(words[3]),
            largest: f64::from_bits(words[4]),
            is_closed: words[1] & 1 == 1,
        };
        self.bonds = of_bonds.chunks_exact(WORDS).map(bond).collect();
        self.losses.clear();
    }
}

/// Words of a bond in a checkpoint.
const WORDS: usize = 5;
