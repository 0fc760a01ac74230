//! A body and the force terms beside it as one system.

use std::ops::DerefMut;
use std::sync::Arc;

use super::wrapped::body_of;
use super::{
    BlockCsr, Dissipation, ElementTangent, FailureUpdate, ForceTerm, Halfway, Interval,
    PlaceStress, SemiDiscrete,
};

/// `F_body(u) + Σ F_k(u)`: the sites of the body first, after them those that a term has of its own.
pub struct WithTerms<'t, S> {
    body: S,
    terms: Vec<Arc<dyn ForceTerm + 't>>,
    mass: Vec<f64>,
    /// Unknowns of the body.
    dofs: usize,
    /// Where the last force was asked for, of terms that remember.
    last: Option<(Vec<f64>, Interval)>,
}

impl<'t, S> WithTerms<'t, S>
where
    S: DerefMut + Send + Sync,
    S::Target: SemiDiscrete,
{
    /// A body, and what acts beside it.
    pub fn new(body: S, terms: Vec<Arc<dyn ForceTerm + 't>>) -> Self {
        let own = terms.iter().flat_map(|term| term.own_masses());
        Self {
            mass: body.mass().iter().copied().chain(own).collect(),
            dofs: body.mass().len() * body.block(),
            last: (terms.iter())
                .any(|term| term.dissipated().is_some() || !term.state().is_empty())
                .then(|| (Vec::new(), Interval::AT_ONCE)),
            body,
            terms,
        }
    }

    /// What the body has of a list by dof.
    fn own<'u>(&self, all: &'u [f64]) -> &'u [f64] {
        &all[..self.dofs]
    }

    fn add_terms(&self, u: &[f64], force: &mut [f64], interval: Interval) {
        for term in &self.terms {
            term.add_force(u, force, interval);
        }
    }

    fn dissipated(&self) -> Option<f64> {
        self.terms
            .iter()
            .filter_map(|t| t.dissipated())
            .reduce(|a, b| a + b)
    }
}

