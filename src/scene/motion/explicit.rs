//! A scene in time: from its beginning or a checkpoint to its end, an interrupt, or the edge of the nonlocal zone.

use std::ops::ControlFlow;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::drive::SceneDrive;
use super::record::{Breaks, EdgeReached, Moment, Recorder, Saved, StepChoice};
use super::system::{dynamic, start};
use super::{RunOptions, StartFrom};
use crate::coupling::{Model, Operator, Sampler, SiteKind};
use crate::observe::ObserveError;
use crate::observe::checkpoint::{CheckpointError, CheckpointFile, Found};
use crate::observe::report::number;
use crate::observe::summary::{
    Choice, Ended, MotionSummary, RunSummary, Sizes, Stopwatch, Timings, bytes_text,
    peak_memory_bytes,
};
use crate::progress::Progress;
use crate::scene::conditions::Condition;
use crate::scene::loads::holders;
use crate::scene::run::{self, RunError, Solved};
use crate::scene::solve::Explicit as Spec;
use crate::scene::spec::{BeyondLimitSpec, EdgeSpec};
use crate::scene::validate::Scene;
use crate::solve::explicit::{Explicit, ExplicitParams};
use crate::solve::stable_step::{StepLimit, stable_step};
use crate::system::Dynamic;

/// How often whoever watches is told.
const TOLD_EVERY: Duration = Duration::from_millis(200);

/// Whether an instant of a regular sequence lies in the step that ends at `step · dt`.
fn is_due(step: u64, dt: f64, interval: f64) -> bool {
    // an instant that falls on the end of a step belongs to it, whatever rounding says
    let count = |n: u64| (n as f64 * dt / interval * (1.0 + 1e-12) + 1e-9).floor();
    step > 0 && count(step) > count(step - 1)
}

/// The time step of a run, such that a whole number of steps fills its duration.
///
/// # Errors
/// [`RunError::Step`] for a step beyond the stable one, unless the scene says to shorten it.
pub(super) fn choose_step(
    spec: &Spec,
    limit: &StepLimit,
    system: &dyn Dynamic,
    prescribed: &[u32],
    choices: &mut Vec<Choice>,
) -> Result<StepChoice, RunError> {
    let own = spec.fraction * limit.stable;
    let (step, why) = match spec.step {
        None => (own, format!("{} of the stable step", spec.fraction)),
        Some(asked) if asked > limit.stable && spec.beyond_limit == BeyondLimitSpec::Shorten => (
            own,
            format!(
                "{} of the stable step, for the one asked for, {asked:e}, is beyond it",
                spec.fraction
            ),
        ),
        asked => (
            limit.admit(asked, system, prescribed)?,
            "as asked for".to_owned(),
        ),
    };
    let steps = (spec.duration / step * (1.0 - 1e-12)).ceil().max(1.0);
    let choice = StepChoice {
        step: spec.duration / steps,
        steps: steps as u64,
        stable: limit.stable,
        certified: limit.certified,
        site: limit.certified_site as u64,
    };
    choices.push(Choice {
        choice: format!("{} steps of {}", choice.steps, number(choice.step)),
        why: format!(
            "{why}, and a whole number of them; stable up to {}, from row sums up to {}",
            number(limit.stable),
            number(limit.certified)
        ),
    });
    Ok(choice)
}

/// The dofs whose motion is prescribed.
///
/// # Errors
/// [`RunError::Idle`] for a condition that meets no site.
pub(super) fn held<const D: usize>(
    model: &Model<D>,
    conditions: &[Condition<D>],
) -> Result<Vec<u32>, RunError> {
    let holders = holders(model, conditions)?;
    let dofs = holders.iter().enumerate();
    Ok(dofs.filter_map(|(dof, h)| h.map(|_| dof as u32)).collect())
}

/// The sizes of a model that moves.
pub(super) fn sizes<const D: usize>(model: &Model<D>, operator: &dyn Operator<D>) -> Sizes {
    Sizes {
        nodes: model.mesh.nodes.len(),
        cells: model.mesh.cell_count(),
        sites: model.sites.len(),
        points: model
            .sites
            .iter()
            .filter(|s| matches!(s.kind, SiteKind::Point(_)))
            .count(),
        bonds: model.body().map_or(0, |b| b.bond_count()) + operator.additional_bonds(),
        dofs: model.sites.len() * D,
        nonzeros: 0,
    }
}

/// Why the run loop was left early.
enum Stop {
    /// Something could not be written.
    Failed(ObserveError),
    /// For this reason.
    Ended(Ended),
}

