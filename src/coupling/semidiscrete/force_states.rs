//! Nonlinear force states, evaluated at the sites: stress, energy density and history variables.

use super::CoupledSystem;
use super::behaviour::NONE;
use crate::{peridynamics::bond_force::BondKinematics, system::PlaceStress};

impl<const D: usize> CoupledSystem<'_, D> {
    /// See [`crate::system::BodyState::stress_of_site`].
    pub(super) fn stress_of_point(&self, site: usize, u: &[f64]) -> Option<PlaceStress> {
        let moving = self.body.as_ref()?;
        let states = moving.pass.force_states()?;
        let (body, p) = self.model.point_of(site)?;
        let law = &self.model.peridynamics.as_ref()?.law;
        let knows_heat = moving.heat.is_some();
        let is_exact = moving.kinematics == BondKinematics::Exact;
        let is_linear = law.is_linear() && !is_exact && !knows_heat;
        // a family of which a seam has cut a part is not all of what is strained
        let is_whole = states.family_size(p) == body.families.of(p).len();
        (is_whole && !is_linear).then(|| {
            let transfer = &body.cloud.transfer;
            let stress = states.stress(p, &|j| transfer.displacement(j, u));
            PlaceStress::new(&stress.tensor, stress.across)
        })
    }

    /// See [`crate::system::BodyState::energy_densities`].
    pub(super) fn energy_densities_of_points(&self, u: &[f64]) -> Option<Vec<f64>> {
        let moving = self.body.as_ref()?;
        let states = moving.pass.force_states()?;
        let mut points = vec![0.0; moving.displacement.len()];
        moving.spread(u, &mut points);
        let mut sites = vec![0.0; self.mass.len()];
        for (p, &site) in moving.site_of_point.iter().enumerate() {
            if site != NONE {
                sites[site as usize] = states.energy_density(p, &points);
            }
        }
        Some(sites)
    }

    /// See [`crate::system::BodyState::points_without_response`].
    pub(super) fn count_without_response(&self, u: &[f64]) -> usize {
        let Some(body) = &self.body else {
            return 0;
        };
        let Some(states) = body.pass.force_states() else {
            return 0;
        };
        let mut points = vec![0.0; body.displacement.len()];
        body.spread(u, &mut points);
        states.points_without_response(&points)
    }

    /// See [`crate::system::BodyState::remembered`].
    pub(super) fn remembered_by_points(&self) -> Vec<(&'static str, Vec<f64>)> {
        let Some(body) = &self.body else {
            return Vec::new();
        };
        let named = body.pass.force_states().map(|s| s.remembered());
        let of_sites = |points: Vec<f64>| {
            let mut sites = vec![0.0; self.mass.len()];
            for (value, &site) in points.iter().zip(&body.site_of_point) {
                if site != NONE {
                    sites[site as usize] = *value;
                }
            }
            sites
        };
        let named = named.unwrap_or_default().into_iter();
        named
            .map(|(name, points)| (name, of_sites(points)))
            .collect()
    }
}