impl<S> SemiDiscrete for WithTerms<'_, S>
where
    S: DerefMut + Send + Sync,
    S::Target: SemiDiscrete,
{
    body_of!(body);

    fn block(&self) -> usize {
        self.body.block()
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
        let (own, rest) = force.split_at_mut(self.dofs);
        rest.fill(0.0);
        let on_body = &u[..self.dofs];
        let broken = (self.body).internal_force_into(on_body, own, interval, breakage);
        self.add_terms(u, force, interval);
        if let Some((at, of)) = &mut self.last {
            at.clear();
            at.extend_from_slice(u);
            *of = interval;
        }
        broken
    }

    fn commit(&mut self) {
        self.body.commit();
        if let Some((u, interval)) = self.last.as_ref().filter(|(u, _)| !u.is_empty()) {
            self.terms.iter().for_each(|term| term.commit(u, *interval));
        }
    }

    fn force_of_heating_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        from: Option<f64>,
        to: f64,
    ) -> bool {
        let (own, rest) = force.split_at_mut(self.dofs);
        let is_heated = (self.body).force_of_heating_into(&u[..self.dofs], own, from, to);
        if is_heated {
            rest.fill(0.0);
            let at_once = Interval {
                end: to,
                length: 0.0,
            };
            self.add_terms(u, force, at_once);
        }
        is_heated
    }

    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        let (own, rest) = y.split_at_mut(self.dofs);
        rest.fill(0.0);
        self.body.tangent_into(self.own(x), own);
        for rows in self.terms.iter().filter_map(|term| term.rows()) {
            rows.add_product(x, y);
        }
    }

    fn difference_length(&self) -> Option<f64> {
        let of_terms = self.terms.iter().filter_map(|t| t.difference_length());
        self.body
            .difference_length()
            .into_iter()
            .chain(of_terms)
            .reduce(f64::min)
    }

    fn element_tangent(&self, u: &[f64], interval: Interval) -> Option<ElementTangent> {
        let mut found = self.body.element_tangent(self.own(u), interval)?;
        // own sites are no nodes; what is not linear is differenced
        let end = found.excess.columns.len();
        found.excess.row_offsets.resize(self.mass.len() + 1, end);
        let is_linear = |t: &Arc<dyn ForceTerm + '_>| t.difference_length().is_none();
        found.is_whole &= self.terms.iter().all(is_linear);
        Some(found)
    }

    fn force_beside_elements_into(&mut self, u: &[f64], force: &mut [f64], interval: Interval) {
        let (own, rest) = force.split_at_mut(self.dofs);
        rest.fill(0.0);
        (self.body).force_beside_elements_into(&u[..self.dofs], own, interval);
        self.add_terms(u, force, interval);
    }

    fn round_off(&self, u: &[f64]) -> f64 {
        let of_terms: f64 = self.terms.iter().map(|term| term.round_off(u)).sum();
        self.body.round_off(self.own(u)) + of_terms
    }

    fn row_sums(&self) -> Vec<f64> {
        let mut sums = self.body.row_sums();
        for term in &self.terms {
            term.add_row_sums(&mut sums);
        }
        sums
    }

    fn contact_frequency_bound(&self) -> f64 {
        let mass = self.body.mass();
        let of_terms: f64 = self
            .terms
            .iter()
            .map(|t| t.rate_bounds(mass).stiffness)
            .sum();
        self.body.contact_frequency_bound() + of_terms
    }

    fn drag_rate_bound(&self) -> f64 {
        let mass = self.body.mass();
        let of_terms: f64 = self.terms.iter().map(|t| t.rate_bounds(mass).drag).sum();
        self.body.drag_rate_bound() + of_terms
    }

    fn tangent_is_constant(&self) -> Vec<bool> {
        let mut is_constant = self.body.tangent_is_constant();
        is_constant.resize(self.mass.len(), false);
        is_constant
    }

    fn tangent_rows(&self, sites: &[u32]) -> BlockCsr {
        let rows = self.terms.iter().filter_map(|term| term.rows());
        rows.fold(self.body.tangent_rows(sites), |sum, rows| {
            rows.added(&sum, sites)
        })
    }

    fn stored_energy(&self, u: &[f64]) -> f64 {
        let of_terms: f64 = self.terms.iter().map(|term| term.energy(u)).sum();
        self.body.stored_energy(self.own(u)) + of_terms
    }

    fn dissipation(&self) -> Option<Dissipation> {
        let Some(of_terms) = self.dissipated() else {
            return self.body.dissipation();
        };
        let mut all = self.body.dissipation().unwrap_or_default();
        all.inelastic += of_terms;
        Some(all)
    }

    fn set_dissipation(&mut self, mut dissipation: Dissipation) {
        dissipation.inelastic -= self.dissipated().unwrap_or(0.0);
        self.body.set_dissipation(dissipation);
    }

    fn account_for_breaks(&mut self, at: &Halfway<'_>) {
        self.body.account_for_breaks(&Halfway {
            u: &at.u[..self.dofs],
            v: at.v.get(..self.dofs).unwrap_or_default(),
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

    fn damage_state(&self) -> Vec<u64> {
        let mut all = self.body.damage_state();
        let states: Vec<Vec<u64>> = self.terms.iter().map(|term| term.state()).collect();
        // terms without memory leave no trace
        if states.iter().any(|state| !state.is_empty()) {
            states.iter().for_each(|state| all.extend(state));
            all.extend(states.iter().map(|state| state.len() as u64));
        }
        all
    }

    fn restore_damage(&mut self, state: &[u64]) -> bool {
        let lengths: Vec<usize> = self.terms.iter().map(|t| t.state().len()).collect();
        let of_terms: usize = lengths.iter().sum();
        if of_terms == 0 {
            return self.body.restore_damage(state);
        }
        let Some(of_body) = state.len().checked_sub(of_terms + lengths.len()) else {
            return false;
        };
        let (body, mut rest) = state.split_at(of_body);
        let mut fits = self.body.restore_damage(body);
        for (term, length) in self.terms.iter().zip(lengths) {
            let (own, others) = rest.split_at(length);
            fits &= term.restore(own);
            rest = others;
        }
        fits
    }
}
