//! Solves with the consistent tangent of finite elements, and the renewal of its factors.
//!
//! The tangent at a displacement is `K₀ + ΔK` where elements are all that is not linear ([`ElementTangent`]): products are exact, and corrections converge quadratically. Beside
//! other forces that are not linear, `ΔK` is a product and only those forces are differenced.
//!
//! The preconditioner is the factors at hand, those of the tangent at rest at first. What an iteration with them has cost is added up; once it reaches what a factorisation costs, factors are made of the present
//! tangent. Whatever follows, no more than twice the time is spent that the better of the two would have taken from there on. Each load step begins with the factors at rest again, so that a run that
//! resumes has the bits of one that went through. Where bonds have broken, factors of the tangent that is left are made by the same rule, from its products.

use std::sync::{Mutex, PoisonError};

use super::params::{Aids, Refactor};
use super::residual::Run;
use crate::{
    solve::{
        FreeDofs,
        krylov::{KrylovError, KrylovInfo, KrylovParams, LinearMap, conjugate_gradients, gmres},
    },
    system::{ElementTangent, FailureUpdate, Interval, SemiDiscrete, Symmetry},
};

/// The tangent at rest on free dofs.
pub(super) struct AtRest<'a> {
    pub system: &'a dyn SemiDiscrete,
    pub free: &'a FreeDofs,
}

impl LinearMap for AtRest<'_> {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        self.system.tangent_into(x, y);
        self.free.clear_prescribed(y);
    }
}

/// The tangent at rest and what elements have beyond it, on free dofs.
struct Whole<'a> {
    system: &'a dyn SemiDiscrete,
    elements: &'a ElementTangent,
    free: &'a FreeDofs,
}

impl LinearMap for Whole<'_> {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        self.system.tangent_into(x, y);
        add_product(self.elements, x, y);
        self.free.clear_prescribed(y);
    }
}

/// The tangent at a displacement on free dofs, by differences of forces and, where it is known, what elements have.
struct Present<'a> {
    /// The system, and room for displacements.
    system: Mutex<(&'a mut dyn SemiDiscrete, Vec<f64>)>,
    free: &'a FreeDofs,
    u: &'a [f64],
    /// The forces at `u` that are differenced.
    force: &'a [f64],
    interval: Interval,
    /// Largest change of a displacement.
    length: f64,
    elements: Option<&'a ElementTangent>,
}

impl LinearMap for Present<'_> {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        let largest = x.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        if largest == 0.0 {
            y.fill(0.0);
            return;
        }
        let part = self.length / largest;
        let mut held = self.system.lock().unwrap_or_else(PoisonError::into_inner);
        let (system, moved) = &mut *held;
        moved.clear();
        moved.extend(self.u.iter().zip(x).map(|(u, x)| u + part * x));
        match self.elements {
            Some(_) => system.force_beside_elements_into(moved, y, self.interval),
            None => {
                system.internal_force_into(moved, y, self.interval, FailureUpdate::Frozen);
            }
        }
        for (y, f) in y.iter_mut().zip(self.force) {
            *y = (*y - f) / part;
        }
        if let Some(elements) = self.elements {
            add_product(elements, x, y);
        }
        self.free.clear_prescribed(y);
    }
}

/// The inverse of the row sums.
struct Diagonal<'a>(&'a [f64]);

impl LinearMap for Diagonal<'_> {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        for ((y, x), s) in y.iter_mut().zip(x).zip(self.0) {
            *y = x * s;
        }
    }
}

/// `y += ΔK x`.
pub(super) fn add_product(elements: &ElementTangent, x: &[f64], y: &mut [f64]) {
    let product = elements.excess.multiply(x);
    y.iter_mut().zip(&product).for_each(|(y, p)| *y += p);
}

/// Fewer iterations than these are not worth a trial with the factors at hand: a correction seldom takes so few.
const WORTH_TRYING: usize = 3;

/// Solves with the factors at hand.
fn solve(
    tangent: &dyn LinearMap,
    near: &dyn LinearMap,
    residual: &[f64],
    symmetry: Symmetry,
    params: &KrylovParams,
    aids: &Aids<'_>,
) -> Result<(Vec<f64>, KrylovInfo), KrylovError> {
    match symmetry {
        Symmetry::Symmetric => conjugate_gradients(tangent, near, residual, params, aids.progress),
        Symmetry::Unsymmetric => gmres(tangent, near, residual, params, aids.progress),
    }
}

