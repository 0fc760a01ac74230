//! Bonds of a list past the onset of softening.

use super::bond_list::{Limit, List};
use super::list::{Stretched, extension, ratio, stretched, vector};
use super::softened_bonds::{SoftenedBond, SoftenedBonds};
use crate::system::BondChanges;

impl<const D: usize> List<D> {
    fn stretched<const EXACT: bool>(&self, bond: &SoftenedBond, u: &[f64]) -> Stretched<D> {
        let [i, j] = [bond.near, bond.far].map(|point| point as usize);
        stretched::<D, EXACT>(&self.xi(i, j), &vector(u, i), &u[j * D..][..D])
    }

    /// Hands over bonds whose bits a sweep has cleared, and follows the stretches of all.
    pub(super) fn soften<const EXACT: bool>(
        &self,
        softened: &mut SoftenedBonds,
        handed: &[(u32, usize)],
        u: &[f64],
    ) -> BondChanges {
        let law = softened.law();
        let new = handed.iter().map(|&(i, bond)| {
            let limit = match &self.limit {
                Limit::Never => f64::INFINITY,
                Limit::Uniform(t) => *t,
                Limit::PerBond(t) => t[bond],
            };
            let far = self.neighbours.get(i as usize, bond);
            let ends = law.ends_of(self.kinematics.stretch(limit));
            SoftenedBond::new([i, far as u32], bond as u64, ends)
        });
        let stretch =
            |bond: &SoftenedBond| extension::<EXACT>(self.stretched::<EXACT>(bond, u).t());
        softened.advance(new, stretch)
    }

    /// Adds them to the sums of extensions of the points.
    pub(super) fn add_softened_extensions<const EXACT: bool>(
        &self,
        softened: &SoftenedBonds,
        u: &[f64],
        sums: &mut [f64],
    ) {
        for bond in softened.bonds() {
            let s = self.stretched::<EXACT>(bond, u);
            let weighted = self.weights.get(bond.slot as usize) * self.volume[bond.far as usize];
            let [_, state] = SoftenedBonds::left(bond);
            sums[bond.near as usize] += state * weighted * s.length * extension::<EXACT>(s.t());
        }
    }

    /// Adds their forces, with the dilatation of each point.
    pub(super) fn add_softened_forces<const EXACT: bool>(
        &self,
        softened: &SoftenedBonds,
        (u, theta): (&[f64], &[f64]),
        sums: &mut [f64],
    ) {
        for bond in softened.bonds() {
            let [i, j] = [bond.near, bond.far].map(|point| point as usize);
            let s = self.stretched::<EXACT>(bond, u);
            let (e, ratio) = (extension::<EXACT>(s.t()), ratio::<EXACT>(s.t()));
            // per ξ + η: an extension counts as r² (1 − r/|ξ+η|) of a pair
            let [pair, state] = SoftenedBonds::left(bond);
            let tension = match &self.solid {
                None => pair * e,
                Some(c) => {
                    let pull = c.volumetric[i] * theta[i] + c.volumetric[j] * theta[j];
                    state * pull + pair * (c.deviatoric[i] + c.deviatoric[j]) * e
                }
            };
            let weighted = self.weights.get(bond.slot as usize) * self.volume[j];
            let force = weighted * tension * ratio;
            for (sum, x) in sums[i * D..].iter_mut().zip(s.direction) {
                *sum += force * x;
            }
        }
    }

    /// Bonds that the last pass took stiffness from, by point, and the part of it.
    pub(super) fn losses(&self) -> Vec<(u32, usize, f64)> {
        match &self.softened {
            Some(softened) => {
                let losses = softened.losses.iter();
                losses
                    .map(|loss| (loss.bond.near, loss.bond.slot as usize, loss.part))
                    .collect()
            }
            None => self.last.iter().map(|&(i, bond)| (i, bond, 1.0)).collect(),
        }
    }

    /// Parts of its stiffness that a bond of a point has, as [`SoftenedBonds::left`] gives them.
    pub(super) fn left_of(&self, i: usize, bond: usize) -> [f64; 2] {
        if self.is_intact(i, bond - self.offsets[i]) {
            return [1.0; 2];
        }
        let softened = self.softened.as_ref();
        let found = softened.and_then(|softened| softened.find(i, bond as u64));
        found.map_or([0.0; 2], SoftenedBonds::left)
    }

    /// Returns true if a bond of a point has not broken.
    pub(super) fn stands(&self, i: usize, bond: usize) -> bool {
        self.left_of(i, bond) != [0.0; 2]
    }
}
