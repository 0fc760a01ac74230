//! The state of a coupled system, as results show it.

use super::CoupledSystem;
use super::behaviour::NONE;
use super::body::reached;
use crate::system::{BodyState, PlaceStress};

impl<const D: usize> CoupledSystem<'_, D> {
    /// The displacement of the sites, without that of terms beside the body.
    fn own<'u>(&self, u: &'u [f64]) -> &'u [f64] {
        &u[..self.mass.len() * D]
    }
}

impl<const D: usize> BodyState for CoupledSystem<'_, D> {
    fn points_without_response(&self, u: &[f64]) -> usize {
        self.count_without_response(self.own(u))
    }

    fn stress_of_site(&self, site: usize, u: &[f64]) -> Option<PlaceStress> {
        self.stress_of_point(site, self.own(u))
    }

    fn energy_densities(&self, u: &[f64]) -> Option<Vec<f64>> {
        self.energy_densities_of_points(self.own(u))
    }

    fn remembered(&self) -> Vec<(&'static str, Vec<f64>)> {
        self.remembered_by_points()
    }

    fn stress_of_cell(&self, cell: usize, u: &[f64]) -> Option<PlaceStress> {
        self.elements.as_ref()?.stress(self.model, cell, u)
    }

    fn energy_of_cell(&self, cell: usize, u: &[f64]) -> Option<f64> {
        self.elements.as_ref()?.energy(self.model, cell, u)
    }

    fn remembered_by_cells(&self) -> Vec<(&'static str, Vec<(u32, f64)>)> {
        let elements = self.elements.as_ref();
        elements.map_or(Vec::new(), |e| e.remembered(self.model))
    }

    fn damage(&self) -> Option<Vec<f64>> {
        let body = self.body.as_ref()?;
        let mut points = vec![0.0; body.site_of_point.len()];
        body.pass.damage_into(&mut points);
        if let (Some(seam), Some(pd)) = (&self.seam, self.model.body()) {
            seam.add_damage(&mut points, |p| reached(pd, seam.families(), p));
        }
        let mut damage = vec![0.0; self.mass.len()];
        for (point, &site) in body.site_of_point.iter().enumerate() {
            if site != NONE {
                damage[site as usize] = points[point];
            }
        }
        Some(damage)
    }

    fn damage_at_edge(&self) -> Option<usize> {
        let body = self.body.as_ref()?;
        if let Some(seam) = &self.seam {
            let point = seam.damaged_at_face(body.pass.as_ref())?;
            return Some(body.site_of_point[point as usize] as usize);
        }
        // asked for after every pass that broke a bond: only the points at the edge are looked at
        body.edge
            .iter()
            .find(|&&p| body.pass.is_damaged(p as usize))
            .map(|&p| body.site_of_point[p as usize] as usize)
    }

    fn damaged_sites(&self) -> Vec<u32> {
        let Some(body) = self.body.as_ref() else {
            return Vec::new();
        };
        let points = body.site_of_point.iter().enumerate();
        points
            .filter(|&(p, &site)| site != NONE && body.pass.is_damaged(p))
            .map(|(_, &site)| site)
            .collect()
    }

    fn broken_bonds(&self) -> Vec<(u32, u32)> {
        self.broken_between_sites()
    }

    fn crack_area(&self) -> f64 {
        self.area_of_cracks()
    }
}
