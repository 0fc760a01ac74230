//! Explicit dynamics: velocity Verlet for `M ü = f(t) − F(u)` with lumped masses, loads and prescribed motion as functions of time.
//!
//! One step, from `(u_n, v_n, a_n)`:
//!
//! ```text
//! v_{n+1/2} = v_n + Δt/2 a_n
//! u_{n+1}   = u_n + Δt v_{n+1/2}
//! a_{n+1}   = M⁻¹ (f(t_{n+1}) − F(u_{n+1}))
//! v_{n+1}   = v_{n+1/2} + Δt/2 a_{n+1}
//! ```
//!
//! A prescribed degree of freedom (dof) follows its displacement `g(t)` exactly, with `v_n = (g_{n+1} − g_{n−1}) / 2Δt` and `a_n = (g_{n+1} − 2 g_n + g_{n−1}) / Δt²`. The scheme
//! above then holds for it too, with the total external force `M a + F` of load and support. The work of all external forces therefore
//! balances the discrete energy `H_{n+1/2} = ½ v_{n+1/2}ᵀ M v_{n+1/2} + ½ u_nᵀ K u_{n+1}` of a linear symmetric system to round-off:
//!
//! ```text
//! H_{n+1/2} − H_{n−1/2} = ½ (u_{n+1} − u_{n−1})ᵀ f_n
//! ```
//!
//! Loops over sites run in chunks of fixed size, whose sums are added in their order; the work is summed exactly. No bit of a state depends on the number of threads
//! or, where each process moves its own sites (`shared.rs`), on that of processes.

use std::ops::{ControlFlow, Range};

use rayon::prelude::*;

use crate::system::{FailureUpdate, Halfway, Interval, Segments, SemiDiscrete};

mod shared;
mod state;
mod sums;

pub use state::{
    Drive, End, Energies, ExplicitError, ExplicitInfo, ExplicitParams, State, Undriven,
};

use sums::{Sums, total};

/// Sites per chunk: the chunks, not the threads, decide the order of sums.
const SITES: usize = 1024;

/// A motion in progress.
pub struct Explicit<'a> {
    system: &'a mut dyn SemiDiscrete,
    drive: &'a dyn Drive,
    params: ExplicitParams,
    state: State,
    energies: Energies,
    block: usize,
    inverse_mass: Vec<f64>,
    /// Internal force \[N\] at `n`, `block` entries per site.
    force: Vec<f64>,
    /// External force \[N\] at `n`; on prescribed dofs that of load and support.
    load: Vec<f64>,
    prescribed: Vec<u32>,
    /// The load alone on prescribed dofs.
    applied: Vec<f64>,
    /// Displacement of prescribed dofs at `n−1` and `n+1`.
    previous: Vec<f64>,
    next: Vec<f64>,
    sums: Vec<Sums>,
    /// Sites that are moved here, and of which sums are taken.
    own: Segments,
    /// Sites of other processes that are moved here too.
    ghosts: Segments,
    /// Data of steps that processes share; none where each moves all sites.
    shared: Option<shared::Shared>,
}

