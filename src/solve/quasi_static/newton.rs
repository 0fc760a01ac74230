//! Newton's method without a matrix: products with the tangent are passes over the bonds.
//!
//! The tangent at the displacement `u`, `J x = dF/du x`, is the difference of forces `(F(u + εx) − F(u))/ε` with bonds held and the interval of the load step, so that any law has it (\[KnollKeyes2004\]).
//! Each correction costs a linear solve, as far as it pays, and is halved until the residual falls. A load step sets out along the linear prediction, which
//! moves all of the body: supports that move alone would strain the bonds beside them far beyond what the body ever sees.

use std::sync::{Mutex, PoisonError};

use super::error::QuasiStaticError;
use super::residual::{Residual, Run, Tangent};
use crate::{
    solve::{
        FreeDofs,
        krylov::{
            KrylovError, KrylovParams, LinearMap, add_scaled, conjugate_gradients, gmres, norm,
        },
    },
    system::{FailureUpdate, Interval, SemiDiscrete, Symmetry},
};

/// The residual over that before, beyond which the tangent at rest leads too slowly.
const SLOW: f64 = 0.1;

/// The residual of a linear solve for a force that is not linear: what is solved further is lost to the next correction.
const FORCING: f64 = 1e-3;

/// So many corrections in a row that leave more than half of the residual lead nowhere in a body of which bonds are broken: what hangs by few of them turns too far
/// with each. In a whole body they are slow where flow spreads, and lead on.
const MOST_SLOW: usize = 3;

/// Least fall of the residual over what the length of a correction promises (Armijo's condition).
const LEAST_FALL: f64 = 1e-4;

/// The shortest part of a correction that is taken.
const SHORTEST: f64 = 1.0 / 1024.0;

/// The most products for one correction of so many dofs: some lengths of the body for a signal that crosses it by one family a product. Fragments that a crack leaves behind
/// have no stiffness at rest, and more products find none.
fn leading(dofs: usize) -> usize {
    500 + 5 * dofs.isqrt()
}

/// The tangent at rest on free dofs.
struct AtRest<'a> {
    system: &'a dyn SemiDiscrete,
    free: &'a FreeDofs,
}

impl LinearMap for AtRest<'_> {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        self.system.tangent_into(x, y);
        self.free.clear_prescribed(y);
    }
}

