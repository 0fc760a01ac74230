//! A body and its impactors as one system that moves.

use std::sync::Arc;

use super::Impact;
use crate::system::wrapped::state_of;
use crate::system::{
    BlockCsr, ElementTangent, FailureUpdate, Halfway, Interval, PlaceStress, SemiDiscrete,
};

/// A system whose sites rigid impactors push: the sites of the body first, one for each impactor after them.
///
/// At rest nothing touches: the tangent is that of the body, and contact enters the stable step by [`SemiDiscrete::contact_frequency_bound`].
pub struct ImpactedSystem<'a, const D: usize> {
    body: Box<dyn SemiDiscrete + 'a>,
    impact: Arc<Impact<D>>,
    mass: Vec<f64>,
}

/// The displacement over which forces are differenced, over the size of the smallest site.
const DIFFERENCED: f64 = 1e-7;

impl<'a, const D: usize> ImpactedSystem<'a, D> {
    /// A body, whose sites are those of `impact`, with its impactors.
    pub fn new(body: Box<dyn SemiDiscrete + 'a>, impact: Arc<Impact<D>>) -> Self {
        let mass = body.mass().iter().copied().chain(impact.masses()).collect();
        Self { body, impact, mass }
    }

    fn dofs(&self) -> usize {
        self.impact.sites() * D
    }

    /// What the body has of a list by dof.
    fn own<'u>(&self, all: &'u [f64]) -> &'u [f64] {
        &all[..self.dofs()]
    }

    /// A list of the body by sites, with `rest` for each impactor.
    fn extended<T: Clone>(&self, mut list: Vec<T>, rest: T) -> Vec<T> {
        list.resize(self.mass.len(), rest);
        list
    }
}

impl<const D: usize> SemiDiscrete for ImpactedSystem<'_, D> {
    state_of!(body);

    fn block(&self) -> usize {
        D
    }

    fn mass(&self) -> &[f64] {
        &self.mass
    }

    fn internal_force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        interval: Interval,
        breakage: FailureUpdate,
    ) -> u64 {
        let dofs = self.dofs();
        let (own, rest) = force.split_at_mut(dofs);
        rest.fill(0.0);
        let broken = (self.body).internal_force_into(&u[..dofs], own, interval, breakage);
        self.impact.add_force(u, force);
        broken
    }

    fn force_of_heating_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        from: Option<f64>,
        to: f64,
    ) -> bool {
        let dofs = self.dofs();
        let (own, rest) = force.split_at_mut(dofs);
        let is_heated = (self.body).force_of_heating_into(&u[..dofs], own, from, to);
        if is_heated {
            rest.fill(0.0);
            self.impact.add_force(u, force);
        }
        is_heated
    }

    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        let (own, rest) = y.split_at_mut(self.dofs());
        rest.fill(0.0);
        self.body.tangent_into(self.own(x), own);
    }

    fn difference_length(&self) -> Option<f64> {
        let own = DIFFERENCED * self.impact.smallest;
        Some((self.body.difference_length()).map_or(own, |length| length.min(own)))
    }

    fn element_tangent(&self, u: &[f64], interval: Interval) -> Option<ElementTangent> {
        let mut found = self.body.element_tangent(self.own(u), interval)?;
        // impactors are no nodes; contact is differenced
        let end = found.excess.columns.len();
        found.excess.row_offsets.resize(self.mass.len() + 1, end);
        found.is_whole = false;
        Some(found)
    }

    fn force_beside_elements_into(&mut self, u: &[f64], force: &mut [f64], interval: Interval) {
        let dofs = self.dofs();
        let (own, rest) = force.split_at_mut(dofs);
        rest.fill(0.0);
        (self.body).force_beside_elements_into(&u[..dofs], own, interval);
        self.impact.add_force(u, force);
    }

    fn round_off(&self, u: &[f64]) -> f64 {
        self.body.round_off(self.own(u)) + self.impact.round_off(u)
    }

    fn row_sums(&self) -> Vec<f64> {
        let mut sums = self.body.row_sums();
        self.impact.extend_row_sums(&mut sums);
        sums
    }

    fn contact_frequency_bound(&self) -> f64 {
        self.body.contact_frequency_bound() + self.impact.frequency_bound(self.body.mass())
    }

    fn tangent_is_constant(&self) -> Vec<bool> {
        self.extended(self.body.tangent_is_constant(), false)
    }

    fn tangent_rows(&self, sites: &[u32]) -> BlockCsr {
        self.body.tangent_rows(sites)
    }

    fn seam_sites(&self) -> Vec<u32> {
        self.body.seam_sites()
    }

    fn stored_energy(&self, u: &[f64]) -> f64 {
        self.body.stored_energy(self.own(u)) + self.impact.energy(u)
    }

    fn account_for_breaks(&mut self, at: &Halfway<'_>) {
        let dofs = self.dofs();
        self.body.account_for_breaks(&Halfway {
            u: &at.u[..dofs],
            v: at.v.get(..dofs).unwrap_or_default(),
            back: at.back,
        });
    }

    fn stress_of_site(&self, site: usize, u: &[f64]) -> Option<PlaceStress> {
        self.body.stress_of_site(site, self.own(u))
    }

    fn energy_densities(&self, u: &[f64]) -> Option<Vec<f64>> {
        self.body.energy_densities(self.own(u))
    }

    fn points_without_response(&self, u: &[f64]) -> usize {
        self.body.points_without_response(self.own(u))
    }

    fn stress_of_cell(&self, cell: usize, u: &[f64]) -> Option<PlaceStress> {
        self.body.stress_of_cell(cell, self.own(u))
    }
}
