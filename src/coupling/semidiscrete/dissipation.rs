//! Dissipation by breaking bonds: energy stored just before less that just after, at the same displacement, and the area of the cracks.

use super::CoupledSystem;
use crate::coupling::semidiscrete::behaviour::NONE;
use crate::{
    peridynamics::CrackArea,
    system::{Dissipation, Halfway, LostToBreaks},
};

impl<const D: usize> CoupledSystem<'_, D> {
    /// Numbers of the account in a checkpoint.
    pub(super) fn spends(&self) -> usize {
        match (self.remembers(), self.breaks()) {
            (true, _) => 3,
            (false, true) => 2,
            (false, false) => 0,
        }
    }

    /// Energy and area of the bonds that the last pass broke, all removed at once.
    pub(super) fn of_last_breaks(&self, at: &Halfway<'_>) -> Dissipation {
        let lost = self.lost_here(at);
        Dissipation {
            energy: lost.energy.value(),
            area: lost.area.value(),
            inelastic: 0.0,
        }
    }

    /// The same of the bonds that are counted here, where processes move their own sites.
    pub(super) fn lost_here(&self, at: &Halfway<'_>) -> LostToBreaks {
        let mut lost = self.lost_by_pass(at);
        if let Some(seam) = self.seam.as_ref().filter(|seam| seam.has_changed()) {
            seam.add_lost_energy(&at.all(), &mut lost.energy);
            for (bond, share) in seam.last_own() {
                lost.area.add(share * self.area_of(bond));
            }
        }
        lost
    }

    /// Returns the crack area that a bond contributes where it breaks.
    fn area_of(&self, [i, j]: [u32; 2]) -> f64 {
        self.model.body().map_or(0.0, |body| {
            let spacing = self.model.spacing_at(i);
            let area = CrackArea::<D>::new(spacing, body.cloud.horizon.of(i as usize));
            area.of(&body.bond(i as usize, j as usize))
        })
    }

    /// Energy and area of the bonds that the pass over the body broke last.
    fn lost_by_pass(&self, at: &Halfway<'_>) -> LostToBreaks {
        let mut lost = LostToBreaks::default();
        let Some(moving) = &self.body else {
            return lost;
        };
        let displaced = |point: usize| -> [f64; D] {
            match (moving.site_of_point[point], &moving.transfer) {
                (NONE, None) => [0.0; D],
                (NONE, Some(transfer)) => {
                    let mut u = [0.0; D];
                    for (site, weight) in transfer.row(point) {
                        for (a, u) in u.iter_mut().enumerate() {
                            *u += weight * at.of(site as usize * D + a);
                        }
                    }
                    u
                }
                (site, _) => std::array::from_fn(|a| at.of(site as usize * D + a)),
            }
        };
        moving.pass.add_lost_energy(&displaced, &mut lost.energy);
        for (i, j) in moving.pass.last_broken() {
            lost.area.add(0.5 * self.area_of([i, j]));
        }
        lost
    }
}
