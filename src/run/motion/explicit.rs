//! A scene in time: from its beginning or a checkpoint to its end, an interrupt, or the edge of the nonlocal zone.

use super::breaks::breaks;
use super::contact::ContactRecord;
use super::dynamic_system::LayoutStart;
use super::end_of_steps::end_of_steps;
use super::guard::{Balance, energies_are_apart};
use super::impact_record::ImpactRecord;
use super::initial_state::{PreStep, RezoneState};
use super::load_stage::{LoadSteps, forget};
use super::rezoning::{Leaving, share};
use super::saved::{Saved, SavedZone};
use super::setup::{ModelSetup, RunSetup, begun, lay_out, opened};
use super::sharing::sharing;
use super::step_observer::{Segment, StepObserver, Stop, Watched};
use super::writer::Moment;
use super::{RunOptions, StartFrom};
use crate::observe::checkpoint::{CheckpointError, CheckpointFile};
use crate::observe::proof::{Part, Proof};
use crate::observe::summary::{
    Ended, EnergyGain, MotionSummary, Rotation, RunSummary, Stopwatch, peak_memory_bytes,
};
use crate::progress::Progress;
use crate::run::error::{RunError, explained};
use crate::run::loads;
use crate::run::setup::{RunSettings, sizes};
use crate::run::warnings::{of_elements, unusual_stretch, warnings, without_response};
use crate::scene::solve::Explicit as Spec;
use crate::scene::validated::Scene;
use crate::solve::explicit::{Explicit, ExplicitParams, State};
use crate::system::SemiDiscrete;
use crate::{
    coupling::BrokenBonds,
    model::{Model, Zone},
};

/// Start of a segment of a run, which has one layout of the zones.
enum From<'a, const D: usize> {
    /// At time zero, or at a checkpoint.
    Start(CheckpointFile, Option<Box<Saved>>),
    /// At time zero, with the last state of load steps before.
    Loaded(CheckpointFile, Box<State>),
    /// At a change of the zones.
    Switch(Box<RezoneState<'a, D>>),
}

/// End of a segment of a run.
enum RunSegment<'a, const D: usize> {
    /// With the run.
    Ended(Box<RunSummary>),
    /// In a change of the zones.
    Switch(RunSetup, Box<RezoneState<'a, D>>),
}

/// Runs a scene in time.
pub(crate) fn run<const D: usize>(
    scene: Scene<D>,
    spec: &Spec,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    let (mut begun, mut problem, rest) = begun(scene, progress)?;
    let (file, saved) = opened(&rest, options, &mut begun.choices)?;
    if let Some(saved) = &saved {
        let cells = problem.body.mesh.cell_count();
        let fits = |zone: &SavedZone| zone.nonlocal.len() == cells && zone.wanted.len() == cells;
        if saved.zone.is_some() != rest.follow.is_some()
            || saved.zone.as_ref().is_some_and(|z| !fits(z))
        {
            return Err(RunError::Checkpoint(CheckpointError::Content {
                path: file.path().to_path_buf(),
                message: "its nonlocal zone is not one of this mesh".to_owned(),
            }));
        }
        if let Some(zone) = &saved.zone {
            problem.body.zones = zones_of(&zone.nonlocal);
        }
    }
    let load = rest.before.as_ref().filter(|_| saved.is_none());
    let load = load.map(|stage| LoadSteps::new(stage, &rest));
    if load.is_some() && options.start == StartFrom::Beginning && options.writes() {
        forget(&rest.output, &file)?;
    }
    let mut from = From::Start(file, saved.map(Box::new));
    let start = LayoutStart {
        broken: None,
        ranks: options.ranks,
        sharing: sharing(&problem, &rest, options),
    };
    loop {
        let bonds = match &mut from {
            From::Start(..) | From::Loaded(..) => None,
            From::Switch(between) => Some(std::mem::take(&mut between.broken)),
        };
        let start = LayoutStart {
            broken: bonds.as_ref(),
            ..start
        };
        let (segment, back) = lay_out(begun, problem, &rest, start, progress, |laid_out| {
            let model = laid_out.model;
            let done = match (&load, from) {
                (Some(load), From::Start(file, None)) => {
                    after_load_steps(laid_out, load, file, &rest, (spec, options), progress)
                }
                (_, from) => run_segment(laid_out, from, &rest, spec, options, progress),
            };
            done.map_err(|error| explained(error, model, &model.local_laws(&rest.local_laws)))
        })?;
        problem = back;
        match segment {
            RunSegment::Ended(summary) => return Ok(*summary),
            RunSegment::Switch(next, between) => {
                problem.body.zones = zones_of(&between.nonlocal);
                begun = next;
                from = From::Switch(between);
            }
        }
    }
}

