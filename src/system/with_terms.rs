//! A body and the force terms beside it as one system.

use std::ops::DerefMut;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::{
    BlockCsr, BodyHistory, BodyState, BondChanges, Dissipation, ElementTangent, FailureUpdate,
    ForceTerm, Halfway, Interval, RateBounds, SemiDiscrete, SharedSteps, Symmetry, Tangent,
};

/// `F_body(u) + Σ F_k(u)`: the sites of the body first, after them those that a term has of its own.
pub struct WithTerms<'t, S> {
    body: S,
    terms: Vec<Arc<dyn ForceTerm + 't>>,
    mass: Vec<f64>,
    /// Unknowns of the body.
    dofs: usize,
    /// True for each term that gave its tangent when asked last.
    known: Vec<AtomicBool>,
    /// Displacement and interval of the last force; none if no term has a history.
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
            known: terms.iter().map(|_| AtomicBool::new(false)).collect(),
            body,
            terms,
        }
    }

    /// The part of a list by dof that belongs to the body.
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
    ) -> BondChanges {
        let (own, rest) = force.split_at_mut(self.dofs);
        rest.fill(0.0);
        let on_body = &u[..self.dofs];
        let changes = (self.body).internal_force_into(on_body, own, interval, breakage);
        self.add_terms(u, force, interval);
        if let Some((at, of)) = &mut self.last {
            at.clear();
            at.extend_from_slice(u);
            *of = interval;
        }
        changes
    }

    fn force_beside_elements_into(&mut self, u: &[f64], force: &mut [f64], interval: Interval) {
        let (own, rest) = force.split_at_mut(self.dofs);
        rest.fill(0.0);
        (self.body).force_beside_elements_into(&u[..self.dofs], own, interval);
        // what gave its tangent with those of elements is not differenced
        for (term, known) in self.terms.iter().zip(&self.known) {
            if !known.load(Ordering::Relaxed) {
                term.add_force(u, force, interval);
            }
        }
    }

    fn take_heat_work(&mut self) -> f64 {
        self.body.take_heat_work()
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

    fn stored_energy(&self, u: &[f64]) -> f64 {
        let of_terms: f64 = self.terms.iter().map(|term| term.energy(u)).sum();
        self.body.stored_energy(self.own(u)) + of_terms
    }

    fn round_off(&self, u: &[f64]) -> f64 {
        let of_terms: f64 = self.terms.iter().map(|term| term.round_off(u)).sum();
        self.body.round_off(self.own(u)) + of_terms
    }

    fn rate_bounds(&self) -> RateBounds {
        let mass = self.body.mass();
        let of_terms: Vec<RateBounds> = (self.terms.iter())
            .map(|term| term.rate_bounds(mass))
            .collect();
        let stiffness: f64 = of_terms.iter().map(|bounds| bounds.stiffness).sum();
        let drag: f64 = of_terms.iter().map(|bounds| bounds.drag).sum();
        let of_body = self.body.rate_bounds();
        RateBounds {
            stiffness: of_body.stiffness + stiffness,
            drag: of_body.drag + drag,
        }
    }

    fn shared_steps(&mut self) -> Option<&mut dyn SharedSteps> {
        None
    }

    fn sites_reached(&self, _own: &[bool]) -> Option<Vec<bool>> {
        None
    }
}