/// The tangent at a displacement on free dofs.
struct Present<'a> {
    /// The system, and room for displacements.
    system: Mutex<(&'a mut dyn SemiDiscrete, Vec<f64>)>,
    free: &'a FreeDofs,
    u: &'a [f64],
    /// `F(u)`.
    force: &'a [f64],
    interval: Interval,
    /// Largest change of a displacement.
    length: f64,
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
        system.internal_force_into(moved, y, self.interval, FailureUpdate::Frozen);
        for (y, f) in y.iter_mut().zip(self.force) {
            *y = (*y - f) / part;
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

impl Run<'_> {
    /// Gives prescribed dofs the `values` of a load step, and with Newton's method all others what the tangent at rest predicts; returns iterations.
    pub(super) fn set_out(
        &mut self,
        u: &mut [f64],
        prescribed: &[u32],
        values: &[f64],
    ) -> Result<usize, QuasiStaticError> {
        self.tangent = Tangent::AtRest;
        let mut change = vec![0.0; u.len()];
        for (&k, v) in prescribed.iter().zip(values) {
            change[k as usize] = v - u[k as usize];
        }
        let mut iterations = 0;
        // where forces are linear the first correction does the same
        if self.is_newton() && self.system.difference_length().is_some() {
            let mut residual = self.evaluate(u)?;
            let mut resisted = vec![0.0; u.len()];
            self.system.tangent_into(&change, &mut resisted);
            for (r, k) in self.residual.iter_mut().zip(&resisted) {
                *r -= k;
            }
            self.free.clear_prescribed(&mut self.residual);
            residual.size = norm(&self.residual);
            if !residual.is_enough() {
                match self.correction(u, residual, 0) {
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

    /// What the tangent makes of the residual at `u`, and iterations; `spent` are those so far.
    fn correction(
        &mut self,
        u: &[f64],
        residual: Residual,
        spent: usize,
    ) -> Result<(Vec<f64>, usize), QuasiStaticError> {
        let wanted = (0.1 * residual.enough / residual.size).clamp(1e-13, 1e-2);
        let length = self.system.difference_length();
        let left = self.params.max_iterations - spent;
        let params = KrylovParams {
            tolerance: match length {
                None => wanted,
                Some(_) => wanted.max(FORCING),
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
        let diagonal = Diagonal(&self.inverse);
        let near = self.aids.near.unwrap_or(&diagonal);
        let progress = self.aids.progress;
        let symmetry = self.system.symmetry();
        let solve = |tangent: &dyn LinearMap| match symmetry {
            Symmetry::Symmetric => {
                conjugate_gradients(tangent, near, &self.residual, &params, progress)
            }
            Symmetry::Unsymmetric => gmres(tangent, near, &self.residual, &params, progress),
        };
        let solved = match (self.tangent, length) {
            (Tangent::Present, Some(length)) => solve(&Present {
                system: Mutex::new((&mut *self.system, Vec::new())),
                free: &self.free,
                u,
                force: &self.force,
                interval: self.interval,
                length,
            }),
            _ => solve(&AtRest {
                system: &*self.system,
                free: &self.free,
            }),
        };
        let (step, time) = (self.step, self.time);
        let (correction, info) = solved.map_err(|source| match source {
            KrylovError::Interrupted { .. } => self.interrupted(),
            source => QuasiStaticError::Linear {
                step,
                time,
                source,
                remedy,
            },
        })?;
        Ok((correction, info.iterations.max(1)))
    }

    /// Finds equilibrium from `u`; returns iterations and the residual.
    pub(super) fn by_newton(
        &mut self,
        u: &mut [f64],
    ) -> Result<(usize, Residual), QuasiStaticError> {
        let is_linear = self.system.difference_length().is_none();
        let mut iterations = 0;
        let mut residual = self.evaluate(u)?;
        let mut slow = 0;
        while !residual.is_enough() {
            if iterations >= self.params.max_iterations || slow == MOST_SLOW {
                return Err(self.no_equilibrium(residual, iterations));
            }
            self.go_on()?;
            let (correction, count) = match self.correction(u, residual, iterations) {
                Err(end @ QuasiStaticError::Interrupted { .. }) => return Err(end),
                Err(_) if self.tangent == Tangent::AtRest && !is_linear => {
                    self.tangent = Tangent::Present;
                    continue;
                }
                found => found?,
            };
            iterations += count;
            let start = u.to_vec();
            let mut part = 1.0;
            let fallen = loop {
                for ((u, s), c) in u.iter_mut().zip(&start).zip(&correction) {
                    *u = s + part * c;
                }
                let least = (1.0 - LEAST_FALL * part) * residual.size;
                match self.evaluate(u) {
                    Ok(now) if now.is_enough() || now.size <= least => break Some(now),
                    _ if is_linear || self.tangent == Tangent::AtRest || part <= SHORTEST => {
                        break None;
                    }
                    _ => part *= 0.5,
                }
            };
            let is_last = is_linear || self.tangent == Tangent::Present;
            let Some(now) = fallen else {
                u.copy_from_slice(&start);
                residual = self.evaluate(u)?;
                if is_last {
                    return Err(self.no_equilibrium(residual, iterations));
                }
                self.tangent = Tangent::Present;
                continue;
            };
            let is_slow = self.tangent == Tangent::Present && now.size > 0.5 * residual.size;
            slow = if is_slow && self.is_torn && !is_linear {
                slow + 1
            } else {
                0
            };
            if now.size > SLOW * residual.size {
                self.tangent = Tangent::Present;
            }
            residual = now;
        }
        Ok((iterations, residual))
    }
}
