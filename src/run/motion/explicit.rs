//! A scene in time: from its beginning or a checkpoint to its end, an interrupt, or the edge of the nonlocal zone.

use super::RunOptions;
use super::breaks::{Breaks, breaks};
use super::contact::ContactRecord;
use super::dynamic_system::{LayoutStart, PlaneEnergy, plane_energy};
use super::guard::{Balance, energies_are_apart};
use super::impact_record::ImpactRecord;
use super::initial_state::{PreStep, RezoneState};
use super::rezoning::{Leaving, share};
use super::saved::{EdgeReached, Saved, SavedZone, StepChoice};
use super::setup::{ModelSetup, RunSetup, begun, lay_out, opened};
use super::sharing::sharing;
use super::step_observer::{Segment, StepObserver, Stop, Watched};
use super::writer::{Moment, Recorder};
use crate::observe::checkpoint::{CheckpointError, CheckpointFile};
use crate::observe::cracks::CrackSummary;
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
    let mut from = From::Start(file, saved.map(Box::new));
    let start = LayoutStart {
        broken: None,
        ranks: options.ranks,
        sharing: sharing(&problem, &rest, options),
    };
    loop {
        let bonds = match &mut from {
            From::Start(..) => None,
            From::Switch(between) => Some(std::mem::take(&mut between.broken)),
        };
        let start = LayoutStart {
            broken: bonds.as_ref(),
            ..start
        };
        let (segment, back) = lay_out(begun, problem, &rest, start, progress, |laid_out| {
            let model = laid_out.model;
            run_segment(laid_out, from, &rest, spec, options, progress)
                .map_err(|error| explained(error, model, &model.local_laws(&rest.local_laws)))
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
        From::Start(file, saved) => before.at_start(*options, file, saved.map(|saved| *saved))?,
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

/// Energies and cracks at the end of steps in time or of load steps: of a state with its system and its kinetic energy.
///
/// # Errors
/// [`RunError::Fracture`].
pub(super) fn end_of_steps<const D: usize>(
    (model, rest): (&Model<D>, &RunSettings<D>),
    recorder: &mut Recorder<'_, D>,
    (state, system, kinetic): (&State, &dyn SemiDiscrete, f64),
    (breaks, edge, pace): (Breaks, Option<EdgeReached>, StepChoice),
) -> Result<MotionSummary, RunError> {
    let stored = system.stored_energy(&state.u);
    let plane = plane_energy(model, rest)?;
    let area = recorder.crack_area(state.broken, system);
    Ok(MotionSummary {
        ended: Ended::Finished,
        steps: state.step,
        of_steps: pace.steps,
        time: state.time,
        step: pace.step,
        stable_step: None,
        kinetic_energy: kinetic,
        stored_energy: stored,
        external_work: state.work,
        missing_energy: recorder.energy_at_start + state.work - kinetic - stored,
        energy_gain: None,
        cracks: cracks(system, breaks, area, plane),
        inelastic_energy: inelastic_energy(system),
        impactors: (recorder.impact.as_ref()).map_or(Vec::new(), |i| i.summary(state)),
        broken_bonds: state.broken,
        edge_reached: edge.map(|e| {
            let x = model.sites[e.site as usize].position;
            (e.time, x.iter().copied().collect())
        }),
        steps_per_second: 0.0,
        switches: Vec::new(),
        nonlocal_share: [0.0; 3],
        processes: Vec::new(),
    })
}

/// Returns the dissipation by breaking bonds so far, and the area of the cracks; none where no bond can break.
fn cracks(
    system: &dyn SemiDiscrete,
    breaks: Breaks,
    area: f64,
    plane: Option<PlaneEnergy>,
) -> Option<CrackSummary> {
    let spent = system.dissipation().filter(|_| breaks.may())?;
    if breaks == Breaks::Gradually {
        // what the law dissipated is told of on its own: most of it beside the cracks
        return Some(CrackSummary {
            energy_per_area: None,
            ..CrackSummary::new(spent.energy, area)
        });
    }
    Some(CrackSummary {
        plane_energy: plane.map(|p| p.of_plane),
        fracture_energy: plane.and_then(|p| p.typed),
        ..CrackSummary::new(spent.energy, area)
    })
}

/// Returns the energy that a law with history variables has dissipated; none if that is zero.
fn inelastic_energy(system: &dyn SemiDiscrete) -> Option<f64> {
    let inelastic = system.dissipation().map(|d| d.inelastic);
    inelastic.filter(|energy| *energy != 0.0)
}