/// Load steps, and the motion that begins with their last state; a summary of the load steps alone where they end before.
fn after_load_steps<'r, const D: usize>(
    laid_out: ModelSetup<'_, D>,
    load: &LoadSteps<'_, D>,
    file: CheckpointFile,
    rest: &'r RunSettings<D>,
    (spec, options): (&Spec, &RunOptions<'r>),
    progress: &dyn Progress,
) -> Result<RunSegment<'r, D>, RunError> {
    let (first, goes_on) = load.run(laid_out, rest, options, progress)?;
    let Some((laid_out, state)) = goes_on else {
        return Ok(RunSegment::Ended(Box::new(first)));
    };
    let from = From::Loaded(file, Box::new(state));
    let mut done = run_segment(laid_out, from, rest, spec, options, progress)?;
    if let RunSegment::Ended(summary) = &mut done {
        load.tell(first, summary);
    }
    Ok(done)
}

/// Zones of cells that are nonlocal or local.
fn zones_of(nonlocal: &[bool]) -> Vec<Zone> {
    let zone = |n: &bool| {
        if *n { Zone::Nonlocal } else { Zone::Local }
    };
    nonlocal.iter().map(zone).collect()
}

/// Record of a run at the end of a segment, whatever follows.
struct SegmentRecord {
    setup: RunSetup,
    proof: Proof,
    /// Part of the proof about growing modes.
    growth: Option<Part>,
    /// Steps taken by this program, and their seconds.
    taken: (u64, f64),
}

/// Decides whether the balance of energy is watched: a proof for the undeformed body need not hold for one whose law changes with its strain.
fn balance_of<const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
    is_proved: bool,
    is_linear: bool,
) -> Balance {
    if energies_are_apart(model, rest, is_linear) {
        return Balance::Apart;
    }
    let points = model.peridynamics.as_ref();
    let follows_law = !rest.impactors.is_empty()
        || rest.breaking.contact.is_some()
        || rest.has_nonlinear_elements(model)
        || points.is_some_and(|p| !p.law.is_linear() && p.law.accelerator().is_none());
    match is_proved {
        true if follows_law => Balance::WatchedForLaw,
        true => Balance::Proved,
        false => Balance::Watched,
    }
}

/// Steps with one layout of the zones, from the beginning, a checkpoint, or where the last one ended.
// One function: what a segment is made of, in the order in which it is found.
fn run_segment<'r, const D: usize>(
    laid_out: ModelSetup<'_, D>,
    from: From<'r, D>,
    rest: &'r RunSettings<D>,
    spec: &Spec,
    options: &RunOptions<'r>,
    progress: &dyn Progress,
) -> Result<RunSegment<'r, D>, RunError> {
    let (model, operator, proved) = (laid_out.model, laid_out.operator, laid_out.proved);
    let mut record = SegmentRecord {
        setup: laid_out.setup,
        proof: laid_out.proof,
        growth: None,
        taken: (0, 0.0),
    };
    progress.stage("stable step", None);
    let before = PreStep {
        model,
        operator,
        rest,
        spec,
        moving: laid_out.moving,
        terms: laid_out.terms,
        contact: laid_out.contact,
        proved,
        setup: &mut record.setup,
    };
    let mut begin = match from {
        From::Start(file, saved) => {
            before.at_start(*options, file, saved.map(|saved| *saved), None)?
        }
        From::Loaded(file, state) => before.at_start(*options, file, None, Some(*state))?,
        From::Switch(between) => before.after_switch(*between)?,
    };
    let segment = Segment {
        model,
        operator,
        rest,
        spec,
        options,
        progress,
        pace: begin.pace,
        is_linear: begin.moving.is_linear,
        has_exact_seam: begin.moving.has_exact_seam,
        uniform: record.proof.largest("stress error"),
        breaks: breaks(begin.moving.system.as_ref(), rest),
    };
    let watched = Watched {
        balance: balance_of(model, rest, proved.is_some(), segment.is_linear),
        seen: begin.seen,
        edge: begin.edge,
        zone: begin.zone,
    };
    let mut observer = StepObserver::new(&segment, watched, begin.recorder)?;
    let params = ExplicitParams::with_step(begin.pace.step);
    let system = begin.moving.system.as_mut();
    let mut motion = Explicit::new(system, &begin.drive, params, begin.state)?;
    observer.begin(&motion, begin.resumed, begin.due)?;
    record.setup.lap("start");
    let (steps, seconds) = observer.take_steps(&mut motion, &mut record.setup.timings)?;
    record.growth = begin.growth;
    let (steps_before, seconds_before) = begin.taken;
    record.taken = (steps_before + steps, seconds_before + seconds);
    let ended = match observer.stop.take() {
        Some(Stop::Failed(error)) => return Err(error.into()),
        Some(Stop::Switch(nonlocal)) => {
            let state = motion.into_state();
            let system = begin.moving.system.as_ref();
            return Ok(record.rezone(observer, begin.told, system, state, nonlocal));
        }
        Some(Stop::Ended(why)) => why,
        None => Ended::Finished,
    };
    progress.finish();
    let summary = record.summary(observer, &mut motion, ended)?;
    Ok(RunSegment::Ended(Box::new(summary)))
}

