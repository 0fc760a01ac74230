//! Dynamic relaxation: a damped motion that ends at equilibrium, and the prediction that it sets out along.

use super::error::QuasiStaticError;
use super::newton::{FORCING, leading};
use super::residual::{Residual, Run};
use crate::solve::krylov::{add_scaled, dot, norm};

/// A relaxation whose residual grows by so much will not come back.
const RAN_AWAY: f64 = 1e6;

/// The motion `M̃ ü + c M̃ u̇ = r` in steps of one, with the damping that is critical for the mode in motion.
struct DampedMotion {
    /// `1/m̃`.
    inverse: Vec<f64>,
    v: Vec<f64>,
    damping: f64,
    is_begun: bool,
}

impl DampedMotion {
    /// From rest; `inverse` are the inverse row sums of the tangent.
    fn new(inverse: &[f64]) -> Self {
        Self {
            // a tenth heavier than the limit: geometry may stiffen bonds
            inverse: inverse.iter().map(|s| s * 4.0 / 1.1).collect(),
            v: vec![0.0; inverse.len()],
            damping: 0.0,
            is_begun: false,
        }
    }

    /// Takes a step under the residual `r`.
    fn step(&mut self, r: &[f64], u: &mut [f64]) {
        // the first half step from rest has the damping 0 and half of the force
        let (keep, push) = match self.is_begun {
            false => (0.0, 0.5),
            true => {
                let damping = self.damping;
                ((2.0 - damping) / (2.0 + damping), 2.0 / (2.0 + damping))
            }
        };
        self.is_begun = true;
        for ((v, r), w) in self.v.iter_mut().zip(r).zip(&self.inverse) {
            *v = keep * *v + push * r * w;
        }
        add_scaled(1.0, &self.v, u);
    }

    /// Takes the damping for what the step was resisted by, `v·ΔF`.
    fn damp(&mut self, stiffness: f64) {
        let moving = self.v.iter().zip(&self.inverse);
        let moving = moving.filter(|(_, w)| **w > 0.0);
        let mass: f64 = moving.map(|(v, w)| v * v / w).sum();
        self.damping = if mass > 0.0 {
            (2.0 * (stiffness / mass).max(0.0).sqrt()).min(1.9)
        } else {
            0.0
        };
    }
}

impl Run<'_> {
    /// Finds equilibrium from `u`; returns iterations and the residual.
    pub(super) fn by_relaxation(
        &mut self,
        u: &mut [f64],
    ) -> Result<(usize, Residual), QuasiStaticError> {
        let mut residual = self.evaluate(u)?;
        let first = residual.size;
        let mut last = self.force.clone();
        let mut motion = DampedMotion::new(&self.inverse);
        let mut iterations = 0;
        while !residual.is_enough() {
            if residual.size > RAN_AWAY * first {
                return Err(QuasiStaticError::RanAway {
                    step: self.step,
                    time: self.time,
                    iterations,
                    site: self.worst(),
                });
            }
            if iterations >= self.params.max_iterations {
                return Err(self.no_equilibrium(residual, iterations));
            }
            self.go_on()?;
            motion.step(&self.residual, u);
            last.copy_from_slice(&self.force);
            residual = self.evaluate(u)?;
            iterations += 1;
            let v = &motion.v;
            motion.damp(dot(v, &self.force) - dot(v, &last));
        }
        Ok((iterations, residual))
    }

    /// Adds to a `change` of the displacement what the tangent at rest makes of the residual that it leaves, and returns passes.
    ///
    /// Short waves come to rest first, so that a motion that has not ended has spread the change all the same; one whose residual grows is left out.
    ///
    /// # Errors
    /// [`QuasiStaticError::Interrupted`].
    pub(super) fn predict_by_relaxation(
        &mut self,
        residual: Residual,
        change: &mut [f64],
    ) -> Result<usize, QuasiStaticError> {
        let mut r = self.residual.clone();
        let mut motion = DampedMotion::new(&self.inverse);
        let (mut moved, mut resisted) = (change.to_vec(), vec![0.0; r.len()]);
        let enough = residual.enough.max(FORCING * residual.size);
        let (mut size, mut passes) = (residual.size, 0);
        while size > enough && size < RAN_AWAY * residual.size && passes < leading(r.len()) {
            self.go_on()?;
            motion.step(&r, &mut moved);
            self.system.tangent_into(&motion.v, &mut resisted);
            self.free.clear_prescribed(&mut resisted);
            add_scaled(-1.0, &resisted, &mut r);
            motion.damp(dot(&motion.v, &resisted));
            size = norm(&r);
            passes += 1;
        }
        if size < residual.size {
            change.copy_from_slice(&moved);
        }
        Ok(passes)
    }
}
