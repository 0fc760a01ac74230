//! Quasi-static motion: load steps, each held until it is in equilibrium and no further bond breaks.
//!
//! At a load step the prescribed dofs and the loads take their values at that (pseudo-)time. Then, in turn, equilibrium is sought with all bonds held
//! as they stand, and bonds beyond their critical stretch break, until none does. Two ways to equilibrium:
//!
//! * **Secant**: `u ← u + K⁻¹ (f − F(u))` with the tangent at rest, broken bonds left out; conjugate gradients or GMRES by its symmetry,
//!   preconditioned by the row sums. One iteration where `F` is linear.
//! * **Relaxation**: the motion `M̃ ü + c M̃ u̇ = f − F(u)` in steps of one, with fictitious masses `m̃_a = ¼ Σ_b |K_ab|` that make the step stable, and
//!   the damping that is critical for the mode in motion, `c = 2 √(v·ΔF / v·M̃ v)` (\[Underwood1983\], with the increment in place of the displacement). It needs
//!   no solve, and pieces that are torn off do not trouble it.

use std::ops::ControlFlow;

use crate::{
    progress::Silent,
    solve::{
        FreeDofs,
        explicit::Drive,
        krylov::{
            KrylovError, KrylovParams, LinearMap, add_scaled, conjugate_gradients, dot, gmres, norm,
        },
    },
    system::{Breakage, Dynamic, Symmetry},
};

/// How equilibrium is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Equilibrium {
    /// By the tangent at rest.
    #[default]
    Secant,
    /// By damped motion.
    Relaxation,
}

/// When a load step is done.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct QuasiStaticParams {
    /// How equilibrium is found.
    pub equilibrium: Equilibrium,
    /// `‖f − F‖₂` on free dofs to be reached, relative to the norm of all internal and external forces.
    pub tolerance: f64,
    /// Products with the stiffness, or passes over the bonds, for one equilibrium.
    pub max_iterations: usize,
    /// Times that bonds may break within one load step.
    pub max_rounds: usize,
}

impl Default for QuasiStaticParams {
    fn default() -> Self {
        QuasiStaticParams {
            equilibrium: Equilibrium::Secant,
            tolerance: 1e-8,
            max_iterations: 50_000,
            max_rounds: 100_000,
        }
    }
}

/// All that a run carries from load step to load step, but for the damage, which the system keeps.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LoadState {
    /// Load steps done.
    pub step: u64,
    /// Displacement \[m\], one entry per dof.
    pub u: Vec<f64>,
    /// Bonds broken since the start.
    pub broken: u64,
}

impl LoadState {
    /// The start, undeformed.
    pub fn at_rest(dofs: usize) -> LoadState {
        LoadState {
            u: vec![0.0; dofs],
            ..LoadState::default()
        }
    }
}

/// A load step that is done, as the observer sees it.
#[derive(Clone, Copy)]
pub struct LoadStep<'a> {
    /// Its (pseudo-)time.
    pub time: f64,
    /// Displacement and counts.
    pub state: &'a LoadState,
    /// Internal force \[N\]: on prescribed dofs the force of the support plus the load.
    pub force: &'a [f64],
    /// Bonds broken in this step.
    pub broken: u64,
    /// How often bonds broke.
    pub rounds: usize,
    /// Products with the stiffness, or passes over the bonds.
    pub iterations: usize,
    /// Relative residual reached.
    pub residual: f64,
    /// What is deformed.
    pub system: &'a dyn Dynamic,
}

/// What a run did.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct QuasiStaticInfo {
    /// Load steps.
    pub steps: u64,
    /// Bonds broken.
    pub broken: u64,
    /// Products with the stiffness, or passes over the bonds.
    pub iterations: usize,
}

/// Why a load step failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum QuasiStaticError {
    /// An input has the wrong length.
    #[error("{what} has {found} entries, the model has {expected}: it belongs to another model")]
    Shape {
        /// Name of the input.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length needed.
        expected: usize,
    },
    /// No equilibrium.
    #[error(
        "load step {step} at time {time} found no equilibrium: the residual is {residual:.1e} of the forces after {iterations} iterations, largest at site {site}; take smaller load steps, or equilibrium = \"relaxation\""
    )]
    NoEquilibrium {
        /// The load step.
        step: u64,
        /// Its time.
        time: f64,
        /// Relative residual.
        residual: f64,
        /// Iterations spent.
        iterations: usize,
        /// Where the residual is largest.
        site: usize,
    },
    /// Bonds never stop breaking.
    #[error(
        "bonds still break after {rounds} rounds of load step {step} at time {time}: {broken} so far; prescribe displacements instead of forces, or run it as explicit dynamics"
    )]
    NeverHolds {
        /// The load step.
        step: u64,
        /// Its time.
        time: f64,
        /// Rounds spent.
        rounds: usize,
        /// Bonds broken in this step.
        broken: u64,
    },
    /// The linear solve failed.
    #[error("load step {step} at time {time}: {source}")]
    Linear {
        /// The load step.
        step: u64,
        /// Its time.
        time: f64,
        /// Why.
        source: KrylovError,
    },
    /// A number is not finite.
    #[error(
        "load step {step} at time {time}: the force at site {site} is not a number; check loads and prescribed displacements there"
    )]
    NotFinite {
        /// The load step.
        step: u64,
        /// Its time.
        time: f64,
        /// The first such site.
        site: usize,
    },
}