impl SegmentRecord {
    /// Returns the state that the next segment needs, where the zones change to `nonlocal` cells.
    fn rezone<'r, const D: usize>(
        mut self,
        observer: StepObserver<'_, 'r, D>,
        told: usize,
        system: &dyn SemiDiscrete,
        state: State,
        nonlocal: Vec<bool>,
    ) -> RunSegment<'r, D> {
        let Segment { model, pace, .. } = *observer.segment;
        let timings = std::mem::take(&mut self.setup.timings);
        self.setup.watch = Stopwatch::start();
        let state_of_body = system.body_state();
        let broken = state_of_body.map_or(Vec::new(), |state| state.broken_bonds());
        let between = RezoneState {
            told,
            timings,
            broken: BrokenBonds::of(model, &broken),
            spent: system.dissipation(),
            leaving: Leaving::of(model, system, state),
            nonlocal,
            recorder: observer.recorder,
            due: observer.is_late,
            pace,
            edge: observer.edge,
            zone: observer.zone,
            seen: observer.guard.seen,
            growth: self.growth,
            taken: self.taken,
        };
        RunSegment::Switch(self.setup, Box::new(between))
    }

    /// The summary of a run that ends here.
    ///
    /// # Errors
    /// [`RunError`] for loads or a fracture energy that cannot be evaluated.
    fn summary<const D: usize>(
        mut self,
        observer: StepObserver<'_, '_, D>,
        motion: &mut Explicit<'_>,
        ended: Ended,
    ) -> Result<RunSummary, RunError> {
        let Segment {
            model,
            operator,
            rest,
            ..
        } = *observer.segment;
        let (_, applied) = loads::loads(model, &rest.conditions, motion.state().time)?;
        let energy_gain = observer.guard.energy_gain();
        let rotation = observer.guard.rotation();
        self.proof.parts.extend(self.growth.take());
        let mut told = warnings(model, self.setup.traits, &self.proof);
        told.extend(of_elements(model, &model.local_laws(&rest.local_laws)));
        told.extend(unusual_stretch(model, rest)?);
        told.extend(without_response(motion.system(), &motion.state().u));
        told.extend(energy_gain.as_ref().and_then(EnergyGain::warning));
        told.extend(rotation.as_ref().map(Rotation::warning));
        told.extend(observer.guard.passed(motion.state().time));
        told.extend(observer.steep.iter().cloned());
        let recorder = &observer.recorder;
        told.extend(recorder.impact.iter().flat_map(ImpactRecord::warnings));
        told.extend(recorder.contact.iter().flat_map(ContactRecord::warnings));
        let files = observer.recorder.files();
        let reactions = observer.recorder.reactions();
        let sections = observer.recorder.section_forces();
        let motion = MotionSummary {
            processes: motion.traffic().unwrap_or_default(),
            ..motion_summary(observer, motion, ended, energy_gain, self.taken)?
        };
        told.extend(motion.edge_warning());
        Ok(RunSummary {
            scene: self.setup.title,
            dimension: D,
            coupling: self.setup.traits.name.to_owned(),
            sizes: sizes(model, operator),
            choices: self.setup.choices,
            total_seconds: self.setup.timings.total(),
            timings: self.setup.timings,
            peak_memory_bytes: peak_memory_bytes(),
            warnings: told,
            proof: self.proof,
            applied,
            reactions,
            sections,
            rotation,
            motion: Some(motion),
            files,
            ..RunSummary::default()
        })
    }
}

/// Energies, cracks and zones at the end of a run in time; `taken` are the steps of this program, and their seconds.
///
/// # Errors
/// [`RunError::Fracture`].
fn motion_summary<const D: usize>(
    mut observer: StepObserver<'_, '_, D>,
    motion: &Explicit<'_>,
    ended: Ended,
    energy_gain: Option<EnergyGain>,
    taken: (u64, f64),
) -> Result<MotionSummary, RunError> {
    let Segment {
        model,
        rest,
        pace,
        breaks,
        ..
    } = *observer.segment;
    let moment = Moment::of(motion, observer.segment.is_linear);
    let (zone, edge) = (observer.zone, observer.edge);
    let (switches, shares) = zone.map_or((Vec::new(), [0.0; 2]), |z| (z.switches, z.shares));
    let now = (moment.state, moment.system, moment.kinetic);
    let summary = end_of_steps(
        (model, rest),
        &mut observer.recorder,
        now,
        (breaks, edge, pace),
    )?;
    Ok(MotionSummary {
        ended,
        stable_step: Some(pace.stable),
        energy_gain,
        steps_per_second: if taken.0 > 0 {
            taken.0 as f64 / taken.1
        } else {
            0.0
        },
        nonlocal_share: [shares[0], shares[1], share(model)],
        switches,
        ..summary
    })
}