impl<'a> Explicit<'a> {
    /// Starts or resumes a motion: a state with accelerations is resumed as it is, one without gets them from the system.
    ///
    /// The damage of a resumed run must have been put back into the system before.
    ///
    /// # Errors
    /// [`ExplicitError`] if state, step, masses or drive are not those of a motion of this system.
    pub fn new(
        system: &'a mut dyn SemiDiscrete,
        drive: &'a dyn Drive,
        params: ExplicitParams,
        mut state: State,
    ) -> Result<Explicit<'a>, ExplicitError> {
        let block = system.block().max(1);
        let sites = system.mass().len();
        let dofs = sites * block;
        let prescribed = drive.prescribed().to_vec();
        state::check(system, &params, &state, &prescribed)?;
        let mut values = vec![0.0; prescribed.len()];
        let starts = state.a.is_empty();
        if starts {
            drive.displacement_into(state.time, &mut values);
            set(&prescribed, &values, &mut state.u);
            drive.velocity_into(state.time, &mut values);
            set(&prescribed, &values, &mut state.v);
        }
        let mut load = vec![0.0; dofs];
        drive.load_into(state.time, &mut load);
        let mut force = vec![0.0; dofs];
        // a resumed state has broken its bonds already
        let breakage = if starts {
            FailureUpdate::Update
        } else {
            FailureUpdate::Frozen
        };
        let at_start = Interval {
            end: state.time,
            length: 0.0,
        };
        let changes = system.internal_force_into(&state.u, &mut force, at_start, breakage);
        if !changes.is_none() {
            system.account_for_breaks(&Halfway::at(&state.u));
        }
        if starts {
            // the history of a resumed system is committed already: to evaluate it once more would change it by rounding
            system.commit();
        }
        state.broken += changes.broken;
        let inverse_mass: Vec<f64> = system.mass().iter().map(|m| 1.0 / m).collect();
        let mut motion = Explicit {
            system,
            drive,
            params,
            state,
            energies: Energies::default(),
            block,
            inverse_mass,
            force,
            load,
            applied: values.clone(),
            previous: values.clone(),
            next: values,
            prescribed,
            sums: vec![Sums::default(); sites.div_ceil(SITES)],
            own: Segments::all(sites, SITES),
            ghosts: Segments::none(sites, SITES),
            shared: None,
        };
        if starts {
            motion.begin();
        }
        motion.look_ahead();
        motion.resume_reactions();
        motion.energies = motion.energies_at_start();
        if starts {
            let stored = motion.system.stored_energy(&motion.state.u);
            motion.state.supplied =
                motion.energies.kinetic + stored.abs() + motion.energy_of_rounding();
        }
        motion.check_numbers()?;
        motion.share();
        Ok(motion)
    }

    /// Accelerations at the start.
    fn begin(&mut self) {
        let (d, dt) = (self.block, self.params.step);
        self.state.a = self
            .load
            .iter()
            .zip(&self.force)
            .enumerate()
            .map(|(k, (f, r))| (f - r) * self.inverse_mass[k / d])
            .collect();
        self.look_ahead();
        for (&k, next) in self.prescribed.iter().zip(&self.next) {
            let k = k as usize;
            // the first step then arrives at the prescribed displacement
            self.state.a[k] = 2.0 * ((next - self.state.u[k]) / dt - self.state.v[k]) / dt;
        }
    }

    /// Kinetic energy \[J\] of the velocities due to rounding of the displacements: the only energy of a body that starts at rest in an expanded state.
    fn energy_of_rounding(&self) -> f64 {
        /// Relative error of a displacement after many sums.
        const ROUNDING: f64 = 1e-12;
        let speed = |k: usize| ROUNDING * self.state.u[k] / self.params.step;
        let energy = |k: usize| 0.5 * speed(k).powi(2) / self.inverse_mass[k / self.block];
        (0..self.state.u.len()).map(energy).sum()
    }

    /// Prescribed displacements of the next step.
    fn look_ahead(&mut self) {
        self.drive
            .displacement_into(self.state.time + self.params.step, &mut self.next);
    }

    /// As [`Explicit::add_reactions`], with the forces that the steps before ended with, if there were any.
    fn resume_reactions(&mut self) {
        let held = std::mem::take(&mut self.state.held);
        self.add_reactions(Reading::Fresh);
        if held.len() == self.prescribed.len() {
            set(&self.prescribed, &held, &mut self.load);
            self.state.held = held;
        }
    }

    /// Sets the load on prescribed dofs to the total external force, `M a + F`.
    fn add_reactions(&mut self, reading: Reading) {
        for (p, &k) in self.prescribed.iter().enumerate() {
            let k = k as usize;
            if reading == Reading::Fresh {
                self.applied[p] = self.load[k];
            }
            self.load[k] = self.state.a[k] / self.inverse_mass[k / self.block] + self.force[k];
        }
        let moved = self.prescribed.iter().map(|&k| self.load[k as usize]);
        self.state.held.clear();
        self.state.held.extend(moved);
    }

    fn energies_at_start(&self) -> Energies {
        let kinetic = self.kinetic();
        let pair = crate::solve::krylov::dot(&self.state.u, &self.force);
        Energies {
            kinetic,
            kinetic_half: kinetic,
            discrete: kinetic + 0.5 * pair,
            work: self.state.work,
            work_half: self.state.work,
        }
    }

    /// `½ vᵀ M v` \[J\], summed chunk by chunk as in a step.
    fn kinetic(&self) -> f64 {
        let d = self.block;
        let sums: Vec<f64> = self
            .state
            .v
            .par_chunks(SITES * d)
            .zip(self.system.mass().par_chunks(SITES))
            .map(|(v, mass)| {
                let mut sum = 0.0;
                for (v, m) in v.chunks_exact(d).zip(mass) {
                    sum += m * v.iter().map(|v| v * v).sum::<f64>();
                }
                sum
            })
            .collect();
        0.5 * sums.iter().sum::<f64>()
    }

    /// Takes one step, in buffers kept from step to step.
    ///
    /// # Errors
    /// [`ExplicitError::NotFinite`] or [`ExplicitError::Runaway`], with step, time and site.
    pub fn step(&mut self) -> Result<(), ExplicitError> {
        // one change of threads per step instead of one per loop
        rayon::scope(|_| self.advance())
    }

    fn advance(&mut self) -> Result<(), ExplicitError> {
        let (d, dt) = (self.block, self.params.step);
        for (previous, &k) in self.previous.iter_mut().zip(&self.prescribed) {
            *previous = self.state.u[k as usize];
        }
        self.kick_and_drift();
        for (p, &k) in self.prescribed.iter().enumerate() {
            let k = k as usize;
            self.state.v[k] = (self.next[p] - self.previous[p]) / dt;
            self.state.u[k] = self.next[p];
        }
        let mut before = total(&self.sums);
        self.state.time += dt;
        self.state.step += 1;
        let reading = if self.drive.is_steady() {
            Reading::Kept
        } else {
            self.drive.load_into(self.state.time, &mut self.load);
            Reading::Fresh
        };
        let mut outcome = self.respond();
        self.system.commit();
        let heat = self.system.take_heat_work();
        self.state.work += heat;
        self.state.supplied += heat.abs();
        self.look_ahead();
        self.accelerate_prescribed();
        self.add_reactions(reading);
        self.keep_half();
        self.accelerate_and_kick();
        self.settle_prescribed();
        let mut after = total(&self.sums);
        self.add_over_processes([&mut before, &mut after], &mut outcome);
        self.state.broken += outcome.broken;
        let work_half = self.state.work + 0.5 * dt * before.power.sum.value();
        self.state.work = work_half + 0.5 * dt * after.power.sum.value();
        let [first, second] = [before, after.clone()].map(|sums| sums.power.absolute.value());
        self.state.supplied += 0.5 * dt * (first + second);
        self.energies = Energies::of(&after, self.state.work, work_half);
        debug_assert_eq!(self.state.u.len(), self.inverse_mass.len() * d);
        self.gather_for_trouble();
        self.check_numbers()
    }

    /// Computes the internal force at the new displacement; returns the bonds that it broke.
    fn respond(&mut self) -> shared::Outcome {
        if self.shared.is_some() {
            return self.respond_at_own();
        }
        let interval = Interval {
            end: self.state.time,
            length: self.params.step,
        };
        let update = FailureUpdate::Update;
        let (u, force) = (&self.state.u, &mut self.force);
        let changes = self.system.internal_force_into(u, force, interval, update);
        if !changes.is_none() {
            self.system
                .account_for_breaks(&self.state.halfway(self.params.step));
        }
        shared::Outcome {
            broken: changes.broken,
            ..Default::default()
        }
    }

    /// Accelerations of prescribed dofs.
    fn accelerate_prescribed(&mut self) {
        let dt = self.params.step;
        for (p, &k) in self.prescribed.iter().enumerate() {
            let k = k as usize;
            let (last, now, next) = (self.previous[p], self.state.u[k], self.next[p]);
            self.state.a[k] = ((next - now) - (now - last)) / (dt * dt);
        }
    }

    /// Accelerations and velocities of prescribed dofs, where the others have moved on.
    fn settle_prescribed(&mut self) {
        self.accelerate_prescribed();
        for (p, &k) in self.prescribed.iter().enumerate() {
            self.state.v[k as usize] = (self.next[p] - self.previous[p]) / (2.0 * self.params.step);
        }
    }

    /// `v += Δt/2 a`, `u += Δt v`; sums the power of the external forces at `n`.
    fn kick_and_drift(&mut self) {
        let (d, dt) = (self.block, self.params.step);
        let State { u, v, a, .. } = &mut self.state;
        let (own, ghosts) = (&self.own, &self.ghosts);
        u.par_chunks_mut(SITES * d)
            .zip(v.par_chunks_mut(SITES * d))
            .zip(a.par_chunks(SITES * d))
            .zip(self.load.par_chunks(SITES * d))
            .zip(self.sums.par_iter_mut())
            .enumerate()
            .for_each(|(chunk, ((((u, v), a), load), sums))| {
                sums.power.clear();
                let dofs = |sites: Range<usize>| sites.start * d..sites.end * d;
                for dofs in ghosts.of_chunk(chunk).map(dofs) {
                    drift(dt, &mut u[dofs.clone()], &mut v[dofs.clone()], &a[dofs]);
                }
                for dofs in own.of_chunk(chunk).map(dofs) {
                    let (u, v) = (&mut u[dofs.clone()], &mut v[dofs.clone()]);
                    drift(dt, u, v, &a[dofs.clone()]);
                    sums.power.add(d, &load[dofs], v);
                }
            });
    }

    /// `a = M⁻¹ (f − F)`, `v += Δt/2 a`, with all sums of the step.
    fn accelerate_and_kick(&mut self) {
        let (d, dt) = (self.block, self.params.step);
        let State { u, v, a, .. } = &mut self.state;
        let mass = self.system.mass();
        let (own, ghosts) = (&self.own, &self.ghosts);
        v.par_chunks_mut(SITES * d)
            .zip(a.par_chunks_mut(SITES * d))
            .zip(u.par_chunks(SITES * d))
            .zip(self.load.par_chunks(SITES * d))
            .zip(self.force.par_chunks(SITES * d))
            .zip(mass.par_chunks(SITES))
            .zip(self.inverse_mass.par_chunks(SITES))
            .zip(self.sums.par_iter_mut())
            .enumerate()
            .for_each(
                |(chunk, (((((((v, a), u), load), force), mass), inverse), sums))| {
                    sums.power.clear();
                    let (mut kinetic, mut kinetic_half, mut pair) = (0.0, 0.0, 0.0);
                    for sites in own.of_chunk(chunk) {
                        let dofs = sites.start * d..sites.end * d;
                        sums.power.add(d, &load[dofs.clone()], &v[dofs]);
                        for i in sites {
                            let (mut half, mut full) = (0.0, 0.0);
                            for k in i * d..(i + 1) * d {
                                half += v[k] * v[k];
                                pair += (u[k] - dt * v[k]) * force[k];
                                a[k] = (load[k] - force[k]) * inverse[i];
                                v[k] += 0.5 * dt * a[k];
                                full += v[k] * v[k];
                            }
                            kinetic_half += mass[i] * half;
                            kinetic += mass[i] * full;
                        }
                    }
                    (sums.kinetic, sums.kinetic_half, sums.pair) = (kinetic, kinetic_half, pair);
                    for i in ghosts.of_chunk(chunk).flatten() {
                        for k in i * d..(i + 1) * d {
                            a[k] = (load[k] - force[k]) * inverse[i];
                            v[k] += 0.5 * dt * a[k];
                        }
                    }
                },
            );
    }

    /// Tests that the numbers are finite and that the kinetic energy does not exceed the energy supplied by more than a factor.
    fn check_numbers(&self) -> Result<(), ExplicitError> {
        let Energies {
            kinetic,
            kinetic_half,
            discrete,
            ..
        } = self.energies;
        let (step, time) = (self.state.step, self.state.time);
        if !(kinetic.is_finite() && discrete.is_finite() && self.state.work.is_finite()) {
            let State { u, v, a, .. } = &self.state;
            let bad = |k: &usize| !(u[*k].is_finite() && v[*k].is_finite() && a[*k].is_finite());
            // finite numbers whose squares are not: the fastest dof
            let dof = (0..u.len()).find(bad).unwrap_or_else(|| self.fastest());
            return Err(ExplicitError::NotFinite {
                step,
                time,
                site: dof / self.block,
            });
        }
        // at n − ½, since a load that starts from zero has done no work yet when it first accelerates the body
        if kinetic_half > self.params.runaway * self.state.supplied {
            return Err(ExplicitError::Runaway {
                step,
                time,
                site: self.fastest() / self.block,
                energy: kinetic_half,
                supplied: self.state.supplied,
                factor: self.params.runaway,
            });
        }
        Ok(())
    }

    /// The dof of largest speed.
    fn fastest(&self) -> usize {
        let speed = |k: usize| self.state.v[k].abs();
        (0..self.state.v.len()).fold(0, |best, k| if speed(k) > speed(best) { k } else { best })
    }

    /// Steps until `last` steps have been taken since the start of the motion; after each, `observe` may stop it.
    ///
    /// # Errors
    /// Those of [`Explicit::step`].
    pub fn run(
        &mut self,
        last: u64,
        observe: &mut dyn FnMut(&mut Explicit<'_>) -> ControlFlow<()>,
    ) -> Result<ExplicitInfo, ExplicitError> {
        let (first, broken) = (self.state.step, self.state.broken);
        let mut end = End::Finished;
        while self.state.step < last {
            self.step()?;
            if observe(self).is_break() {
                end = End::Stopped;
                break;
            }
        }
        Ok(ExplicitInfo {
            steps: self.state.step - first,
            time: self.state.time,
            broken: self.state.broken - broken,
            end,
        })
    }

    /// State of the motion; where processes move their own sites alone, the numbers of others are there once they are gathered ([`Explicit::gather`]).
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Ends the motion and keeps its state.
    pub fn into_state(self) -> State {
        self.state
    }

    /// Energies of the last step.
    pub fn energies(&self) -> Energies {
        self.energies
    }

    /// The applied load on each prescribed dof, without the support's force \[N\].
    pub fn applied(&self) -> &[f64] {
        &self.applied
    }

    /// The system in motion.
    pub fn system(&self) -> &dyn SemiDiscrete {
        &*self.system
    }

    /// The time step \[s\].
    pub fn time_step(&self) -> f64 {
        self.params.step
    }

    /// Internal force \[N\] at the present state.
    pub fn internal_force(&self) -> &[f64] {
        &self.force
    }

    /// External force \[N\] at the present state; on prescribed dofs with the force of the support.
    pub fn external_force(&self) -> &[f64] {
        &self.load
    }

    /// The force of the supports \[N\], `M a + F − f`: pairs of prescribed dof and force.
    pub fn reactions(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        self.prescribed
            .iter()
            .zip(&self.applied)
            .map(|(&k, applied)| (k, self.load[k as usize] - applied))
    }

    /// Momentum `Σ m v` \[kg m/s\], one entry per direction.
    pub fn momentum(&self) -> Vec<f64> {
        let mut sum = vec![0.0; self.block];
        for (v, m) in self
            .state
            .v
            .chunks_exact(self.block)
            .zip(self.system.mass())
        {
            sum.iter_mut().zip(v).for_each(|(s, v)| *s += m * v);
        }
        sum
    }
}

/// Load of prescribed dofs: newly evaluated, or kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reading {
    Fresh,
    Kept,
}

/// Half a kick, and the drift of a step.
#[inline]
fn drift(dt: f64, u: &mut [f64], v: &mut [f64], a: &[f64]) {
    for ((u, v), a) in u.iter_mut().zip(v).zip(a) {
        *v += 0.5 * dt * a;
        *u += dt * *v;
    }
}

fn set(dofs: &[u32], values: &[f64], field: &mut [f64]) {
    for (&k, v) in dofs.iter().zip(values) {
        field[k as usize] = *v;
    }
}

#[cfg(test)]
mod tests;
