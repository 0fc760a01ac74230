//! Newton's method without a matrix: products with the tangent are passes over the bonds.
//!
//! The tangent at the displacement `u`, `J x = dF/du x`, is the difference of forces `(F(u + εx) − F(u))/ε` with bonds held and the interval of the load step, so that any law has it (\[KnollKeyes2004\]).
//! Each correction costs a linear solve, as far as it pays, and is halved until the residual falls.

use super::consistent::add_product;
use super::error::QuasiStaticError;
use super::lead::Lead;
use super::residual::{Residual, Run, Tangent};
use crate::solve::krylov::{KrylovError, KrylovParams, add_scaled, norm};
use crate::system::{ElementTangent, Interval};

/// The residual over that before, beyond which the tangent at rest leads too slowly.
const SLOW: f64 = 0.1;

/// The residual of a linear solve for a force that is not linear: what is solved further is lost to the next correction.
pub(super) const FORCING: f64 = 1e-3;

/// So many corrections in a row that leave more than half of the residual lead nowhere in a body of which bonds are broken: what hangs by few of them turns too far
/// with each. In a whole body they are slow where flow spreads, and lead on.
const MOST_SLOW: usize = 3;

/// Least fall of the residual over what the length of a correction promises (Armijo's condition).
const LEAST_FALL: f64 = 1e-4;

/// The shortest part of a correction that is taken.
const SHORTEST: f64 = 1.0 / 1024.0;

/// The most products for one correction of so many dofs: some lengths of the body for a signal that crosses it by one family a product. Fragments that a crack leaves behind
/// have no stiffness at rest, and more products find none.
pub(super) fn leading(dofs: usize) -> usize {
    500 + 5 * dofs.isqrt()
}