/// Runs a scene in time.
pub(super) fn run<const D: usize>(
    scene: Scene<D>,
    spec: &Spec,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    let mut timings = Timings::default();
    let mut watch = Stopwatch::start();
    let title = scene.title.clone();
    let joining = scene.coupling.joining();
    let (problem, rest) = run::problem(scene);
    let file = CheckpointFile::new(
        rest.output
            .directory
            .join(format!("{}.checkpoint", rest.output.name)),
        rest.fingerprint.value(),
    );
    let mut choices = Vec::new();
    // before anything is computed: a checkpoint that cannot be used says so at once
    let saved = match options.start {
        StartFrom::Beginning => None,
        StartFrom::Checkpoint => read(&file, &mut choices)?,
    };
    let (model, coupling) = Model::new(problem, progress)?;
    watch.lap(&mut timings, "sites and bonds");
    let operator = coupling.operator(&model)?;
    let mut moving = dynamic(
        &model,
        coupling.as_ref(),
        operator.as_ref(),
        &rest,
        &mut choices,
        progress,
    )?;
    choices.push(Choice {
        choice: format!("{} in rows and bonds", bytes_text(moving.bytes as u64)),
        why: "read once per step".to_owned(),
    });
    watch.lap(&mut timings, "rows and bonds");
    let pace = match &saved {
        Some(saved) => saved.pace,
        None => {
            progress.stage("stable step", None);
            let held = held(&model, &rest.conditions)?;
            let limit = stable_step(moving.system.as_ref(), &held)?;
            choose_step(spec, &limit, moving.system.as_ref(), &held, &mut choices)?
        }
    };
    watch.lap(&mut timings, "stable step");

    let begin = start(&model, &rest.initial);
    let drive = SceneDrive::new(&model, &rest.conditions, &begin.u, pace.step, pace.steps)?;
    if drive.evaluates_everywhere() {
        choices.push(Choice {
            choice: "loads evaluated at every place and step".to_owned(),
            why: "an expression holds both t and a coordinate; written as two conditions, each with one, it would cost nothing"
                .to_owned(),
        });
    }
    if let Some(saved) = &saved
        && !moving.system.restore_damage(&saved.damage)
    {
        return Err(CheckpointError::Content {
            path: file.path().to_path_buf(),
            message: "its bonds are not those of this model".to_owned(),
        }
        .into());
    }
    let breaks = match moving.system.damage() {
        Some(_) if rest.breaking.fracture.is_some() => Breaks::Possibly,
        _ => Breaks::Never,
    };
    let sampler = Sampler::new(&model);
    let mut recorder = Recorder::new(
        &rest.output,
        &sampler,
        breaks,
        moving.is_linear,
        file,
        options.checkpoint_every.or(spec.checkpoint_every),
        saved.as_ref().map(|s| &s.written),
    )?;
    let zones = run::zone_of_site(&model);
    let is_linear = moving.is_linear;
    let mut edge = saved.as_ref().and_then(|s| s.edge);
    let resumed = saved.is_some();
    let state = saved.map_or(begin, |s| s.state);
    let mut motion = Explicit::new(
        moving.system.as_mut(),
        &drive,
        ExplicitParams::with_step(pace.step),
        state,
    )?;
    let solved = |u: &[f64], visit: &mut dyn FnMut(&Solved<'_, D>) -> Result<(), ObserveError>| {
        visit(&Solved {
            model: &model,
            operator: operator.as_ref(),
            displacement: u,
            residual: &[],
            zone_of_site: &zones,
        })
    };
    let place = |site: usize| model.sites[site].position;
    let first = motion.state().step;
    {
        let moment = moment(&motion, is_linear);
        if !resumed {
            recorder.begin(&moment);
            recorder.row(&moment, place)?;
            solved(&moment.state.u, &mut |s| recorder.output(&moment, s))?;
        }
    }
    watch.lap(&mut timings, "start");
    let written = recorder.seconds;

    progress.stage("steps", Some(pace.steps));
    progress.advance(first);
    let clock = Instant::now();
    let mut told = Instant::now();
    let mut known_broken = u64::MAX;
    let mut stop = None;
    let mut observe = |motion: &Explicit<'_>| -> ControlFlow<()> {
        let moment = moment(motion, is_linear);
        let state = moment.state;
        let last = state.step == pace.steps;
        let mut ended = None;
        if breaks == Breaks::Possibly && state.broken != known_broken && edge.is_none() {
            known_broken = state.broken;
            edge = motion.system().damage_at_edge().map(|site| EdgeReached {
                step: state.step,
                time: state.time,
                site: site as u64,
            });
        }
        if edge.is_some() && rest.breaking.at_edge == EdgeSpec::Stop {
            ended = Some(Ended::DamageAtEdge);
        } else if options.interrupt.is_some_and(|i| i.load(Ordering::Relaxed)) && !last {
            ended = Some(Ended::Interrupted);
        }
        let at_edge = ended == Some(Ended::DamageAtEdge);
        let mut write = || -> Result<(), ObserveError> {
            if last || at_edge || is_due(state.step, pace.step, spec.history_interval) {
                recorder.row(&moment, place)?;
            }
            if last || at_edge || is_due(state.step, pace.step, spec.output_interval) {
                solved(&state.u, &mut |s| recorder.output(&moment, s))?;
            }
            let leave = ended.is_some() || (last && recorder.keeps_state());
            if leave || recorder.is_checkpoint_due(state.step) {
                recorder.checkpoint(&moment, pace, edge)?;
            }
            Ok(())
        };
        if let Err(error) = write() {
            stop = Some(Stop::Failed(error));
            return ControlFlow::Break(());
        }
        progress.advance(1);
        if told.elapsed() >= TOLD_EVERY {
            told = Instant::now();
            let speed = (state.step - first) as f64 / clock.elapsed().as_secs_f64();
            let energy = recorder.last.kinetic + recorder.last.stored;
            let broken = match breaks {
                Breaks::Possibly => format!(", {} bonds broken", state.broken),
                Breaks::Never => String::new(),
            };
            progress.tell(&format!(
                "step {}, t = {:.3e}, energy {energy:.3e}{broken}, {speed:.0} steps/s",
                state.step, state.time
            ));
        }
        match ended {
            Some(why) => {
                stop = Some(Stop::Ended(why));
                ControlFlow::Break(())
            }
            None => ControlFlow::Continue(()),
        }
    };
    motion.run(pace.steps, &mut observe)?;
    let ended = match stop {
        Some(Stop::Failed(error)) => return Err(error.into()),
        Some(Stop::Ended(why)) => why,
        None => Ended::Finished,
    };
    let seconds = clock.elapsed().as_secs_f64();
    progress.finish();
    timings.add("steps", seconds - (recorder.seconds - written));
    timings.add("output", recorder.seconds - written);

    let moment = moment(&motion, is_linear);
    let stored = moment.system.stored_energy(&moment.state.u);
    let state = moment.state;
    let taken = state.step - first;
    Ok(RunSummary {
        scene: title,
        dimension: D,
        coupling: joining.name.to_owned(),
        sizes: sizes(&model, operator.as_ref()),
        choices,
        total_seconds: timings.total(),
        timings,
        peak_memory_bytes: peak_memory_bytes(),
        motion: Some(MotionSummary {
            ended,
            steps: state.step,
            of_steps: pace.steps,
            time: state.time,
            step: pace.step,
            stable_step: Some(pace.stable),
            kinetic_energy: moment.kinetic,
            stored_energy: stored,
            external_work: state.work,
            missing_energy: recorder.energy_at_start + state.work - moment.kinetic - stored,
            broken_bonds: state.broken,
            edge_reached: edge.map(|e| {
                let x = place(e.site as usize);
                (e.time, x.iter().copied().collect())
            }),
            steps_per_second: if taken > 0 {
                taken as f64 / seconds
            } else {
                0.0
            },
        }),
        files: recorder.files(),
        ..RunSummary::default()
    })
}

