//! What breaking bonds costs: energy stored just before less that just after, at the same displacement, and the area of the cracks.

use super::CoupledSystem;
use crate::coupling::semidiscrete::behaviour::NONE;
use crate::{
    peridynamics::CrackArea,
    system::{Dissipation, Halfway},
};

impl<const D: usize> CoupledSystem<'_, D> {
    /// Energy and area of the bonds that the last pass broke, all removed at once.
    pub(super) fn of_last_breaks(&self, at: &Halfway<'_>) -> Dissipation {
        let (Some(moving), Some(body)) = (&self.body, self.model.body()) else {
            return Dissipation::default();
        };
        let cloud = &body.cloud;
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
        let area_of = |[i, j]: [u32; 2]| {
            let spacing = self.model.spacing_at(i);
            let area = CrackArea::<D>::new(spacing, cloud.horizon.of(i as usize));
            area.of(&body.bond(i as usize, j as usize))
        };
        let mut spent = Dissipation {
            energy: moving.pass.lost_energy(&displaced),
            area: 0.0,
            inelastic: 0.0,
        };
        for (i, j) in moving.pass.last_broken() {
            spent.area += 0.5 * area_of([i, j]);
        }
        if let Some(seam) = self.seam.as_ref().filter(|seam| seam.has_broken()) {
            spent.energy += seam.lost_energy(&at.all());
            for (bond, share) in seam.last_own() {
                spent.area += share * area_of(bond);
            }
        }
        spent
    }
}
