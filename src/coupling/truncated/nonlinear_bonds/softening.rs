//! Bonds at a seam past the onset of softening: those that it cuts follow their own largest stretch, whole ones what the body's pass says of them.

use super::NonlinearSeam;
use crate::{
    peridynamics::bond_force::{BondPass, SoftenedBond, SoftenedBonds, pack, unpack},
    system::BondChanges,
};

impl<const D: usize> NonlinearSeam<D> {
    /// Parts of its stiffness that a bond has, of its pair force and of the elongation that it hands to dilatations.
    pub(super) fn left(&self, bond: u32) -> [f64; 2] {
        let is_whole = self.intact[bond as usize / 8] >> (bond % 8) & 1 == 1;
        match (is_whole, &self.softening) {
            (true, _) => [1.0; 2],
            (false, Some(softening)) => softening.left[bond as usize],
            (false, None) => [0.0; 2],
        }
    }

    /// Returns true if a bond has not broken.
    pub(super) fn stands(&self, bond: u32) -> bool {
        self.left(bond) != [0.0; 2]
    }

    /// Notes what is left of a bond, and the part that it lost with it.
    fn set_left(&mut self, bond: u32, left: [f64; 2]) {
        let lost = self.left(bond)[1] - left[1];
        if lost > 0.0 {
            self.last.push((bond, lost));
        }
        if left != [1.0; 2] {
            self.intact[bond as usize / 8] &= !(1 << (bond % 8));
        }
        if let Some(softening) = &mut self.softening {
            softening.left[bond as usize] = left;
        }
    }

    /// Learns from the body's pass which of its bonds stand, and what is left of those that soften; where the pass has changed no bond, only the latter may close or open.
    pub(in crate::coupling) fn follow(&mut self, pass: &dyn BondPass<D>, changes: BondChanges) {
        if changes.is_none() && self.softening.is_none() {
            return;
        }
        for bond in self.own..self.bonds.len() {
            let is_whole = self.intact[bond / 8] >> (bond % 8) & 1 == 1;
            if is_whole && changes.is_none() || !self.stands(bond as u32) {
                continue;
            }
            let [i, j] = self.bonds[bond];
            let left = pass.left(i as usize, j as usize);
            if left != self.left(bond as u32) {
                self.set_left(bond as u32, left);
            }
        }
    }

    /// Breaks and softens bonds that the seam cuts; returns how many, each counted once for each direction.
    pub(super) fn update_cut_bonds(&mut self, u: &[f64]) -> BondChanges {
        let Some(breaks) = &self.breaks else {
            return BondChanges::default();
        };
        let is_whole = |bond: usize| self.intact[bond / 8] >> (bond % 8) & 1 == 1;
        let may = |bond| is_whole(bond) && self.computed.knows_bond(bond);
        let over = breaks.over(self.kinematics, may, u);
        let Some(softening) = &mut self.softening else {
            over.iter()
                .for_each(|&bond| self.set_left(bond as u32, [0.0; 2]));
            return BondChanges::broken(2 * self.broken_here().len() as u64);
        };
        for &bond in &over {
            self.intact[bond / 8] &= !(1 << (bond % 8));
            softening.left[bond] = [1.0; 2];
        }
        let law = softening.cut.law();
        let new = over.iter().map(|&bond| {
            let limit = self.kinematics.stretch(breaks.limit(bond));
            SoftenedBond::new(self.bonds[bond], bond as u64, law.ends_of(limit))
        });
        let kinematics = self.kinematics;
        let stretch = |bond: &SoftenedBond| breaks.stretch(kinematics, bond.slot as usize, u);
        let changes = softening.cut.advance(new, stretch);
        let cut = softening.cut.bonds().iter();
        let lost = softening.cut.losses.iter().filter(|loss| loss.is_broken);
        let left: Vec<(u64, [f64; 2])> = cut
            .map(|bond| (bond.slot, SoftenedBonds::left(bond)))
            .chain(lost.map(|loss| (loss.bond.slot, [0.0; 2])))
            .collect();
        for (bond, left) in left {
            self.set_left(bond as u32, left);
        }
        BondChanges {
            broken: 2 * changes.broken,
            softened: 2 * changes.softened,
        }
    }

    fn bits(&self) -> Vec<u64> {
        pack(&self.intact, self.bonds.len() as u64)
    }

    /// Words for a checkpoint: bits of the bonds that have all of their stiffness, and the cut ones past the onset.
    pub(in crate::coupling) fn damage_state(&self) -> Vec<u64> {
        let mut words = self.bits();
        let softening = self.softening.iter();
        words.extend(softening.flat_map(|softening| softening.cut.state()));
        words
    }

    /// Splits the words of [`NonlinearSeam::damage_state`] off the end of those of a pass.
    pub(in crate::coupling) fn split_state<'w>(
        &self,
        state: &'w [u64],
    ) -> Option<(&'w [u64], &'w [u64])> {
        let cut = self.softening.as_ref().map(|softening| &softening.cut);
        let (before, _) = SoftenedBonds::split(cut, state)?;
        Some(state.split_at(before.len().checked_sub(self.bits().len())?))
    }

    /// Puts back what [`NonlinearSeam::damage_state`] gave, but for whole bonds that have softened, which the pass knows; false if it belongs to another seam.
    pub(in crate::coupling) fn restore_damage(&mut self, state: &[u64]) -> bool {
        let cut = self.softening.as_ref().map(|softening| &softening.cut);
        let Some((bits, words)) = SoftenedBonds::split(cut, state) else {
            return false;
        };
        if !unpack(bits, self.bonds.len() as u64, &mut self.intact) {
            return false;
        }
        if let Some(softening) = &mut self.softening {
            softening.cut.restore(words);
            softening.left.fill([0.0; 2]);
            for bond in softening.cut.bonds() {
                softening.left[bond.slot as usize] = SoftenedBonds::left(bond);
            }
        }
        true
    }

    /// Learns from the pass, whose state was put back, what is left of its bonds.
    pub(in crate::coupling) fn recall(&mut self, pass: &dyn BondPass<D>) {
        if let Some(softening) = &mut self.softening {
            for (bond, &[i, j]) in self.bonds.iter().enumerate().skip(self.own) {
                softening.left[bond] = pass.left(i as usize, j as usize);
            }
        }
        self.last.clear();
    }
}