/// The tangent at rest on free dofs.
struct Tangent<'a> {
    system: &'a dyn Dynamic,
    free: &'a FreeDofs,
}

impl LinearMap for Tangent<'_> {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        self.system.tangent_into(x, y);
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

/// The work space of a run.
struct Run<'a> {
    system: &'a mut dyn Dynamic,
    params: QuasiStaticParams,
    free: FreeDofs,
    load: Vec<f64>,
    force: Vec<f64>,
    residual: Vec<f64>,
    /// `1/Σ_b |K_ab|`.
    inverse: Vec<f64>,
    step: u64,
    time: f64,
}

/// Runs load steps at `times`, those that `state` has done left out; after each, `observe` may stop.
///
/// # Errors
/// [`QuasiStaticError`], each with load step, time, place and remedy.
pub fn run(
    system: &mut dyn Dynamic,
    drive: &dyn Drive,
    params: QuasiStaticParams,
    times: &[f64],
    state: &mut LoadState,
    observe: &mut dyn FnMut(&LoadStep<'_>) -> ControlFlow<()>,
) -> Result<QuasiStaticInfo, QuasiStaticError> {
    let block = system.block().max(1);
    let dofs = system.mass().len() * block;
    let prescribed = drive.prescribed().to_vec();
    let last = prescribed.iter().max().map_or(0, |&k| k as usize + 1);
    for (what, found, wrong) in [
        ("the displacement", state.u.len(), state.u.len() != dofs),
        ("the list of prescribed dofs", last, last > dofs),
    ] {
        if wrong {
            let expected = dofs;
            return Err(QuasiStaticError::Shape {
                what,
                found,
                expected,
            });
        }
    }
    let mut held = vec![None; dofs];
    prescribed
        .iter()
        .for_each(|&k| held[k as usize] = Some(0.0));
    let mut work = Run {
        inverse: vec![0.0; dofs],
        system,
        params,
        free: FreeDofs::from_prescribed(&held, block),
        load: vec![0.0; dofs],
        force: vec![0.0; dofs],
        residual: vec![0.0; dofs],
        step: state.step,
        time: 0.0,
    };
    let mut values = vec![0.0; prescribed.len()];
    let mut info = QuasiStaticInfo::default();
    for &time in times.iter().skip(state.step as usize) {
        (work.step, work.time) = (state.step, time);
        drive.load_into(time, &mut work.load);
        drive.displacement_into(time, &mut values);
        for (&k, v) in prescribed.iter().zip(&values) {
            state.u[k as usize] = *v;
        }
        let (mut broken, mut rounds, mut iterations) = (0, 0, 0);
        let residual = loop {
            let (count, residual) = work.equilibrium(&mut state.u)?;
            iterations += count;
            let now = work
                .system
                .internal_force_into(&state.u, &mut work.force, Breakage::Allowed);
            if now == 0 {
                break residual;
            }
            broken += now;
            rounds += 1;
            if rounds >= params.max_rounds {
                return Err(QuasiStaticError::NeverHolds {
                    step: work.step,
                    time,
                    rounds,
                    broken,
                });
            }
        };
        state.step += 1;
        state.broken += broken;
        info.steps += 1;
        info.broken += broken;
        info.iterations += iterations;
        let seen = LoadStep {
            time,
            state,
            force: &work.force,
            broken,
            rounds,
            iterations,
            residual,
            system: &*work.system,
        };
        if observe(&seen).is_break() {
            break;
        }
    }
    Ok(info)
}

impl Run<'_> {
    /// Finds equilibrium with bonds held; returns iterations and relative residual.
    fn equilibrium(&mut self, u: &mut [f64]) -> Result<(usize, f64), QuasiStaticError> {
        // broken bonds have left the rows
        for (inverse, sum) in self.inverse.iter_mut().zip(self.system.row_sums()) {
            *inverse = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        }
        match self.params.equilibrium {
            Equilibrium::Secant => self.by_secant(u),
            Equilibrium::Relaxation => self.by_relaxation(u),
        }
    }

    /// `f − F` on free dofs; returns its relative norm.
    fn evaluate(&mut self, u: &[f64]) -> Result<f64, QuasiStaticError> {
        self.system
            .internal_force_into(u, &mut self.force, Breakage::Held);
        for ((r, f), k) in self.residual.iter_mut().zip(&self.load).zip(&self.force) {
            *r = f - k;
        }
        self.free.clear_prescribed(&mut self.residual);
        let scale = norm(&self.force) + norm(&self.load);
        let size = norm(&self.residual);
        if !(size.is_finite() && scale.is_finite()) {
            let bad = |k: &usize| !(self.force[*k].is_finite() && self.load[*k].is_finite());
            let dof = (0..u.len()).find(bad).unwrap_or(0);
            return Err(QuasiStaticError::NotFinite {
                step: self.step,
                time: self.time,
                site: dof / self.free.block(),
            });
        }
        Ok(if scale > 0.0 { size / scale } else { 0.0 })
    }

    fn no_equilibrium(&self, residual: f64, iterations: usize) -> QuasiStaticError {
        let size = |k: usize| self.residual[k].abs();
        let worst =
            (0..self.residual.len()).fold(0, |best, k| if size(k) > size(best) { k } else { best });
        QuasiStaticError::NoEquilibrium {
            step: self.step,
            time: self.time,
            residual,
            iterations,
            site: worst / self.free.block(),
        }
    }

    fn by_secant(&mut self, u: &mut [f64]) -> Result<(usize, f64), QuasiStaticError> {
        let mut iterations = 0;
        let mut residual = self.evaluate(u)?;
        while residual > self.params.tolerance {
            if iterations >= self.params.max_iterations {
                return Err(self.no_equilibrium(residual, iterations));
            }
            let params = KrylovParams {
                tolerance: (0.1 * self.params.tolerance / residual).clamp(1e-13, 1e-2),
                max_iterations: self.params.max_iterations - iterations,
                ..KrylovParams::default()
            };
            let tangent = Tangent {
                system: &*self.system,
                free: &self.free,
            };
            let weights = Diagonal(&self.inverse);
            let solved = match self.system.symmetry() {
                Symmetry::Symmetric => {
                    conjugate_gradients(&tangent, &weights, &self.residual, &params, &Silent)
                }
                Symmetry::Unsymmetric => {
                    gmres(&tangent, &weights, &self.residual, &params, &Silent)
                }
            };
            let (correction, info) = solved.map_err(|source| QuasiStaticError::Linear {
                step: self.step,
                time: self.time,
                source,
            })?;
            iterations += info.iterations.max(1);
            add_scaled(1.0, &correction, u);
            let before = residual;
            residual = self.evaluate(u)?;
            // no nearer: round-off, or a tangent at rest too far from the present one
            if residual > 0.999 * before {
                return Err(self.no_equilibrium(residual, iterations));
            }
        }
        Ok((iterations, residual))
    }

    fn by_relaxation(&mut self, u: &mut [f64]) -> Result<(usize, f64), QuasiStaticError> {
        let mut residual = self.evaluate(u)?;
        let mut last = self.force.clone();
        // `1/m̃`, a tenth heavier than the limit: geometry may stiffen bonds
        let inverse: Vec<f64> = self.inverse.iter().map(|s| s * 4.0 / 1.1).collect();
        let mut v = vec![0.0; u.len()];
        let mut damping = 0.0;
        let mut iterations = 0;
        while residual > self.params.tolerance {
            if iterations >= self.params.max_iterations {
                return Err(self.no_equilibrium(residual, iterations));
            }
            // the first half step from rest has the damping 0 and half of the force
            let (keep, push) = if iterations == 0 {
                (0.0, 0.5)
            } else {
                ((2.0 - damping) / (2.0 + damping), 2.0 / (2.0 + damping))
            };
            for ((v, r), w) in v.iter_mut().zip(&self.residual).zip(&inverse) {
                *v = keep * *v + push * r * w;
            }
            add_scaled(1.0, &v, u);
            last.copy_from_slice(&self.force);
            residual = self.evaluate(u)?;
            iterations += 1;
            let stiffness = dot(&v, &self.force) - dot(&v, &last);
            let mass: f64 = v
                .iter()
                .zip(&inverse)
                .filter(|(_, w)| **w > 0.0)
                .map(|(v, w)| v * v / w)
                .sum();
            damping = if mass > 0.0 {
                (2.0 * (stiffness / mass).max(0.0).sqrt()).min(1.9)
            } else {
                0.0
            };
        }
        Ok((iterations, residual))
    }
}

#[cfg(test)]
#[path = "quasi_static_tests.rs"]
mod tests;