fn moment<'m>(motion: &'m Explicit<'_>, is_linear: bool) -> Moment<'m> {
    let energies = motion.energies();
    Moment {
        state: motion.state(),
        system: motion.system(),
        kinetic: energies.kinetic,
        discrete: is_linear.then_some(energies.discrete),
    }
}

/// The last checkpoint, if there is one.
///
/// # Errors
/// [`CheckpointError`] for one that cannot be used.
pub(super) fn read(
    file: &CheckpointFile,
    choices: &mut Vec<Choice>,
) -> Result<Option<Saved>, CheckpointError> {
    let (saved, found): (Saved, Found) = match file.read() {
        Err(CheckpointError::None { path }) => {
            choices.push(Choice {
                choice: "from the beginning".to_owned(),
                why: format!("there is no checkpoint {} yet", path.display()),
            });
            return Ok(None);
        }
        other => other?,
    };
    choices.push(Choice {
        choice: format!(
            "resumed after step {} of {}",
            saved.state.step, saved.pace.steps
        ),
        why: match found {
            Found::Current => "the last checkpoint".to_owned(),
            Found::Previous(why) => format!("the last checkpoint but one, for {why}"),
        },
    });
    Ok(Some(saved))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_are_met_once_each_whatever_rounding_says() {
        for (steps, duration) in [(253u64, 60.0), (1000, 0.1), (7, 7.0), (30_000, 3e-5)] {
            let dt = duration / steps as f64;
            for count in [1u64, 3, 7] {
                let interval = duration / count as f64;
                let due: Vec<u64> = (0..=steps).filter(|&n| is_due(n, dt, interval)).collect();
                assert_eq!(
                    due.len() as u64,
                    count,
                    "{steps} steps, {count} instants: {due:?}"
                );
                assert_eq!(due.last(), Some(&steps));
                for (k, &n) in due.iter().enumerate() {
                    // the first step that ends at the instant or after it
                    let late = n as f64 * dt - (k + 1) as f64 * interval;
                    assert!(
                        late > -1e-9 * duration && late < dt * (1.0 - 1e-9),
                        "{late}"
                    );
                }
            }
        }
        // more instants than steps: every step
        assert_eq!((0..=5).filter(|&n| is_due(n, 1.0, 0.1)).count(), 5);
    }
}
