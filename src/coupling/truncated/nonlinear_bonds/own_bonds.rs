//! Bonds of a seam whose sites are moved by several processes, each its own: which of them a process computes, and what it has to know for these.
//!
//! The force on a site takes the parts that end there and the dilatations to which these hand their elongation, hence all parts of such a dilatation. A bond of which a part is known breaks wherever it is, by the same
//! numbers; its cost is counted by the process of its first end that is a site, that of a dilatation by the process of its point, or of the first node of its element.

use rustc_hash::FxHashMap;

use super::{NonlinearSeam, counted_bonds::OwnBonds};
use crate::system::ExactSum;

/// Contribution of the seam to the data that a process needs.
pub(in crate::coupling) struct ReachOfSeam {
    own: OwnBonds,
    /// Points whose bonds in the body's pass are followed.
    pub followed: Vec<u32>,
}

impl<const D: usize> NonlinearSeam<D> {
    /// Returns the part of the seam on which the forces of `own` sites depend; marks the `sites` whose displacements it takes.
    pub(in crate::coupling) fn reach_from(
        &self,
        own: &[bool],
        site_of_point: &[u32],
        sites: &mut [bool],
    ) -> ReachOfSeam {
        let is_own = |site: u32| own.get(site as usize).is_some_and(|own| *own);
        let mut parts = vec![false; self.parts.len()];
        for (s, _) in self.sites.iter().enumerate().filter(|(_, s)| is_own(**s)) {
            let ends = self.ends[self.offsets[s]..self.offsets[s + 1]].iter();
            ends.for_each(|(part, _)| parts[*part as usize] = true);
        }
        let counts = |bond: usize| {
            let ends = self.bonds[bond].iter().map(|&p| site_of_point[p as usize]);
            // a point in an element is no site; a bond between two of these ends on faces with all its parts
            let on_faces = self.difference.row(self.first[bond] as usize);
            let mut sites = ends.chain(on_faces.map(|(site, _)| site));
            sites
                .find(|&site| (site as usize) < own.len())
                .is_some_and(is_own)
        };
        let counted_bonds: Vec<bool> = (0..self.bonds.len()).map(counts).collect();
        for bond in (0..self.bonds.len()).filter(|&bond| counted_bonds[bond]) {
            parts[self.parts_of(bond)].fill(true);
        }
        let count = self.states.as_ref().map_or(0, |states| states.count());
        let (mut dilatations, mut counted_dilatations) = (vec![false; count], vec![false; count]);
        if let Some(states) = &self.states {
            for f in 0..count {
                counted_dilatations[f] = is_own(states.site_of(f));
                dilatations[f] = counted_dilatations[f]
                    || states.own_of(f).iter().any(|(site, _)| is_own(*site));
            }
            for part in (0..parts.len()).filter(|&part| parts[part]) {
                let of_part = states.of_part(part).iter();
                of_part.for_each(|(f, _)| dilatations[*f as usize] = true);
            }
            for f in (0..count).filter(|&f| dilatations[f]) {
                let shares = states.shares_of(f).iter();
                shares.for_each(|(part, _)| parts[*part as usize] = true);
                states
                    .own_of(f)
                    .iter()
                    .for_each(|(site, _)| sites[*site as usize] = true);
            }
        }
        let mut bonds = vec![false; self.bonds.len()];
        for part in (0..parts.len()).filter(|&part| parts[part]) {
            bonds[self.parts[part].bond as usize] = true;
            let ends = self.difference.row(part);
            ends.for_each(|(site, _)| sites[site as usize] = true);
        }
        if let Some(breaks) = &self.breaks {
            let known = (0..self.own).filter(|&bond| bonds[bond]);
            known.for_each(|bond| {
                let carrier = breaks.carrier(bond);
                carrier.for_each(|(site, _)| sites[site as usize] = true);
            });
        }
        let whole = (self.own..self.bonds.len()).filter(|&bond| bonds[bond]);
        let mut followed: Vec<u32> = whole.map(|bond| self.bonds[bond][0]).collect();
        followed.sort_unstable();
        followed.dedup();
        ReachOfSeam {
            own: OwnBonds {
                parts,
                dilatations,
                bonds,
                counted_bonds,
                counted_dilatations,
            },
            followed,
        }
    }

    /// Goes on with what is known of the seam alone: forces of own sites, and breaks of bonds that these know.
    pub(in crate::coupling) fn reach_only(&mut self, reach: ReachOfSeam) {
        self.computed = reach.own;
    }

    /// The parts of a bond.
    fn parts_of(&self, bond: usize) -> std::ops::Range<usize> {
        self.first[bond] as usize..self.first[bond + 1] as usize
    }

    /// Adds what the seam would store less at a displacement for the bonds that the last pass broke \[J\], of bonds and dilatations that are counted here.
    pub(in crate::coupling) fn add_lost_energy(&self, u: &[f64], lost: &mut ExactSum) {
        let mut of = Vec::new();
        for &(bond, part) in &self.last {
            for p in self.parts_of(bond as usize) {
                if self.computed.counts_bond(bond as usize) {
                    let q = self.elongation(p, u);
                    lost.add(0.5 * part * self.parts[p].stiffness * q * q);
                }
                let states = self.states.iter();
                of.extend(states.flat_map(|s| s.of_part(p).iter().map(|e| e.0)));
            }
        }
        let Some(states) = &self.states else { return };
        of.sort_unstable();
        of.dedup();
        of.retain(|&f| self.computed.counts_dilatation(f as usize));
        let own = states.own_parts(u, self.kinematics, |f| {
            of.binary_search(&(f as u32)).is_ok()
        });
        let parts: FxHashMap<u32, f64> = self.last.iter().copied().collect();
        for &f in &of {
            let with = |more: &dyn Fn(u32) -> f64| {
                let left = |bond: u32| self.left(bond)[1] + more(bond);
                let handed = |p: usize| left(self.parts[p].bond) * self.elongation(p, u);
                states.energy_of(f as usize, &own, handed)
            };
            let before = with(&|bond| parts.get(&bond).copied().unwrap_or(0.0));
            lost.add(before - with(&|_| 0.0));
        }
    }

    /// Bonds that the last pass broke here and not in that of the body, of those that are counted here.
    pub(in crate::coupling) fn broken_here(&self) -> Vec<u64> {
        let last = self.last.iter().map(|&(bond, _)| bond);
        let own = last.filter(|&bond| (bond as usize) < self.own && !self.stands(bond));
        let counted = own.filter(|&bond| self.computed.counts_bond(bond as usize));
        counted.map(u64::from).collect()
    }

    /// Breaks bonds that others broke.
    pub(in crate::coupling) fn take_broken(&mut self, bonds: &[u64]) {
        for &bond in bonds {
            self.intact[bond as usize / 8] &= !(1 << (bond % 8));
        }
    }

    /// Broken bonds that the body has not: their points, and which part of the bond each is.
    pub(in crate::coupling) fn broken_parts(&self) -> impl Iterator<Item = ([u32; 2], f64)> + '_ {
        let broken = (0..self.own).filter(|&bond| !self.stands(bond as u32));
        broken.map(|bond| {
            let parts = &self.parts[self.parts_of(bond)];
            (self.bonds[bond], parts.iter().map(|part| part.length).sum())
        })
    }
}