impl Run<'_> {
    /// Gives prescribed dofs the `values` of a load step, and all others what the tangent at rest predicts; returns iterations.
    pub(super) fn set_out(
        &mut self,
        u: &mut [f64],
        prescribed: &[u32],
        values: &[f64],
    ) -> Result<usize, QuasiStaticError> {
        self.tangent = Tangent::AtRest;
        self.is_whole = false;
        self.lead = Lead::default();
        let mut change = vec![0.0; u.len()];
        for (&k, v) in prescribed.iter().zip(values) {
            change[k as usize] = v - u[k as usize];
        }
        let mut iterations = 0;
        // where forces are linear the first correction does the same
        if self.system.difference_length().is_some() {
            let mut residual = self.evaluate(u)?;
            residual = self.heat(u, residual);
            let mut resisted = vec![0.0; u.len()];
            self.system.tangent_into(&change, &mut resisted);
            residual = self.resist(residual, &resisted);
            if !residual.is_enough() && !self.is_newton() {
                iterations = self.predict_by_relaxation(residual, &mut change)?;
            } else if !residual.is_enough() {
                let known = self.system.element_tangent(u, self.interval);
                let known = known.filter(|elements| elements.is_whole);
                if let Some(elements) = &known {
                    self.is_whole = true;
                    self.tangent = Tangent::Present;
                    let mut excess = vec![0.0; u.len()];
                    add_product(elements, &change, &mut excess);
                    residual = self.resist(residual, &excess);
                }
                match self.correction(u, residual, 0.0, 0, known) {
                    Ok((correction, count)) => {
                        add_scaled(1.0, &correction, &mut change);
                        iterations = count;
                    }
                    Err(end @ QuasiStaticError::Interrupted { .. }) => return Err(end),
                    // where there is no prediction the first correction tells why
                    Err(_) => self.tangent = Tangent::Present,
                }
            }
        }
        add_scaled(1.0, &change, u);
        // exactly, not by a sum
        for (&k, v) in prescribed.iter().zip(values) {
            u[k as usize] = *v;
        }
        Ok(iterations)
    }

    /// The residual with the change of temperature to first order, where bonds know theirs.
    fn heat(&mut self, u: &[f64], residual: Residual) -> Residual {
        let Interval { end, length } = self.interval;
        let from = (length > 0.0).then_some(end - length);
        let mut force = vec![0.0; u.len()];
        if !(self.system).force_of_heating_into(u, &mut force, from, end) {
            return residual;
        }
        for ((r, f), k) in self.residual.iter_mut().zip(&self.load).zip(&force) {
            *r = f - k;
        }
        self.free.clear_prescribed(&mut self.residual);
        Residual {
            size: norm(&self.residual),
            ..residual
        }
    }

    /// Takes what a change is resisted by from the residual.
    fn resist(&mut self, residual: Residual, resisted: &[f64]) -> Residual {
        for (r, k) in self.residual.iter_mut().zip(resisted) {
            *r -= k;
        }
        self.free.clear_prescribed(&mut self.residual);
        Residual {
            size: norm(&self.residual),
            ..residual
        }
    }

    /// Solves for the correction of the displacement by the residual at `u`, and counts iterations; `before` is the size of the residual at the correction before, zero at the first, `spent` are the iterations so far, `known` is what elements have of the tangent if that is computed.
    fn correction(
        &mut self,
        u: &[f64],
        residual: Residual,
        before: f64,
        spent: usize,
        known: Option<ElementTangent>,
    ) -> Result<(Vec<f64>, usize), QuasiStaticError> {
        let wanted = (0.1 * residual.enough / residual.size).clamp(1e-13, 1e-2);
        let length = self.system.difference_length();
        let left = self.params.max_iterations - spent;
        // what is solved further than the tangent holds is lost: quadratic convergence asks for the square of what the correction before left [EisenstatWalker1996]
        let forcing = match self.is_whole {
            true => FORCING.min((residual.size / before).powi(2)),
            false => FORCING,
        };
        let params = KrylovParams {
            tolerance: match length {
                None => wanted,
                Some(_) => wanted.max(forcing),
            },
            max_iterations: match length {
                None => left,
                Some(_) => left.min(leading(u.len())),
            },
            ..KrylovParams::default()
        };
        let remedy = match (self.is_loaded(), self.aids.near) {
            (true, _) => {
                "a load that nothing bears has none: hold the body, or prescribe displacements instead of forces"
            }
            (_, None) => {
                "take solver.method = \"direct\", whose factors lead the iteration, or smaller load steps"
            }
            _ => "take smaller load steps",
        };
        let known = match (self.tangent, length) {
            (Tangent::Present, Some(_)) => {
                known.or_else(|| self.system.element_tangent(u, self.interval))
            }
            (Tangent::AtRest, _) | (Tangent::Present, None) => None,
        };
        if known.is_none() {
            self.leave_out_broken();
        }
        let solved = match (self.tangent, length) {
            (Tangent::Present, Some(length)) => {
                self.solve_at_present(u, length, known.as_ref(), &params)
            }
            _ => {
                let solved = self.solve_at_rest(&params);
                solved.map(|(solution, info)| (solution, info.iterations))
            }
        };
        let (step, time) = (self.step, self.time);
        let (correction, iterations) = solved.map_err(|source| match source {
            KrylovError::Interrupted { .. } => self.interrupted(),
            source => QuasiStaticError::Linear {
                step,
                time,
                source,
                remedy,
            },
        })?;
        self.lead.spent_torn += iterations.saturating_sub(1);
        Ok((correction, iterations.max(1)))
    }

    /// Returns true if there is another tangent to try where this one leads nowhere: that at the present displacement after that at rest, and the other way round where elements know the present one and it leads from the start.
    fn has_other_tangent(&self) -> bool {
        match self.tangent {
            Tangent::AtRest => !self.is_whole,
            Tangent::Present => self.is_whole,
        }
    }

    fn take_other_tangent(&mut self) {
        self.tangent = match self.tangent {
            Tangent::AtRest => Tangent::Present,
            Tangent::Present => Tangent::AtRest,
        };
    }

    /// Finds equilibrium from `u`; returns iterations and the residual.
    pub(super) fn by_newton(
        &mut self,
        u: &mut [f64],
    ) -> Result<(usize, Residual), QuasiStaticError> {
        let is_linear = self.system.difference_length().is_none();
        let mut iterations = 0;
        let mut residual = self.evaluate(u)?;
        let (mut slow, mut before) = (0, 0.0);
        self.residuals = vec![residual.relative()];
        while !residual.is_enough() {
            if iterations >= self.params.max_iterations || slow == MOST_SLOW {
                return Err(self.no_equilibrium(residual, iterations));
            }
            self.go_on()?;
            let (correction, count) = match self.correction(u, residual, before, iterations, None) {
                Err(end @ QuasiStaticError::Interrupted { .. }) => return Err(end),
                Err(_) if self.has_other_tangent() && !is_linear => {
                    self.take_other_tangent();
                    continue;
                }
                found => found?,
            };
            iterations += count;
            let start = u.to_vec();
            let is_tried_once = is_linear || (self.tangent == Tangent::AtRest && !self.is_whole);
            let mut part = 1.0;
            let fallen = loop {
                for ((u, s), c) in u.iter_mut().zip(&start).zip(&correction) {
                    *u = s + part * c;
                }
                let least = (1.0 - LEAST_FALL * part) * residual.size;
                match self.evaluate(u) {
                    Ok(now) if now.is_enough() || now.size <= least => break Some(now),
                    _ if is_tried_once || part <= SHORTEST => break None,
                    _ => part *= 0.5,
                }
            };
            let Some(now) = fallen else {
                u.copy_from_slice(&start);
                residual = self.evaluate(u)?;
                if is_linear || !self.has_other_tangent() {
                    return Err(self.no_equilibrium(residual, iterations));
                }
                self.take_other_tangent();
                continue;
            };
            let is_slow = now.size > 0.5 * residual.size;
            let counts = match self.tangent {
                Tangent::Present => self.is_torn,
                Tangent::AtRest => self.is_whole,
            };
            slow = if is_slow && counts && !is_linear {
                slow + 1
            } else {
                0
            };
            if self.is_whole || now.size > SLOW * residual.size {
                self.tangent = Tangent::Present;
            }
            before = residual.size;
            residual = now;
            self.residuals.push(residual.relative());
        }
        Ok((iterations, residual))
    }
}
