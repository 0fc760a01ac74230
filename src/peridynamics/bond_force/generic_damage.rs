//! Damage of bonds in the generic pass: what laws keep of it ([`crate::peridynamics::HistoryLayout::damage`]) beside bonds that broke by their stretch.

use super::BondSetup;
use super::generic::{Generic, NONE};
use crate::{
    parallel,
    peridynamics::{KeptDamage, PdBody},
};

impl<const D: usize> Generic<D> {
    /// The damage φ of a bond at its own end, 1 of a broken one, as committed; without what is kept of the point.
    pub(super) fn damage_of(&self, bond: usize) -> f64 {
        match self.layout.damage {
            _ if !self.intact[bond] => 1.0,
            Some(KeptDamage::Bond(place)) => self.past.bonds[bond * self.layout.bond.len() + place],
            _ => 0.0,
        }
    }

    /// Returns true if a bond has neither broken nor been damaged through.
    pub(super) fn stands(&self, bond: usize) -> bool {
        self.intact[bond] && !self.damaged_through.get(bond).is_some_and(|gone| *gone)
    }

    /// Bonds whose damage has become 1 at both ends in the last response, with their points; one without a far family is what its own end says.
    pub(super) fn newly_damaged_through(&self) -> Vec<(u32, usize)> {
        let Some(KeptDamage::Bond(place)) = self.layout.damage else {
            return Vec::new();
        };
        let is_one = |bond: usize| self.present.bonds[bond * self.layout.bond.len() + place] == 1.0;
        parallel::listed(self.position.len(), 64, |i, all| {
            let new = self.range(i).filter(|&bond| {
                let back = self.reverse[bond];
                is_one(bond) && (back == NONE || is_one(back as usize)) && self.stands(bond)
            });
            all.extend(new.map(|bond| (i as u32, bond)));
        })
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
        let volume = |bond: usize| self.volume[self.neighbour(bond)];
        let lost = self.range(i).map(|b| volume(b) * self.damage_of(b));
        let lost: f64 = lost.sum();
        let kept = self.kept_of_point(i);
        if lost > 0.0 {
            let all = self.family_volume.get(i).copied();
            let all = all.unwrap_or_else(|| self.range(i).map(volume).sum());
            kept + (1.0 - kept) * (lost / all)
        } else {
            kept
        }
    }

    /// The share of its volume that a family has lost with the bonds that do not stand.
    pub(super) fn lost_share(&self, i: usize, stands: impl Fn(usize) -> bool) -> f64 {
        let lost = self.range(i).filter(|&bond| !stands(bond));
        let volume = |bond: usize| self.volume[self.neighbour(bond)];
        match lost.map(volume).sum::<f64>() {
            0.0 => 0.0,
            lost => lost / self.family_volume[i],
        }
    }

    /// The volume of the far points of each family, with what it has behind faces at which it ends.
    pub(super) fn family_volumes(setup: &BondSetup<'_, D>, body: &PdBody<D>) -> Vec<f64> {
        let of_family = |i: usize| {
            let far = setup.families.of(i).iter().map(|&j| j as usize);
            let far = far.filter(|&j| !body.is_foot(j));
            far.map(|j| setup.volume[j]).sum::<f64>() + body.volume_behind(i)
        };
        (0..setup.position.len()).map(of_family).collect()
    }
}
