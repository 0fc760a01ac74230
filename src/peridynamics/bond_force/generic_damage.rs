//! Damage of bonds in the generic pass: what laws keep of it ([`crate::peridynamics::HistoryLayout::damage`]) beside bonds that broke by their stretch.

use rayon::prelude::*;

use super::generic::{Generic, NONE};
use crate::peridynamics::KeptDamage;

impl<const D: usize> Generic<D> {
    /// The damage φ of a bond at its own end, 1 of a broken one, as committed; without what is kept of the point.
    pub(super) fn damage_of(&self, bond: usize) -> f64 {
        match self.layout.damage {
            _ if !self.intact[bond] => 1.0,
            Some(KeptDamage::Bond(place)) => self.past.bonds[bond * self.layout.bond.len() + place],
            _ => 0.0,
        }
    }

    /// Whether a bond has neither broken nor been damaged through.
    pub(super) fn stands(&self, bond: usize) -> bool {
        self.intact[bond] && !self.damaged_through.get(bond).is_some_and(|gone| *gone)
    }

    /// Bonds whose damage has become 1 at both ends in the last response, with their points; one without a far family is what its own end says.
    pub(super) fn newly_damaged_through(&self) -> Vec<(u32, usize)> {
        let Some(KeptDamage::Bond(place)) = self.layout.damage else {
            return Vec::new();
        };
        let is_one = |bond: usize| self.present.bonds[bond * self.layout.bond.len() + place] == 1.0;
        (0..self.position.len())
            .into_par_iter()
            .with_min_len(64)
            .flat_map_iter(|i| {
                let new = self.range(i).filter(move |&bond| {
                    let back = self.reverse[bond];
                    is_one(bond) && (back == NONE || is_one(back as usize)) && self.stands(bond)
                });
                new.map(move |bond| (i as u32, bond))
            })
            .collect()
    }

    /// Counts them among the bonds that the last pass broke, without an energy: they held no force any more.
    pub(super) fn find_damaged_through(&mut self) {
        let through = self.newly_damaged_through();
        if through.is_empty() {
            return;
        }
        for &(_, bond) in &through {
            self.damaged_through[bond] = true;
        }
        self.last.extend(through);
        self.last.sort_unstable();
    }

    /// Finds those of a history that was put back.
    pub(super) fn recall_damaged_through(&mut self) {
        self.damaged_through.fill(false);
        for (_, bond) in self.newly_damaged_through() {
            self.damaged_through[bond] = true;
        }
    }

    /// The damage D that is kept of a point, as committed.
    pub(super) fn kept_of_point(&self, i: usize) -> f64 {
        match self.layout.damage {
            Some(KeptDamage::Point(place)) => self.past.point[i * self.layout.point.len() + place],
            _ => 0.0,
        }
    }

    /// `1 − (1 − D) Σ (1 − φ) V / Σ V` of a point; D where there is no family.
    pub(super) fn damage_of_point(&self, i: usize) -> f64 {
        let (mut all, mut lost) = (0.0, 0.0);
        for bond in self.range(i) {
            let v = self.volume[self.neighbour(bond)];
            all += v;
            lost += v * self.damage_of(bond);
        }
        let kept = self.kept_of_point(i);
        if lost > 0.0 {
            kept + (1.0 - kept) * (lost / all)
        } else {
            kept
        }
    }
}