impl Run<'_> {
    /// Solves with the tangent at rest.
    pub(super) fn solve_at_rest(
        &self,
        params: &KrylovParams,
    ) -> Result<(Vec<f64>, KrylovInfo), KrylovError> {
        let tangent = AtRest {
            system: &*self.system,
            free: &self.free,
        };
        let diagonal = Diagonal(&self.inverse);
        let own = self.lead.factors.as_deref();
        let near = own.or(self.aids.near).unwrap_or(&diagonal);
        let symmetry = self.system.symmetry();
        solve(&tangent, near, &self.residual, symmetry, params, &self.aids)
    }

    /// Solves with the tangent at `u`, of which elements have `known`; the solution, and iterations.
    pub(super) fn solve_at_present(
        &mut self,
        u: &[f64],
        length: f64,
        known: Option<&ElementTangent>,
        params: &KrylovParams,
    ) -> Result<(Vec<f64>, usize), KrylovError> {
        let mut beside = Vec::new();
        if known.is_some_and(|known| !known.is_whole) {
            beside = vec![0.0; u.len()];
            let interval = self.interval;
            self.system
                .force_beside_elements_into(u, &mut beside, interval);
        }
        let refactor = self.aids.refactor.filter(|_| !self.lead.is_useless);
        let (Some(known), Some(refactor)) = (known, refactor) else {
            let done = self.iterate(u, length, known, &beside, params);
            return done.map(|(solution, info)| (solution, info.iterations));
        };
        let left = refactor.worth().saturating_sub(self.lead.spent);
        let mut before = 0;
        if left >= WORTH_TRYING {
            let limited = KrylovParams {
                max_iterations: params.max_iterations.min(left),
                ..*params
            };
            match self.iterate(u, length, Some(known), &beside, &limited) {
                Ok((solution, info)) => {
                    self.lead.spent += info.iterations - info.iterations.min(1);
                    self.lead.last = info.iterations;
                    return Ok((solution, info.iterations));
                }
                Err(end @ KrylovError::Interrupted { .. }) => return Err(end),
                Err(KrylovError::NotConverged { iterations, .. }) => before = iterations,
                Err(KrylovError::Indefinite { iteration }) => before = iteration,
            }
        }
        self.make_factors(known, refactor);
        let (solution, info) = self.iterate(u, length, Some(known), &beside, params)?;
        self.lead.spent = info.iterations - info.iterations.min(1);
        let last = if before > 0 { before } else { self.lead.last };
        self.lead.is_useless = !known.is_whole && 2 * info.iterations > last;
        self.lead.last = info.iterations;
        Ok((solution, before + info.iterations))
    }

    /// Makes factors of the tangent at rest without the broken bonds, once iterations with those at hand have cost as much; beside elements that know their tangent, factors are of that.
    pub(super) fn leave_out_broken(&mut self) {
        let Some(refactor) = self.aids.refactor.filter(|_| self.is_torn) else {
            return;
        };
        if self.lead.spent_torn == 0 || self.lead.spent_torn < refactor.worth_of_products() {
            return;
        }
        let tangent = AtRest {
            system: &*self.system,
            free: &self.free,
        };
        self.lead.spent_torn = 0;
        self.lead.factorisations += 1;
        if let Some(factors) = refactor.factors_of(&tangent, self.system.symmetry()) {
            self.lead.factors = Some(factors);
        }
    }

    /// Makes factors of the present tangent; those at hand stay where it has none.
    fn make_factors(&mut self, known: &ElementTangent, refactor: &dyn Refactor) {
        let symmetry = self.symmetry_with(known);
        self.lead.factorisations += 1;
        if let Some(factors) = refactor.factors(known, symmetry) {
            self.lead.factors = Some(factors);
        }
    }

    /// Returns the symmetry of the tangent together with that of the elements.
    fn symmetry_with(&self, known: &ElementTangent) -> Symmetry {
        match self.system.symmetry() {
            Symmetry::Symmetric => known.symmetry,
            unsymmetric => unsymmetric,
        }
    }

    fn iterate(
        &mut self,
        u: &[f64],
        length: f64,
        known: Option<&ElementTangent>,
        beside: &[f64],
        params: &KrylovParams,
    ) -> Result<(Vec<f64>, KrylovInfo), KrylovError> {
        let symmetry = match known {
            Some(known) => self.symmetry_with(known),
            None => self.system.symmetry(),
        };
        let diagonal = Diagonal(&self.inverse);
        let own = self.lead.factors.as_deref();
        let near = own.or(self.aids.near).unwrap_or(&diagonal);
        let solve = |tangent: &dyn LinearMap| {
            solve(tangent, near, &self.residual, symmetry, params, &self.aids)
        };
        match known {
            Some(elements) if elements.is_whole => solve(&Whole {
                system: &*self.system,
                elements,
                free: &self.free,
            }),
            _ => solve(&Present {
                system: Mutex::new((&mut *self.system, Vec::new())),
                free: &self.free,
                u,
                force: if known.is_some() { beside } else { &self.force },
                interval: self.interval,
                length,
                elements: known,
            }),
        }
    }
}
