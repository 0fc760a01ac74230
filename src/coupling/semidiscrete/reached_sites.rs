//! Sites on whose displacements the forces of others depend.

use super::CoupledSystem;
use super::behaviour::NONE;
use super::body::MovingBody;
use crate::assembly::Transfer;
use crate::coupling::truncated::ReachOfSeam;

/// Data that a process needs for the forces of its own sites.
pub(super) struct Reached {
    /// Points whose forces from bonds its own sites take.
    pub own_points: Vec<bool>,
    /// These, and all points whose displacements their bonds take.
    pub points: Vec<bool>,
    /// Own sites, and all whose displacements rows and bonds of own sites take.
    pub sites: Vec<bool>,
    /// Part of the bonds of a seam that is computed.
    pub seam: Option<ReachOfSeam>,
}

impl<const D: usize> CoupledSystem<'_, D> {
    /// Returns true if the force of every site comes from linear rows and from bonds of which a pass can leave some to others; only bonds of a seam act beside, and there are no history variables.
    pub(super) fn may_share_steps(&self) -> bool {
        let passes = |body: &MovingBody<D>| {
            body.contact.is_none()
                && body.feet.is_empty()
                && !body.pass.remembers()
                && !body.softens
                // an accelerator, which can leave points to others
                && body.pass.force_states().is_none()
        };
        self.is_shareable
            && self.elements.is_none()
            && self.stresses.is_none()
            && self.body.as_ref().is_none_or(passes)
    }

    /// Returns the points, sites and bonds of a seam on which the forces of `own` sites depend.
    pub(super) fn reached_from(&self, own: &[bool]) -> Reached {
        let mut sites = own.to_vec();
        for site in (0..own.len()).filter(|&site| own[site]) {
            let columns = self.linear.columns(site).iter();
            columns.for_each(|&column| sites[column as usize] = true);
        }
        let Some(body) = &self.body else {
            return Reached {
                own_points: Vec::new(),
                points: Vec::new(),
                sites,
                seam: None,
            };
        };
        let mut own_points = vec![false; body.site_of_point.len()];
        let of_own = body.bonds_of_site.iter().zip(own);
        for (&point, _) in of_own.filter(|(point, own)| **own && **point != NONE) {
            own_points[point as usize] = true;
        }
        let mut points = self.model.points_reached(&own_points);
        let seam = self.seam.as_ref().map(|seam| {
            let reach = seam.reach_from(own, &body.site_of_point, &mut sites);
            for &point in &reach.followed {
                points[point as usize] = true;
                let family = seam.families().of(point as usize).iter();
                family.for_each(|&j| points[j as usize] = true);
            }
            reach
        });
        for point in (0..points.len()).filter(|&point| points[point]) {
            match (body.site_of_point[point], &body.transfer) {
                (NONE, None) => {}
                (NONE, Some(transfer)) => mark(transfer, point, &mut sites),
                (site, _) => sites[site as usize] = true,
            }
        }
        Reached {
            own_points,
            points,
            sites,
            seam,
        }
    }
}

/// Marks the sites that a point follows.
fn mark(transfer: &Transfer, point: usize, sites: &mut [bool]) {
    for (site, _) in transfer.row(point) {
        sites[site as usize] = true;
    }
}
