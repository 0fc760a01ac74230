//! Quasi-static motion: load steps, each held until it is in equilibrium and no further bond breaks.
//!
//! At a load step the prescribed dofs and the loads take their values at that (pseudo-)time. Then, in turn, equilibrium is sought with all bonds held
//! as they stand, and bonds beyond their critical stretch break, until none does. Two ways to equilibrium:
//!
//! * **Newton** (`newton.rs`): `u ← u + K⁻¹ (f − F(u))`, with the tangent at rest while that leads quickly, else with that at the present displacement; conjugate gradients or GMRES by
//!   its symmetry, preconditioned by the factors of the tangent before bonds broke, or by the row sums. One iteration where `F` is linear; where it gets stuck, relaxation goes on.
//! * **Relaxation** (`relaxation.rs`): the motion `M̃ ü + c M̃ u̇ = f − F(u)` in steps of one, with fictitious masses `m̃_a = ¼ Σ_b |K_ab|` that make the step stable, and
//!   the damping that is critical for the mode in motion, `c = 2 √(v·ΔF / v·M̃ v)` (\[Underwood1983\], with the increment in place of the displacement). It needs
//!   no solve, and needs eigenvalues that are real and not negative.
//!
//! Both set out along the linear prediction, which moves all of the body: supports that move alone would strain the bonds beside them far beyond what the body ever sees, and a law that
//! softens would settle there.
//!
//! While bonds break on, states in between are found to a tolerance of 1e-5; one in which none breaks is then found to that of the load step, and looked at again.
//!
//! Pieces that are torn off trouble neither: what acts on them is in balance. Where all is torn apart no force is left to measure a residual by; so it
//! is measured by the largest of the load step too, and is done at the round-off of the displacement.

use std::ops::ControlFlow;

use lead::Lead;
use pacing::Limits;
use residual::{MOVED, Run, Tangent};

use crate::{
    solve::{FreeDofs, explicit::Drive},
    system::{Dissipation, FailureUpdate, Halfway, Interval, SemiDiscrete},
};

mod consistent;
mod error;
mod factors;
mod lead;
mod load_state;
mod newton;
mod pacing;
mod params;
mod relaxation;
mod residual;

pub use error::QuasiStaticError;
pub use factors::TangentFactors;
pub use load_state::LoadState;
pub use pacing::{Adaptive, Pacing};
pub use params::{Aids, Equilibrium, QuasiStaticParams, Refactor};
pub use residual::TIGHTEST;

/// A load step that is done, as the observer sees it.
#[derive(Clone, Copy)]
pub struct LoadStep<'a> {
    /// Its (pseudo-)time.
    pub time: f64,
    /// Displacement and counts.
    pub state: &'a LoadState,
    /// Internal force \[N\]: on prescribed dofs the force of the support plus the load.
    pub force: &'a [f64],
    /// Applied load \[N\].
    pub load: &'a [f64],
    /// Work that loads, supports and heating did in this step \[J\]: supports on the way to the first equilibrium, before a bond breaks, by the mean of the forces at its ends; loads all the way.
    pub work: f64,
    /// Bonds broken in this step.
    pub broken: u64,
    /// Rounds in which bonds broke.
    pub rounds: usize,
    /// Products with the stiffness, or passes over the bonds, those of longer steps that were given up included.
    pub iterations: usize,
    /// Factorisations of the tangent.
    pub factorisations: usize,
    /// Relative residual reached.
    pub residual: f64,
    /// Relative residuals on the way to the last equilibrium of Newton's method, from the prediction on.
    pub residuals: &'a [f64],
    /// The deformed system.
    pub system: &'a dyn SemiDiscrete,
}

/// Summary of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct QuasiStaticInfo {
    /// Load steps.
    pub steps: u64,
    /// Bonds broken.
    pub broken: u64,
    /// Products with the stiffness, or passes over the bonds.
    pub iterations: usize,
    /// Factorisations of the tangent.
    pub factorisations: usize,
}

/// The work of a load step.
struct Balance {
    u: Vec<f64>,
    /// Loads on free dofs, internal forces where supports hold.
    acting: Vec<f64>,
    work: f64,
}

impl Balance {
    fn of(run: &Run<'_>, u: &[f64]) -> Self {
        Self {
            u: u.to_vec(),
            acting: run.acting(),
            work: 0.0,
        }
    }

    /// Adds what was done since the last equilibrium.
    fn advance(&mut self, run: &Run<'_>, u: &[f64]) {
        let now = run.acting();
        for (k, now) in now.iter().enumerate() {
            self.work += 0.5 * (self.acting[k] + now) * (u[k] - self.u[k]);
        }
        self.acting = now;
        self.u.copy_from_slice(u);
    }
}

/// Refuses a displacement or prescribed dofs that are not those of the system.
fn check_shapes(
    prescribed: &[u32],
    state: &LoadState,
    dofs: usize,
) -> Result<(), QuasiStaticError> {
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
    Ok(())
}

