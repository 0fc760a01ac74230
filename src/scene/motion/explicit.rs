//! A scene in time: from its beginning or a checkpoint to its end, an interrupt, or the edge of the nonlocal zone.

use std::ops::ControlFlow;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::RunOptions;
use super::drive::SceneDrive;
use super::laid_out::{LaidOut, breaks, laid_out, opened, restore};
use super::pace::{held, paced};
use super::record::{Breaks, EdgeReached, Moment, Recorder, Saved};
use super::system::start;
use crate::coupling::{Model, Operator, Sampler, SiteKind};
use crate::observe::ObserveError;
use crate::observe::checkpoint::CheckpointFile;
use crate::observe::summary::{
    Choice, Ended, MotionSummary, RunSummary, Sizes, bytes_text, peak_memory_bytes,
};
use crate::progress::Progress;
use crate::scene::run::{self, RunError, Solved};
use crate::scene::solve::Explicit as Spec;
use crate::scene::spec::EdgeSpec;
use crate::scene::validate::Scene;
use crate::solve::explicit::{Explicit, ExplicitParams};

/// How often whoever watches is told.
const TOLD_EVERY: Duration = Duration::from_millis(200);

/// Whether an instant of a regular sequence lies in the step that ends at `step · dt`.
fn is_due(step: u64, dt: f64, interval: f64) -> bool {
    // an instant that falls on the end of a step belongs to it, whatever rounding says
    let count = |n: u64| (n as f64 * dt / interval * (1.0 + 1e-12) + 1e-9).floor();
    step > 0 && count(step) > count(step - 1)
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
    laid_out(
        scene,
        progress,
        |rest, choices| opened(rest, options, choices),
        |laid_out, (file, saved)| steps(laid_out, file, saved, spec, options, progress),
    )
}

/// Steps from the beginning or a checkpoint.
fn steps<const D: usize>(
    laid_out: LaidOut<'_, D>,
    file: CheckpointFile,
    saved: Option<Saved>,
    spec: &Spec,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    let LaidOut {
        title,
        joining,
        growing,
        model,
        operator,
        rest,
        moving,
        mut choices,
        mut timings,
        mut watch,
        ..
    } = laid_out;
    choices.push(Choice {
        choice: format!("{} in rows and bonds", bytes_text(moving.bytes as u64)),
        why: "read once per step".to_owned(),
    });
    progress.stage("stable step", None);
    let held = held(model, &rest.conditions)?;
    let known = saved.as_ref().map(|saved| saved.pace);
    let (mut moving, pace) = paced(spec, growing, moving, &held, known, &mut choices)?;
    watch.lap(&mut timings, "stable step");

    let begin = start(model, &rest.initial);
    let drive = SceneDrive::new(model, &rest.conditions, &begin.u, pace.step, pace.steps)?;
    if drive.evaluates_everywhere() {
        choices.push(Choice {
            choice: "loads evaluated at every place and step".to_owned(),
            why: "an expression holds both t and a coordinate; written as two conditions, each with one, it would cost nothing"
                .to_owned(),
        });
    }
    restore(moving.system.as_mut(), saved.as_ref(), &file)?;
    let breaks = breaks(moving.system.as_ref(), rest);
    let sampler = Sampler::new(model);
    let mut recorder = Recorder::new(
        &rest.output,
        &sampler,
        breaks,
        moving.is_linear,
        file,
        options.checkpoint_every.or(spec.checkpoint_every),
        saved.as_ref().map(|s| &s.written),
    )?;
    let zones = run::zone_of_site(model);
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
            model,
            operator,
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
        sizes: sizes(model, operator),
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

pub(super) fn moment<'m>(motion: &'m Explicit<'_>, is_linear: bool) -> Moment<'m> {
    let energies = motion.energies();
    Moment {
        state: motion.state(),
        system: motion.system(),
        kinetic: energies.kinetic,
        discrete: is_linear.then_some(energies.discrete),
    }
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
