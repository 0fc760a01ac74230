//! Passes whose points are shared out among several: each computes the forces of its own points, and reports to the others which bonds it broke.
//!
//! The sums of a point are the same whoever computes them. A state-based law takes the dilatations of the neighbours of own points too, and bonds of these break
//! here as they do where they are owned, since both ends and all who look at a bond see the same numbers.

use super::bond_list::List;
use super::lattice::{COPY, Lattice, OwnReach};
use super::lattice_simd::{Broken, EARLY, FOREIGN, FULL, IDLE, LATE};
use super::simd::LANES;
use super::stencil::NONE;
use super::{BondPass, OwnPoints, Reach, Told};
use crate::system::{FailureUpdate, Interval, Segments};

/// Quantities that a list pass computes of a point.
pub(super) mod part {
    /// Its dilatation, and which of its bonds break.
    pub const SEEN: u8 = 1;
    /// Its force too.
    pub const OWN: u8 = 2;
}

impl<const D: usize> Lattice<D> {
    /// Own lanes of each group; of a state-based law also those of neighbours, whose dilatations own forces take.
    fn lanes_seen(&self) -> Vec<u8> {
        let mut seen = self.own.clone();
        let Some(solid) = &self.solid else {
            return seen;
        };
        for (g, &own) in self.own.iter().enumerate() {
            for lane in (0..LANES).filter(|lane| own >> lane & 1 == 1) {
                self.each(&self.stencil.reference, g, lane, |_, there| {
                    let group = solid.group_of[there / LANES];
                    if group != NONE {
                        seen[group as usize] |= 1 << (there % LANES);
                    }
                });
            }
        }
        seen
    }

    /// Restores the bonds that unknown displacements broke, and lists breaks of own points only, where processes move their own points.
    pub(super) fn forget_breaks_of_others(&mut self) {
        let Some(reach) = &self.reach else {
            return;
        };
        let stencil = self.stencil.offsets.len();
        let mut has_broken = false;
        for b in &mut self.broken {
            let (group, offset) = (b.group as usize, b.offset as usize);
            self.stencil.intact[group * stencil + offset] |= b.lanes & !reach.seen[group];
            has_broken |= b.lanes & reach.seen[group] != 0;
            b.lanes &= self.own[group];
        }
        self.broken.retain(|b| b.lanes != 0);
        self.has_seen_breaks = has_broken;
    }
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

    fn reach_only(&mut self, reach: &Reach<'_>) {
        self.compute_only(reach.own);
        let mut seen = self.lanes_seen();
        for place in reach.followed.iter().map(|&p| self.place[p as usize]) {
            if place != NONE {
                let group = place as usize / LANES;
                seen[group] |= 1 << (place as usize % LANES);
                self.flags[group] &= !IDLE;
            }
        }
        let mut is_early = vec![false; self.flags.len()];
        for &p in reach.sent {
            let place = self.place[p as usize];
            if place != NONE {
                is_early[place as usize / LANES] = true;
            }
        }
        for (flags, is_early) in self.flags.iter_mut().zip(is_early) {
            *flags &= !(EARLY | LATE);
            *flags |= if is_early { EARLY } else { LATE };
        }
        let point_of = self.stencil.point_of.iter();
        let cells: Vec<bool> = point_of
            .map(|&p| p != NONE && reach.known[p as usize])
            .collect();
        self.reach = Some(OwnReach {
            own: Segments::of(reach.own, COPY),
            cells: Segments::of(&cells, COPY),
            seen,
            sent: reach.sent.to_vec(),
        });
    }

    fn own_force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        breakage: FailureUpdate,
        told: Told<'_>,
    ) -> u64 {
        self.pass_at_own(u, force, breakage, told)
    }

    fn has_seen_breaks(&self) -> bool {
        self.has_seen_breaks
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

    fn reach_only(&mut self, reach: &Reach<'_>) {
        self.compute_only(reach.own);
        for &p in reach.followed {
            let part = &mut self.parts[p as usize];
            *part = (*part).max(part::SEEN);
        }
    }

    fn own_force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        breakage: FailureUpdate,
        told: Told<'_>,
    ) -> u64 {
        // points whose bonds are looked at see known displacements only
        self.force_into(u, force, Interval::AT_ONCE, breakage);
        let parts = &self.parts;
        self.has_seen_breaks = !self.last.is_empty();
        self.last.retain(|(i, _)| parts[*i as usize] == part::OWN);
        told(force);
        self.last.len() as u64
    }

    fn has_seen_breaks(&self) -> bool {
        self.has_seen_breaks
    }
}
