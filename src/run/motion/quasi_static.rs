//! A scene under a load that grows: one equilibrium after another, each broken through until no bond breaks.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use super::RunOptions;
use super::breaks::{Breaks, breaks, damage_at_edge};
use super::contact::ContactRecord;
use super::created_energy::{created_energy, set_free};
use super::doubtful_equilibria::DoubtfulEquilibria;
use super::dynamic_system::{failing_stretch, start};
use super::end_of_steps::end_of_steps;
use super::field_output::FieldOutput;
use super::guard::energies_are_apart;
use super::impact::{BodyOnly, impacted};
use super::impact_record::ImpactRecord;
use super::inside_step::InsideStep;
use super::load_step_params::{equilibrium_params, step_choice};
use super::parted::has_parted;
use super::saved::{EdgeReached, Saved, StepChoice};
use super::setup::{ModelSetup, laid_out, opened, recorder, restore};
use super::spread_factors::Leads;
use super::time_dependent_loads::SceneDrive;
use super::writer::{Moment, Recorder};
use crate::model::Model;
use crate::observe::ObserveError;
use crate::observe::checkpoint::CheckpointFile;
use crate::observe::summary::{
    Decision, Ended, MotionSummary, Rotation, RunSummary, Timings, peak_memory_bytes,
};
use crate::progress::Progress;
use crate::run::error::{RunError, explained};
use crate::run::linear_parts::{LinearParts, RunKind};
use crate::run::loads::{self, BodyForces};
use crate::run::motion::seen::Seen;
use crate::run::rotation::Rotations;
use crate::run::setup::{RunSettings, sizes};
use crate::run::warnings::{of_elements, unusual_stretch, warnings, without_response};
use crate::scene::solve::QuasiStatic as Spec;
use crate::scene::spec::{EdgeSpec, WhenPartedSpec};
use crate::scene::validated::Scene;
use crate::solve::explicit::{Drive, State};
use crate::solve::krylov::LinearMap;
use crate::solve::quasi_static::{
    self, Adaptive, Aids, LoadState, LoadStep, Pacing, QuasiStaticError, QuasiStaticParams,
    Refactor, TangentFactors,
};
use crate::system::SemiDiscrete;

/// Runs a scene under a load that grows.
pub(crate) fn run<const D: usize>(
    scene: Scene<D>,
    spec: &Spec,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    laid_out(
        scene,
        options.ranks,
        progress,
        |rest, choices| opened(rest, options, choices),
        |laid_out, (file, saved)| {
            let loaded = load_steps(laid_out, file, saved, spec, options, progress)?;
            Ok(loaded.summary)
        },
    )
}

/// Load steps that are done, with what a motion after them goes on with.
pub(super) struct Loaded<'a, const D: usize> {
    /// Their summary.
    pub summary: RunSummary,
    /// The last state of equilibrium.
    pub state: State,
    /// The model, whose system has the history of the load.
    pub laid_out: ModelSetup<'a, D>,
}

/// Loads and supports over the load steps, from the displacement `start`.
fn driven<'a, const D: usize>(
    model: &'a Model<D>,
    rest: &'a RunSettings<D>,
    start: &[f64],
    spec: &Spec,
) -> Result<SceneDrive<'a, D>, RunError> {
    let steps = (spec.duration / spec.steps as f64, spec.steps as u64);
    // a motion that begins with the last equilibrium shares them out by its masses
    let body_forces = match rest.is_in_time {
        true => BodyForces::Lumped,
        false => BodyForces::Consistent,
    };
    let drive = SceneDrive::new(model, &rest.conditions, start, steps, body_forces)?;
    Ok(drive.with_impactors(&rest.impactors, steps.1))
}