impl<'a> Run<'a> {
    /// Work space at a state.
    ///
    /// # Errors
    /// Those of [`check_shapes`].
    fn new(
        system: &'a mut dyn SemiDiscrete,
        prescribed: &[u32],
        params: QuasiStaticParams,
        aids: Aids<'a>,
        state: &LoadState,
    ) -> Result<Self, QuasiStaticError> {
        let block = system.block().max(1);
        let dofs = system.mass().len() * block;
        check_shapes(prescribed, state, dofs)?;
        let mut held = vec![None; dofs];
        prescribed
            .iter()
            .for_each(|&k| held[k as usize] = Some(0.0));
        Ok(Self {
            inverse: vec![0.0; dofs],
            system,
            aids,
            params,
            free: FreeDofs::from_prescribed(&held, block),
            load: vec![0.0; dofs],
            force: vec![0.0; dofs],
            residual: vec![0.0; dofs],
            balanced: 0.0,
            step: state.step,
            time: 0.0,
            interval: Interval::AT_ONCE,
            tangent: Tangent::AtRest,
            is_whole: false,
            lead: Lead::default(),
            residuals: Vec::new(),
            is_torn: false,
            is_between: false,
        })
    }
}

/// Runs load steps, those that `state` has done left out. After each, `observe` may stop.
///
/// # Errors
/// [`QuasiStaticError`], each with load step, time, place and remedy. After [`QuasiStaticError::Interrupted`] `state` and the damage of the system lie within a load step:
/// a run goes on from what was kept after the last one.
pub fn run(
    system: &mut dyn SemiDiscrete,
    drive: &dyn Drive,
    params: QuasiStaticParams,
    aids: Aids<'_>,
    pacing: Pacing<'_>,
    state: &mut LoadState,
    observe: &mut dyn FnMut(&LoadStep<'_>) -> ControlFlow<()>,
) -> Result<QuasiStaticInfo, QuasiStaticError> {
    let mut work = Run::new(system, drive.prescribed(), params, aids, state)?;
    let mut values = vec![0.0; drive.prescribed().len()];
    let mut info = QuasiStaticInfo::default();
    let mut given_up = 0;
    while let Some(next) = pacing.next(state) {
        let time = next.time;
        work.step = state.step;
        work.is_torn = state.broken > 0;
        let kept = (next.limits).map(|limits| Kept::of(&*work.system, state, limits));
        let before = (state.step > 0).then_some(state.time);
        let done = work.advance(drive, (before, time), &mut values, state, kept.as_ref());
        let (account, settled) = match (done, kept) {
            (Ok((account, settled)), _) if !settled.gave_up => (account, settled),
            (Err(error @ QuasiStaticError::Interrupted { .. }), _) => return Err(error),
            (done, Some(kept)) if kept.limits.may_give_up => {
                given_up += done.map_or(0, |(_, settled)| settled.iterations);
                kept.restore(work.system, state);
                pacing.cut(state, time);
                work.is_between = false;
                continue;
            }
            (done, _) => done?,
        };
        let Settled {
            broken,
            rounds,
            iterations,
            residual,
            fails,
            ..
        } = settled;
        let iterations = iterations + std::mem::take(&mut given_up);
        work.system.commit();
        let heat = work.system.take_heat_work();
        state.step += 1;
        state.broken += broken;
        let start = std::mem::replace(&mut state.time, time);
        pacing.go_on(state, start, fails);
        info.steps += 1;
        info.broken += broken;
        info.iterations += iterations;
        info.factorisations += work.lead.factorisations;
        let seen = LoadStep {
            time,
            state,
            force: &work.force,
            load: &work.load,
            work: account.map_or(0.0, |account| account.work + heat),
            broken,
            rounds,
            iterations,
            factorisations: work.lead.factorisations,
            residual,
            residuals: &work.residuals,
            system: &*work.system,
        };
        if observe(&seen).is_break() {
            break;
        }
    }
    Ok(info)
}

/// A load step in equilibrium, in which no further bond breaks.
struct Settled {
    broken: u64,
    rounds: usize,
    iterations: usize,
    residual: f64,
    /// True if the step is to be taken again, shorter.
    gave_up: bool,
    /// True if more has failed than may in a long step.
    fails: bool,
}

/// The state before a load step that may be too long, as far as a trial changes it.
struct Kept {
    damage: Vec<u64>,
    dissipation: Option<Dissipation>,
    u: Vec<f64>,
    limits: Limits,
}

impl Kept {
    fn of(system: &dyn SemiDiscrete, state: &LoadState, limits: Limits) -> Self {
        Self {
            damage: system.damage_state(),
            dissipation: system.dissipation(),
            u: state.u.clone(),
            limits,
        }
    }

    /// Returns true if more is spent at the displacement `u` than may be.
    fn is_passed(&self, system: &dyn SemiDiscrete, u: &[f64]) -> bool {
        let energy = |d: &Option<Dissipation>| d.as_ref().map_or(0.0, |d| d.energy);
        let spent = energy(&system.dissipation()) - energy(&self.dissipation);
        spent > self.limits.most_spent * system.stored_energy(u)
    }

    fn restore(self, system: &mut dyn SemiDiscrete, state: &mut LoadState) {
        system.restore_damage(&self.damage);
        if let Some(dissipation) = self.dissipation {
            system.set_dissipation(dissipation);
        }
        state.u = self.u;
    }
}

impl Run<'_> {
    /// Takes one load step, up to where more fails than may; the work on the way, and what came of it.
    fn advance(
        &mut self,
        drive: &dyn Drive,
        (before, time): (Option<f64>, f64),
        values: &mut [f64],
        state: &mut LoadState,
        kept: Option<&Kept>,
    ) -> Result<(Option<Balance>, Settled), QuasiStaticError> {
        let mut account = self.apply_load(drive, before, time, values, &state.u)?;
        let predicted = self.set_out(&mut state.u, drive.prescribed(), values)?;
        let settled = self.settle(&mut state.u, predicted, account.as_mut(), kept)?;
        Ok((account, settled))
    }

    /// Takes the loads and the prescribed displacements of a load step, from the time `before` it; the work so far, of all but the first.
    fn apply_load(
        &mut self,
        drive: &dyn Drive,
        before: Option<f64>,
        time: f64,
        values: &mut [f64],
        u: &[f64],
    ) -> Result<Option<Balance>, QuasiStaticError> {
        self.time = time;
        self.balanced = 0.0;
        let mut account = None;
        self.interval = Interval {
            end: before.unwrap_or(time),
            length: 0.0,
        };
        if let Some(before) = before {
            drive.load_into(before, &mut self.load);
            self.balanced = self.evaluate(u)?.scale;
            account = Some(Balance::of(self, u));
        }
        let interval = Interval {
            end: time,
            length: before.map_or(0.0, |before| time - before),
        };
        self.interval = interval;
        drive.load_into(time, &mut self.load);
        drive.displacement_into(time, values);
        self.find_row_sums();
        let mut moved = 0.0;
        for (&k, v) in drive.prescribed().iter().zip(values.iter()) {
            moved += self.resisted(k as usize, v - u[k as usize]);
        }
        self.balanced = self.balanced.max(MOVED * moved.sqrt());
        Ok(account)
    }

    /// Seeks equilibrium and breaks bonds in turn, until none breaks.
    fn settle(
        &mut self,
        u: &mut [f64],
        mut iterations: usize,
        mut account: Option<&mut Balance>,
        kept: Option<&Kept>,
    ) -> Result<Settled, QuasiStaticError> {
        let (mut broken, mut rounds) = (0, 0);
        let (mut gave_up, mut fails) = (false, false);
        let interval = self.interval;
        let residual = loop {
            let (count, residual) = self.equilibrium(u)?;
            iterations += count;
            if let Some(account) = account.as_deref_mut() {
                account.advance(self, u);
            }
            let now = self.system.internal_force_into(
                u,
                &mut self.force,
                interval,
                FailureUpdate::Update,
            );
            if now.is_none() && !self.is_between {
                break residual;
            }
            // where nothing breaks any more the state is found to the tolerance of the load step, and looked at again
            self.is_between = !now.is_none();
            if now.is_none() {
                continue;
            }
            self.system.account_for_breaks(&Halfway::at(u));
            broken += now.broken;
            rounds += 1;
            self.is_torn = true;
            if let Some(kept) = kept {
                fails = fails || now.broken > 0 || kept.is_passed(&*self.system, u);
                gave_up = fails && kept.limits.may_give_up;
                if gave_up {
                    break residual;
                }
            }
            self.aids.progress.tell(&format!(
                "{iterations} iterations, {broken} bonds broken in this load step"
            ));
            self.go_on()?;
            if rounds >= self.params.max_rounds {
                return Err(QuasiStaticError::NeverHolds {
                    step: self.step,
                    time: self.time,
                    rounds,
                    broken,
                });
            }
        };
        Ok(Settled {
            broken,
            rounds,
            iterations,
            residual,
            gave_up,
            fails,
        })
    }

    /// Finds equilibrium with bonds held; returns iterations and relative residual.
    fn equilibrium(&mut self, u: &mut [f64]) -> Result<(usize, f64), QuasiStaticError> {
        self.find_row_sums();
        let (iterations, residual) = match self.params.equilibrium {
            Equilibrium::Newton => match self.by_newton(u) {
                // where bonds have turned far from rest, or hang together by single bonds, its tangent leads nowhere
                Err(
                    stuck @ (QuasiStaticError::NoEquilibrium { .. }
                    | QuasiStaticError::Linear { .. }),
                ) => match self.by_relaxation(u) {
                    Ok(found) => found,
                    Err(late @ QuasiStaticError::NoEquilibrium { .. }) if !self.is_loaded() => {
                        return Err(late);
                    }
                    Err(end @ QuasiStaticError::Interrupted { .. }) => return Err(end),
                    Err(_) => return Err(stuck),
                },
                found => found?,
            },
            Equilibrium::Relaxation => self.by_relaxation(u)?,
        };
        self.balanced = residual.scale;
        Ok((iterations, residual.relative()))
    }
}

#[cfg(test)]
#[path = "quasi_static_tests.rs"]
mod tests;
