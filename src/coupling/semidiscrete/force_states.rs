//! What force states that are not linear tell of the sites.

use super::CoupledSystem;
use super::behaviour::NONE;

impl<const D: usize> CoupledSystem<'_, D> {
    /// See [`crate::system::SemiDiscrete::stresses`].
    pub(super) fn stresses_of_points(&self, u: &[f64]) -> Vec<(u32, [[f64; 3]; 3])> {
        let (Some(moving), Some(body)) = (&self.body, self.model.body()) else {
            return Vec::new();
        };
        let Some(states) = moving.pass.force_states() else {
            return Vec::new();
        };
        let mut points = vec![0.0; moving.displacement.len()];
        moving.spread(u, &mut points);
        let sites = moving.site_of_point.iter().enumerate();
        // a family of which a seam has cut a part is not all of what is strained
        let whole = |p: usize| states.family_size(p) == body.families.of(p).len();
        sites
            .filter(|&(p, &site)| site != NONE && whole(p))
            .map(|(p, &site)| {
                let stress = states.partial_stress(p, &points);
                let entry = |i: usize, j: usize| if i < D && j < D { stress[(i, j)] } else { 0.0 };
                let rows = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
                (site, rows)
            })
            .collect()
    }

    /// See [`crate::system::SemiDiscrete::energy_densities`].
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

    /// See [`crate::system::SemiDiscrete::points_without_response`].
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

    /// See [`crate::system::SemiDiscrete::remembered`].
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