/// Load steps from the beginning or a checkpoint.
// One function: everything that a step asks for, in the order in which it is found.
pub(super) fn load_steps<'a, const D: usize>(
    mut laid_out: ModelSetup<'a, D>,
    file: CheckpointFile,
    saved: Option<Saved>,
    spec: &Spec,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<Loaded<'a, D>, RunError> {
    let (model, operator, rest) = (laid_out.model, laid_out.operator, laid_out.rest);
    let doubts = DoubtfulEquilibria::new(&laid_out);
    let parts = linear_parts(&laid_out, options)?;
    let mut setup = laid_out.setup;
    let begin = start(model, rest);
    let (moving, contact) = (laid_out.moving, laid_out.contact.clone());
    let (mut moving, impact) = impacted(model, rest, moving, &begin, 1.0, &mut setup.choices)?;
    let (system, is_linear) = (&mut moving.system, moving.is_linear);
    let params = equilibrium_params(spec, &mut setup.choices);
    let pace = step_choice(spec);
    let body = (model, operator, laid_out.terms.as_ref());
    let how = (system.symmetry(), params.equilibrium);
    let told = &mut setup.choices;
    let leads = Leads::new(body, how, (rest, options.ranks), told, progress)?;
    let made = leads.made(progress)?;
    leads.time(&mut setup.watch, &mut setup.timings);
    let thermal = rest.stresses.thermal.as_ref();
    let drive = driven(model, rest, &begin.u, spec)?;
    let drive = drive.heated(thermal, operator, is_linear)?;
    let at = saved.as_ref();
    restore(system.as_mut(), at, &file)?;
    let breaks = breaks(system.as_ref(), rest);
    let every = spec.checkpoint_every;
    let written = at.map(|saved| &saved.written);
    let (of, touches) = ((breaks, false), (impact, contact));
    let mut recorder = recorder((model, rest), (*options, every), touches, of, file, written)?;
    recorder.hold(drive.holders());
    recorder.cut(model, rest, Arc::clone(&laid_out.terms))?;
    let (edge, seen) = at.map_or_else(Default::default, |s| (s.edge, s.seen.clone()));
    let (state, mut loaded) = first_state(begin, saved);
    let first = state.step;
    let mut observer = LoadStepObserver {
        model,
        rest,
        spec,
        options,
        progress,
        pace,
        breaks,
        drive: &drive,
        fields: FieldOutput::new(model, operator, rest, options),
        recorder,
        rotations: Rotations::new(model, rest, failing_stretch(model, rest)?, None),
        parts,
        seen,
        doubts,
        last_damage: system.damage_state(),
        state,
        iterations: 0,
        factorisations: 0,
        edge,
        ended: ended_before(edge, rest),
        energies_are_apart: energies_are_apart(model, rest, is_linear),
        rotation: None,
        failed: None,
    };
    setup.lap("start");
    let refactor = leads.of_present_tangents();
    let near = (leads.lead(made.as_deref())).map(|lead| BodyOnly::new(lead, model));
    let near = (near.as_ref(), refactor.as_ref());
    let timings = &mut setup.timings;
    let taken = observer.take_steps(system.as_mut(), params, near, &mut loaded, timings);
    setup.choices.push(observer.spent());
    let state = observer.state.clone();
    let summary = observer.summary(system.as_ref(), first, taken?)?;
    let of_model = warnings(model, setup.traits, &laid_out.proof).into_iter();
    let of_model = of_model.chain(of_elements(model, &model.local_laws(&rest.local_laws)));
    let summary = RunSummary {
        scene: setup.title.clone(),
        coupling: setup.traits.name.to_owned(),
        sizes: sizes(model, operator),
        choices: setup.choices.clone(),
        total_seconds: setup.timings.total(),
        timings: setup.timings.clone(),
        peak_memory_bytes: peak_memory_bytes(),
        warnings: of_model.chain(summary.warnings.clone()).collect(),
        proof: laid_out.proof.clone(),
        ..summary
    };
    (laid_out.setup, laid_out.moving) = (setup, moving);
    Ok(Loaded {
        summary,
        state,
        laid_out,
    })
}

/// Returns the parts of a model that stay linear or whole in load steps.
fn linear_parts<'a, const D: usize>(
    of: &ModelSetup<'a, D>,
    options: &RunOptions<'a>,
) -> Result<LinearParts<'a, D>, RunError> {
    let how = (RunKind::LoadSteps, of.moving.has_exact_seam);
    LinearParts::new(of.model, of.operator, of.rest, how, options.ranks)
}

/// Returns the reason why a resumed run has ended at its checkpoint already; [`Ended::Finished`] if it has not.
fn ended_before<const D: usize>(edge: Option<EdgeReached>, rest: &RunSettings<D>) -> Ended {
    match edge.is_some() && rest.breaking.at_edge == EdgeSpec::Stop {
        true => Ended::DamageAtEdge,
        false => Ended::Finished,
    }
}

