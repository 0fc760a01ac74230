//! Passes whose points are shared out among several: each computes the forces of its own points, and tells the others which bonds it broke.
//!
//! The sums of a point are the same whoever computes them. A state-based law takes the dilatations of the neighbours of own points too, and bonds of these break
//! here as they do where they are owned, since both ends and all who look at a bond see the same numbers.

use super::OwnPoints;
use super::bond_list::List;
use super::lattice::Lattice;
use super::lattice_simd::{Broken, FOREIGN, FULL, IDLE};
use super::simd::LANES;
use super::stencil::NONE;

/// What a list pass computes of a point.
pub(super) mod part {
    /// Its dilatation, and which of its bonds break.
    pub const SEEN: u8 = 1;
    /// Its force too.
    pub const OWN: u8 = 2;
}

impl<const D: usize> OwnPoints for Lattice<D> {
    fn compute_only(&mut self, own: &[bool]) {
        let groups = &self.stencil.groups;
        let mut lanes = vec![0u8; groups.len()];
        for (&place, _) in self
            .place
            .iter()
            .zip(own)
            .filter(|(p, own)| **own && **p != NONE)
        {
            lanes[place as usize / LANES] |= 1 << (place as usize % LANES);
        }
        let mut is_seen: Vec<bool> = lanes.iter().map(|lanes| *lanes != 0).collect();
        if let Some(solid) = &self.solid {
            for (&cell, _) in groups.iter().zip(&lanes).filter(|(_, lanes)| **lanes != 0) {
                // eight cells along an offset lie in two groups at most
                for o in &self.stencil.offsets {
                    for end in [0, LANES - 1] {
                        let there = (cell as usize + end) as isize + o.delta;
                        let group = solid.group_of[there as usize / LANES];
                        if group != NONE {
                            is_seen[group as usize] = true;
                        }
                    }
                }
            }
        }
        for ((flags, lanes), is_seen) in self.flags.iter_mut().zip(&lanes).zip(is_seen) {
            *flags &= !(IDLE | FOREIGN);
            *flags |= if is_seen { 0 } else { IDLE };
            *flags |= if *lanes == 0 { FOREIGN } else { 0 };
        }
        self.own = lanes;
    }

    fn broken_at_own(&self) -> Vec<u64> {
        let own = |b: &Broken| b.lanes & self.own.get(b.group as usize).copied().unwrap_or(u8::MAX);
        let word =
            |b: &Broken| u64::from(b.group) << 32 | u64::from(b.offset) << 8 | u64::from(own(b));
        let broken = self.broken.iter().filter(|b| own(b) != 0);
        broken.map(word).collect()
    }

    fn take_broken(&mut self, words: &[u64]) -> u64 {
        let stencil = self.stencil.offsets.len();
        let mut broken: Vec<Broken> = words
            .iter()
            .map(|word| Broken {
                group: (word >> 32) as u32,
                offset: (word >> 8) as u32 & 0xFF_FFFF,
                lanes: *word as u8,
            })
            .collect();
        broken.sort_unstable_by_key(|b| (b.group, b.offset, b.lanes));
        for b in &broken {
            self.stencil.intact[b.group as usize * stencil + b.offset as usize] &= !b.lanes;
            self.flags[b.group as usize] &= !FULL;
        }
        self.broken = broken;
        let lanes = self.broken.iter().map(|b| u64::from(b.lanes.count_ones()));
        lanes.sum()
    }
}

impl<const D: usize> OwnPoints for List<D> {
    fn compute_only(&mut self, own: &[bool]) {
        let mut parts: Vec<u8> = vec![0; own.len()];
        for (i, _) in own.iter().enumerate().filter(|(_, own)| **own) {
            parts[i] = part::OWN;
            if self.solid.is_some() {
                for bond in self.offsets[i]..self.offsets[i + 1] {
                    let neighbour = &mut parts[self.neighbours.get(i, bond)];
                    *neighbour = (*neighbour).max(part::SEEN);
                }
            }
        }
        self.parts = parts;
    }

    fn broken_at_own(&self) -> Vec<u64> {
        let own = |i: u32| self.parts.get(i as usize).is_none_or(|p| *p == part::OWN);
        let last = self.last.iter().filter(|(i, _)| own(*i));
        last.map(|&(i, bond)| u64::from(i) << 32 | (bond - self.offsets[i as usize]) as u64)
            .collect()
    }

    fn take_broken(&mut self, words: &[u64]) -> u64 {
        let mut sorted = words.to_vec();
        sorted.sort_unstable();
        self.last.clear();
        for word in sorted {
            let (i, k) = ((word >> 32) as usize, word as u32 as usize);
            self.intact[self.bytes[i] + k / 8] &= !(1 << (k % 8));
            self.last.push((i as u32, self.offsets[i] + k));
        }
        self.last.len() as u64
    }
}
