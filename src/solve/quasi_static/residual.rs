//! The residual of a load step, and the forces that it is measured by.

use super::error::QuasiStaticError;
use super::lead::Lead;
use super::params::{Aids, Equilibrium, QuasiStaticParams};
use crate::{
    solve::{FreeDofs, krylov::norm},
    system::{FailureUpdate, Interval, SemiDiscrete},
};

/// Round-off of displacements, over them: forces within it of balance cannot come nearer.
const ROUND_OFF: f64 = 8.0 * f64::EPSILON;

/// The least residual, relative to all forces, that is asked for: differences of the lengths of bonds know no more.
pub const TIGHTEST: f64 = 1e-10;

/// Tolerance of states of equilibrium between breaking bonds, where that of the load step is finer: of such a state only the bonds beyond their stretch are asked for, and the last is found to that of the load step.
const BETWEEN: f64 = 1e-5;

/// Largest part of a load that round-off may leave: a body that nothing holds moves until round-off hides any load.
const HIDDEN: f64 = 1e-6;

/// Factor of the forces that moving supports would meet if nothing else moved; the product counts as force. It is about the resistance of an intact body a thousand spacings long.
pub(super) const MOVED: f64 = 1e-3;

/// Remedy where a load acts.
const UNBORNE: &str = "a load that nothing bears has none: hold the body, take smaller load steps, or prescribe displacements instead of forces";

/// Tangent by which a correction is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tangent {
    /// That at rest, broken bonds left out: one pass for a product, and factors at hand.
    AtRest,
    /// That at the present displacement.
    Present,
}

/// The work space of a run.
pub(super) struct Run<'a> {
    pub system: &'a mut dyn SemiDiscrete,
    pub aids: Aids<'a>,
    pub params: QuasiStaticParams,
    pub free: FreeDofs,
    pub load: Vec<f64>,
    pub force: Vec<f64>,
    pub residual: Vec<f64>,
    /// `1/Σ_b |K_ab|`.
    pub inverse: Vec<f64>,
    /// Norm of the forces in the last equilibrium of this load step.
    pub balanced: f64,
    pub step: u64,
    pub time: f64,
    /// From the load step before to this one; of no length at the first.
    pub interval: Interval,
    /// Tangent that leads to equilibrium in this load step.
    pub tangent: Tangent,
    /// True if elements know the whole tangent, so that the present one leads from the start.
    pub is_whole: bool,
    pub lead: Lead,
    /// Relative residuals on the way to the last equilibrium.
    pub residuals: Vec<f64>,
    /// True if bonds are broken.
    pub is_torn: bool,
    /// True while bonds break on: states in between are found to [`BETWEEN`].
    pub is_between: bool,
}

/// `‖f − F‖₂` on free dofs.
#[derive(Clone, Copy)]
pub(super) struct Residual {
    pub size: f64,
    /// The forces that it is measured by.
    pub scale: f64,
    /// Size at which it is small enough.
    pub enough: f64,
}

impl Residual {
    pub fn is_enough(self) -> bool {
        self.size <= self.enough
    }

    pub fn relative(self) -> f64 {
        if self.scale > 0.0 {
            self.size / self.scale
        } else {
            0.0
        }
    }
}

impl Run<'_> {
    /// Broken bonds have left the rows; a bond that turns resists where it did not at rest, so that a site has one number.
    pub fn find_row_sums(&mut self) {
        let sums = self.system.row_sums();
        let block = self.free.block();
        for (inverse, sums) in self.inverse.chunks_mut(block).zip(sums.chunks(block)) {
            let sum = sums.iter().copied().fold(0.0, f64::max);
            inverse.fill(if sum > 0.0 { 1.0 / sum } else { 0.0 });
        }
    }

    /// Reports a step of an iteration.
    ///
    /// # Errors
    /// [`QuasiStaticError::Interrupted`] where the listener asks to end.
    pub fn go_on(&self) -> Result<(), QuasiStaticError> {
        self.aids.progress.advance(0);
        match self.aids.progress.asks_to_end() {
            true => Err(self.interrupted()),
            false => Ok(()),
        }
    }

    pub fn interrupted(&self) -> QuasiStaticError {
        QuasiStaticError::Interrupted {
            step: self.step,
            time: self.time,
        }
    }

    /// `(u Σ_b |K_ab|)²`.
    pub fn resisted(&self, dof: usize, u: f64) -> f64 {
        let inverse = self.inverse[dof];
        if inverse > 0.0 {
            (u / inverse).powi(2)
        } else {
            0.0
        }
    }

    /// The forces that do work: loads on free dofs, internal forces where supports hold.
    pub fn acting(&self) -> Vec<f64> {
        let block = self.free.block();
        (0..self.force.len())
            .map(|k| match self.free.is_free(k / block, k % block) {
                true => self.load[k],
                false => self.force[k],
            })
            .collect()
    }

    /// Returns true if equilibrium is found by Newton's method.
    pub fn is_newton(&self) -> bool {
        self.params.equilibrium == Equilibrium::Newton
    }

    /// Returns true if a load acts.
    pub fn is_loaded(&self) -> bool {
        self.load.iter().any(|f| *f != 0.0)
    }

    /// `f − F` on free dofs, and its norm.
    pub fn evaluate(&mut self, u: &[f64]) -> Result<Residual, QuasiStaticError> {
        self.system
            .internal_force_into(u, &mut self.force, self.interval, FailureUpdate::Frozen);
        for ((r, f), k) in self.residual.iter_mut().zip(&self.load).zip(&self.force) {
            *r = f - k;
        }
        self.free.clear_prescribed(&mut self.residual);
        let forces = norm(&self.force) + norm(&self.load);
        let size = norm(&self.residual);
        if !(size.is_finite() && forces.is_finite()) {
            let bad = |k: &usize| !(self.force[*k].is_finite() && self.load[*k].is_finite());
            let dof = (0..u.len()).find(bad).unwrap_or(0);
            return Err(QuasiStaticError::NotFinite {
                step: self.step,
                time: self.time,
                site: dof / self.free.block(),
            });
        }
        let resisted: f64 = (0..u.len()).map(|k| self.resisted(k, u[k])).sum();
        let mut round_off = ROUND_OFF * resisted.sqrt() + self.system.round_off(u);
        if self.is_loaded() {
            round_off = round_off.min(HIDDEN * norm(&self.load));
        }
        let scale = forces.max(self.balanced);
        let tolerance = match self.is_between {
            true => self.params.tolerance.max(BETWEEN),
            false => self.params.tolerance,
        };
        Ok(Residual {
            size,
            scale,
            enough: (tolerance * scale).max(round_off),
        })
    }

    /// The site at which the residual is largest.
    pub fn worst(&self) -> usize {
        let size = |k: usize| self.residual[k].abs();
        let worst =
            (0..self.residual.len()).fold(0, |best, k| if size(k) > size(best) { k } else { best });
        worst / self.free.block()
    }

    pub fn no_equilibrium(&self, residual: Residual, iterations: usize) -> QuasiStaticError {
        QuasiStaticError::NoEquilibrium {
            step: self.step,
            time: self.time,
            residual: residual.relative(),
            iterations,
            site: self.worst(),
            remedy: if self.is_loaded() {
                UNBORNE
            } else {
                "take smaller load steps, or allow more iterations or a larger residual (max-iterations, tolerance)"
            },
        }
    }
}