/// The state that the first load step begins with: the one that a checkpoint keeps (fields, time, step, work, broken bonds), and the one that the solver advances.
fn first_state(begin: State, saved: Option<Saved>) -> (State, LoadState) {
    let mut loaded = LoadState::at_rest(begin.u.len());
    let mut state = begin;
    if let Some(saved) = saved {
        state = saved.state;
        // the state at t = 0 counts as one of the driver's steps
        loaded.step = state.step + 1;
        loaded.broken = state.broken;
        (loaded.time, loaded.stride) = (state.time, saved.pace.step);
    }
    loaded.u.clone_from(&state.u);
    (state, loaded)
}

/// Watches and writes the load steps of a run.
struct LoadStepObserver<'a, const D: usize> {
    model: &'a Model<D>,
    rest: &'a RunSettings<D>,
    spec: &'a Spec,
    options: &'a RunOptions<'a>,
    progress: &'a dyn Progress,
    pace: StepChoice,
    breaks: Breaks,
    drive: &'a SceneDrive<'a, D>,
    fields: FieldOutput<'a, D>,
    recorder: Recorder<'a, D>,
    rotations: Rotations<'a, D>,
    parts: LinearParts<'a, D>,
    seen: Seen,
    doubts: DoubtfulEquilibria<'a, D>,
    /// Fields, time, step, work, broken bonds of the last load step, which a checkpoint keeps.
    state: State,
    /// Damage state of the system at that load step; empty without an interrupt, which alone leads back there.
    last_damage: Vec<u64>,
    /// Products or passes of the load steps so far.
    iterations: usize,
    factorisations: usize,
    edge: Option<EdgeReached>,
    energies_are_apart: bool,
    ended: Ended,
    rotation: Option<Rotation>,
    failed: Option<ObserveError>,
}