impl<S> Tangent for WithTerms<'_, S>
where
    S: DerefMut + Send + Sync,
    S::Target: SemiDiscrete,
{
    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        let (own, rest) = y.split_at_mut(self.dofs);
        rest.fill(0.0);
        self.body.tangent_into(self.own(x), own);
        for rows in self.terms.iter().filter_map(|term| term.rows(None)) {
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

    fn row_sums(&self) -> Vec<f64> {
        let mut sums = self.body.row_sums();
        for term in &self.terms {
            term.add_row_sums(&mut sums);
        }
        sums
    }

    fn tangent_is_constant(&self) -> Vec<bool> {
        let mut is_constant = self.body.tangent_is_constant();
        is_constant.resize(self.mass.len(), false);
        is_constant
    }

    fn tangent_rows(&self, sites: &[u32]) -> BlockCsr {
        let rows = self.terms.iter().filter_map(|term| term.rows(None));
        rows.fold(self.body.tangent_rows(sites), |sum, rows| {
            rows.added(&sum, sites)
        })
    }

    fn seam_sites(&self) -> Vec<u32> {
        self.body.seam_sites()
    }

    fn symmetry(&self) -> Symmetry {
        self.body.symmetry()
    }

    fn element_tangent(&self, u: &[f64], interval: Interval) -> Option<ElementTangent> {
        let of_terms: Vec<_> = self.terms.iter().map(|t| t.rows(Some(u))).collect();
        for (known, rows) in self.known.iter().zip(&of_terms) {
            known.store(rows.is_some(), Ordering::Relaxed);
        }
        let of_body = self.body.element_tangent(self.own(u), interval);
        if of_body.is_none() && of_terms.iter().all(Option::is_none) {
            return None;
        }
        let mut found = of_body.unwrap_or_else(|| ElementTangent {
            excess: BlockCsr {
                block: self.body.block(),
                row_offsets: vec![0],
                ..BlockCsr::default()
            },
            symmetry: Symmetry::Symmetric,
            is_whole: self.body.difference_length().is_none(),
        });
        // own sites are no nodes
        let end = found.excess.columns.len();
        found.excess.row_offsets.resize(self.mass.len() + 1, end);
        let is_known = |(term, rows): (&Arc<dyn ForceTerm + '_>, &Option<_>)| {
            term.difference_length().is_none() || rows.is_some()
        };
        found.is_whole &= self.terms.iter().zip(&of_terms).all(is_known);
        for rows in of_terms.into_iter().flatten() {
            rows.add_to(&mut found.excess);
        }
        Some(found)
    }
}

impl<S> BodyHistory for WithTerms<'_, S>
where
    S: DerefMut + Send + Sync,
    S::Target: SemiDiscrete,
{
    fn commit(&mut self) {
        self.body.commit();
        if let Some((u, interval)) = self.last.as_ref().filter(|(u, _)| !u.is_empty()) {
            self.terms.iter().for_each(|term| term.commit(u, *interval));
        }
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
        if self.terms.iter().all(|term| term.state().is_empty()) {
            return self.body.restore_damage(state);
        }
        // by the lengths that were kept: a term may remember more later than at the start
        let Some(end) = state.len().checked_sub(self.terms.len()) else {
            return false;
        };
        let (state, lengths) = state.split_at(end);
        let lengths: Vec<usize> = lengths.iter().map(|length| *length as usize).collect();
        let of_terms = lengths
            .iter()
            .try_fold(0usize, |sum, own| sum.checked_add(*own));
        let Some(of_body) = of_terms.and_then(|own| state.len().checked_sub(own)) else {
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

    fn body_state(&self) -> Option<&dyn BodyState> {
        self.body.body_state()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Mutex, PoisonError};

    use super::*;
    use crate::system::{LinearMotion, SpringRows};

    /// A term that remembers the displacements of all intervals.
    #[derive(Default)]
    struct Diary(Mutex<Vec<u64>>);

    impl Diary {
        fn read(&self) -> Vec<u64> {
            self.0
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .clone()
        }
    }

    impl ForceTerm for Diary {
        fn own_masses(&self) -> Vec<f64> {
            Vec::new()
        }

        fn add_force(&self, _u: &[f64], force: &mut [f64], _interval: Interval) {
            force[0] += self.read().len() as f64;
        }

        fn rows(&self, _at: Option<&[f64]>) -> Option<std::borrow::Cow<'_, SpringRows>> {
            None
        }

        fn add_row_sums(&self, _sums: &mut Vec<f64>) {}

        fn difference_length(&self) -> Option<f64> {
            None
        }

        fn rate_bounds(&self, _mass: &[f64]) -> RateBounds {
            RateBounds::default()
        }

        fn round_off(&self, _u: &[f64]) -> f64 {
            0.0
        }

        fn energy(&self, _u: &[f64]) -> f64 {
            0.0
        }

        fn commit(&self, u: &[f64], _interval: Interval) {
            let mut days = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            days.push(u[0].to_bits());
        }

        fn dissipated(&self) -> Option<f64> {
            Some(self.read().len() as f64)
        }

        fn state(&self) -> Vec<u64> {
            let mut all = vec![7];
            all.extend(self.read());
            all
        }

        fn restore(&self, state: &[u64]) -> bool {
            let Some((7, days)) = state.split_first().map(|(first, days)| (*first, days)) else {
                return false;
            };
            *self.0.lock().unwrap_or_else(PoisonError::into_inner) = days.to_vec();
            true
        }
    }

    fn system() -> WithTerms<'static, Box<dyn SemiDiscrete>> {
        let body = LinearMotion {
            stiffness: BlockCsr {
                block: 1,
                row_offsets: vec![0, 1],
                columns: vec![0],
                values: vec![2.0],
                shared: None,
            },
            mass: vec![1.0],
            symmetry: crate::system::Symmetry::Symmetric,
        };
        let terms: Vec<Arc<dyn ForceTerm>> =
            vec![Arc::new(Diary::default()), Arc::new(Diary::default())];
        WithTerms::new(Box::new(body) as Box<dyn SemiDiscrete>, terms)
    }

    #[test]
    fn a_checkpoint_holds_what_terms_have_come_to_remember() {
        let now = Interval {
            end: 1.0,
            length: 1.0,
        };
        let force = |system: &mut WithTerms<'static, Box<dyn SemiDiscrete>>, u: f64| {
            let mut force = [0.0];
            system.internal_force_into(&[u], &mut force, now, FailureUpdate::Frozen);
            force[0]
        };
        let mut system = self::system();
        for u in [0.5, 0.25, 0.125] {
            force(&mut system, u);
            system.commit();
        }
        let state = system.damage_state();
        let mut other = self::system();
        assert!(other.restore_damage(&state));
        assert_eq!(other.damage_state(), state);
        assert_eq!(force(&mut other, 1.0), 2.0 + 3.0 + 3.0);
        assert_eq!(other.dissipation().map(|d| d.inelastic), Some(6.0));
        assert!(!self::system().restore_damage(&state[1..]));
        assert!(!self::system().restore_damage(&[]));
    }
}
