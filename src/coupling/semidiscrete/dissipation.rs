//! Dissipation by breaking bonds: energy stored just before less that just after, at the same displacement; area of the cracks.

use super::CoupledSystem;
use crate::coupling::semidiscrete::behaviour::NONE;
use crate::{
    model::{SiteKind, crack_layers},
    peridynamics::CrackArea,
    system::{Dissipation, ExactSum, Halfway},
};

impl<const D: usize> CoupledSystem<'_, D> {
    /// Numbers of the account in a checkpoint.
    pub(super) fn spends(&self) -> usize {
        match (self.remembers(), self.breaks()) {
            (true, _) => 2,
            (false, true) => 1,
            (false, false) => 0,
        }
    }

    /// Energy of the bonds that the last pass broke, all removed at once.
    pub(super) fn of_last_breaks(&self, at: &Halfway<'_>) -> Dissipation {
        Dissipation {
            energy: self.lost_here(at).value(),
            inelastic: 0.0,
        }
    }

    /// The same of the bonds that are counted here, where processes move their own sites.
    pub(super) fn lost_here(&self, at: &Halfway<'_>) -> ExactSum {
        let mut lost = self.lost_by_pass(at);
        if let Some(seam) = self.seam.as_ref().filter(|seam| seam.has_changed()) {
            seam.add_lost_energy(&at.all(), &mut lost);
        }
        lost
    }

    /// See [`crate::system::BodyState::crack_area`].
    pub(super) fn area_of_cracks(&self) -> f64 {
        let Some(body) = self.model.body() else {
            return 0.0;
        };
        let point = |site: u32| match self.model.sites[site as usize].kind {
            SiteKind::Point(p) => Some(p),
            SiteKind::Node(_) => None,
        };
        let within = self.broken_between_sites().into_iter();
        let within = within
            .filter(|(i, j)| i < j)
            .filter_map(|(i, j)| Some(([point(i)?, point(j)?], 1.0)));
        let at_seam = self.seam.iter().flat_map(|seam| seam.broken_parts());
        let bond = |([i, j], share): ([u32; 2], f64)| {
            let xi = body.bond(i as usize, j as usize);
            let horizon = body.cloud.horizon.of(i as usize);
            let layer = CrackArea::<D>::new(self.model.spacing_at(i), horizon).of(&xi);
            (layer > 0.0).then(|| crack_layers::BrokenBond {
                middle: body.cloud.position[i as usize] + xi * 0.5,
                area: share * layer,
                horizon,
            })
        };
        let bonds: Vec<_> = within.chain(at_seam).filter_map(bond).collect();
        crack_layers::area(&bonds)
    }

    /// Energy of the bonds that the pass over the body broke last.
    fn lost_by_pass(&self, at: &Halfway<'_>) -> ExactSum {
        let mut lost = ExactSum::default();
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
        moving.pass.add_lost_energy(&displaced, &mut lost);
        lost
    }
}