impl<const D: usize> LoadStepObserver<'_, D> {
    /// Returns the cost of the load steps.
    fn spent(&self) -> Decision {
        Decision {
            choice: format!("{} products or passes", self.iterations),
            why: match self.factorisations {
                0 => "of all load steps of this run".to_owned(),
                made => {
                    format!(
                        "of all load steps of this run, {made} of whose tangents were factorised"
                    )
                }
            },
        }
    }

    /// Takes the load steps to the end, or to where the run stops; adds the seconds of the stages to `timings`, and returns those of all.
    ///
    /// # Errors
    /// [`RunError`] of a load step or a file.
    fn take_steps(
        &mut self,
        system: &mut dyn SemiDiscrete,
        params: QuasiStaticParams,
        (near, refactor): (Option<&BodyOnly<'_>>, Option<&TangentFactors<'_>>),
        loaded: &mut LoadState,
        timings: &mut Timings,
    ) -> Result<f64, RunError> {
        if self.ended != Ended::Finished {
            return Ok(0.0);
        }
        let written = self.recorder.seconds;
        let (progress, pace, drive) = (self.progress, self.pace, self.drive);
        let spec = self.spec;
        let times = |k: u64| (k <= pace.steps).then(|| spec.time_of(k));
        let pacing = match spec.accuracy {
            None => Pacing::Listed(&times),
            Some(accuracy) => Pacing::Adaptive(Adaptive {
                end: spec.duration,
                accuracy,
            }),
        };
        progress.stage("load steps", Some(spec.steps as u64));
        progress.advance(self.part_done(self.state.time));
        let clock = Instant::now();
        // before the state at the start ending loses nothing
        if loaded.step > 0 {
            self.options.begin_steps();
        }
        let inside = InsideStep {
            progress,
            interrupt: self.options.interrupt,
        };
        let aids = Aids {
            near: near.map(|f| f as &dyn LinearMap),
            refactor: refactor.map(|f| f as &dyn Refactor),
            progress: &inside,
        };
        let model = self.model;
        let laws = &model.local_laws(&self.rest.local_laws);
        let mut observe = |seen: &LoadStep<'_>| self.observe(seen);

        let done = quasi_static::run(system, drive, params, aids, pacing, loaded, &mut observe);
        match done {
            Err(QuasiStaticError::Interrupted { .. }) => self.go_back(system, loaded.step)?,
            done => drop(done.map_err(|error| explained(error.into(), model, laws))?),
        }
        if let Some(error) = self.failed.take() {
            return Err(error.into());
        }
        progress.finish();
        let seconds = clock.elapsed().as_secs_f64();
        let writing = self.recorder.seconds - written;
        timings.add("load steps", seconds - writing);
        timings.add("output", writing);
        Ok(seconds)
    }

    /// Goes back to the last of the load steps that are `done` from within the next, and leaves a checkpoint there if there is one.
    ///
    /// # Errors
    /// [`ObserveError`] for a checkpoint that cannot be written.
    fn go_back(&mut self, system: &mut dyn SemiDiscrete, done: u64) -> Result<(), ObserveError> {
        self.ended = Ended::Interrupted;
        // the same system kept it
        system.restore_damage(&self.last_damage);
        match done {
            0 => Ok(()),
            _ => self.checkpoint(system),
        }
    }

    /// Writes all that the run needs to go on from the last load step.
    fn checkpoint(&mut self, system: &dyn SemiDiscrete) -> Result<(), ObserveError> {
        let (pace, edge) = (self.pace, self.edge);
        self.recorder
            .checkpoint(&self.state, system, pace, edge, None, &self.seen)
    }

    /// Watches and writes a load step; says whether the next is taken.
    fn observe(&mut self, seen: &LoadStep<'_>) -> ControlFlow<()> {
        let begins = seen.state.step == 1;
        let before = self.part_done(self.state.time);
        self.take_state(seen);
        self.doubts.watch(seen);
        let now = (self.state.step, self.state.time);
        self.parts.look(&self.state.u, now, &mut self.seen.passed);
        self.find_damage_at_edge(seen);
        let held = self.drive.prescribed();
        let has_parted = has_parted(seen, held, &mut self.seen.largest_stored);
        self.find_reason_to_end(has_parted);
        // before the files appear, which tell others that the run has begun
        if begins {
            self.options.begin_steps();
        }
        let done = self.part_done(self.state.time);
        let every = self.spec.output_every as u64;
        if let Err(error) = self.write(seen, begins, done / every > before / every) {
            self.failed = Some(error);
            return ControlFlow::Break(());
        }
        let state = &self.state;
        self.progress.advance(self.part_done(state.time) - before);
        self.progress.tell(&format!(
            "t = {:.3e}, {} iterations, {} bonds broken",
            state.time, seen.iterations, state.broken
        ));
        match self.ended {
            Ended::Finished => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        }
    }

    /// Takes the state of a load step over.
    fn take_state(&mut self, seen: &LoadStep<'_>) {
        let state = &mut self.state;
        state.work += seen.work;
        state.step = seen.state.step - 1;
        state.time = seen.time;
        state.u.copy_from_slice(&seen.state.u);
        state.broken = seen.state.broken;
        if self.spec.accuracy.is_some() {
            self.pace.step = seen.state.stride;
        }
        self.iterations += seen.iterations;
        self.factorisations += seen.factorisations;
        if self.options.interrupt.is_some() {
            self.last_damage = seen.system.damage_state();
        }
    }

    /// Looks for damage at the edge of the nonlocal zone, as long as there is none.
    fn find_damage_at_edge(&mut self, seen: &LoadStep<'_>) {
        if self.breaks.may() && self.edge.is_none() {
            self.edge = damage_at_edge(seen.system).map(|site| EdgeReached {
                step: self.state.step,
                time: self.state.time,
                site: site as u64,
            });
        }
    }

    /// Returns true if the state is that of the last load step.
    fn is_last(&self) -> bool {
        match self.spec.accuracy {
            None => self.state.step == self.pace.steps,
            Some(_) => self.state.time >= self.spec.duration,
        }
    }

    /// Load steps that are done at a time, of adaptive ones the intervals that they divide.
    fn part_done(&self, time: f64) -> u64 {
        match self.spec.accuracy {
            None => self.state.step,
            Some(_) => (time / self.spec.duration * self.spec.steps as f64 + 1e-6) as u64,
        }
    }

    /// Finds the reason, if any, to end the run with this load step: damage at the edge, an interrupt, elements that have rotated too far, a body that has parted.
    fn find_reason_to_end(&mut self, has_parted: bool) {
        let interrupt = self.options.interrupt;
        if self.edge.is_some() && self.rest.breaking.at_edge == EdgeSpec::Stop {
            self.ended = Ended::DamageAtEdge;
        } else if interrupt.is_some_and(|i| i.load(Ordering::Relaxed)) && !self.is_last() {
            self.ended = Ended::Interrupted;
        }
        let found = self.rotations.largest(&self.state.u);
        let limit = self.spec.largest_rotation.unwrap_or(f64::INFINITY);
        if self.ended == Ended::Finished && found.as_ref().is_some_and(|r| r.degrees > limit) {
            self.ended = Ended::ElementsRotated;
        }
        let may_end = self.spec.when_parted == WhenPartedSpec::End && !self.is_last();
        if self.ended == Ended::Finished && has_parted && may_end {
            self.ended = Ended::Parted;
        }
        let when = Some((self.state.step, self.state.time));
        self.rotation = found.and_then(|r| self.rotations.told(r.degrees, r.place, 0.0, 0.0, when));
    }

    /// Writes a row of the history, the fields where they are due, and a checkpoint where that is.
    fn write(
        &mut self,
        seen: &LoadStep<'_>,
        begins: bool,
        is_due: bool,
    ) -> Result<(), ObserveError> {
        let loads: Vec<f64> = self
            .drive
            .prescribed()
            .iter()
            .map(|&dof| seen.load[dof as usize])
            .collect();
        let last = self.is_last();
        let (state, recorder) = (&self.state, &mut self.recorder);
        let moment = Moment::at_rest(state, seen.system, (seen.force, &loads), seen.load);
        if let Some(impact) = &mut recorder.impact {
            impact.watch(moment.state, moment.supports.0);
        }
        let shown = begins
            || last
            || matches!(
                self.ended,
                Ended::DamageAtEdge | Ended::ElementsRotated | Ended::Parted
            )
            || is_due;
        let leave = self.ended != Ended::Finished || (last && recorder.keeps_state());
        if begins {
            recorder.begin(&moment);
        }
        let energies = recorder.energies(&moment);
        let place = |site: usize| self.model.sites[site].position;
        let probed = self.fields.probed(&moment);
        if recorder.integrates_at_tips() {
            let (broken, damage) = (moment.broken_bonds(), recorder.damage(&moment));
            let solved = self.fields.solved(&moment, &broken, damage.as_deref());
            recorder.find_tips(&moment, &solved);
        }
        recorder.row(&moment, energies, &probed, place)?;
        if shown {
            self.fields.write(recorder, &moment)?;
        }
        if leave || (!begins && recorder.is_checkpoint_due(state.step)) {
            self.checkpoint(seen.system)?;
        }
        Ok(())
    }

    /// Energies, cracks, loads and files at the end of the run; `first` is the step that it began with, `seconds` are those of its steps.
    ///
    /// # Errors
    /// [`RunError`] for loads or a fracture energy that cannot be evaluated.
    fn summary(
        mut self,
        system: &dyn SemiDiscrete,
        first: u64,
        seconds: f64,
    ) -> Result<RunSummary, RunError> {
        let (model, state) = (self.model, &self.state);
        let (_, applied) = loads::loads(model, &self.rest.conditions, state.time)?;
        let of = (self.breaks, self.edge, self.pace);
        let now = (state, system, 0.0);
        let summary = end_of_steps((model, self.rest), &mut self.recorder, now, of)?;
        let motion = MotionSummary {
            ended: self.ended,
            of_steps: match self.spec.accuracy {
                None => self.pace.steps,
                Some(_) => state.step,
            },
            steps_per_second: (state.step - first) as f64 / seconds.max(f64::MIN_POSITIVE),
            ..summary
        };
        let warnings = without_response(system, &state.u).into_iter();
        let horizon = model
            .body()
            .map_or(0.0, |body| body.cloud.horizon.largest());
        let impacts = self.recorder.impact.iter();
        Ok(RunSummary {
            warnings: warnings
                .chain(impacts.flat_map(ImpactRecord::warnings))
                .chain(
                    self.recorder
                        .contact
                        .iter()
                        .flat_map(ContactRecord::warnings),
                )
                .chain(match self.energies_are_apart {
                    true => None,
                    false => created_energy(model, &motion, &state.u),
                })
                .chain(
                    self.recorder
                        .growth
                        .warning::<D>(horizon, set_free(&motion)),
                )
                .chain(unusual_stretch(model, self.rest)?)
                .chain(self.rotation.as_ref().map(Rotation::warning))
                .chain(self.parts.told(&self.seen.passed, state.time))
                .chain(self.doubts.told())
                .chain(motion.edge_warning())
                .collect(),
            dimension: D,
            applied,
            reactions: self.recorder.reactions(),
            sections: self.recorder.section_forces(),
            tips: self.recorder.tips.iter().flatten().cloned().collect(),
            iterations: self.iterations,
            motion: Some(motion),
            files: self.recorder.files(),
            rotation: self.rotation,
            ..RunSummary::default()
        })
    }
}
