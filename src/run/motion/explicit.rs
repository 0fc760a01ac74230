//! A scene in time: from its beginning or a checkpoint to its end, an interrupt, or the edge of the nonlocal zone.

use std::ops::ControlFlow;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::RunOptions;
use super::dynamic_system::{PlaneEnergy, critical_stretch, plane_energy};
use super::guard::{Balance, Guard};
use super::initial_state::{PreStep, RezoneState, StepState};
use super::rezoning::{Leaving, share};
use super::setup::{ModelSetup, RunSetup, begun, breaks, lay_out, opened};
use super::writer::{Breaks, EdgeReached, Moment, Saved, Zone as FollowedZone};
use super::zone_monitor::{ZoneMonitor, fastest_crack};
use crate::coupling::{BrokenBonds, Model, Operator, SiteKind, Zone};
use crate::observe::ObserveError;
use crate::observe::checkpoint::{CheckpointError, CheckpointFile};
use crate::observe::cracks::CrackSummary;
use crate::observe::summary::{
    Ended, EnergyGain, MotionSummary, Rotation, RunSummary, Sizes, Stopwatch, Timings,
    peak_memory_bytes,
};
use crate::progress::Progress;
use crate::run::error::RunError;
use crate::run::loads;
use crate::run::setup::RunSettings;
use crate::run::solution::{self, Solved};
use crate::run::warnings::{locking, warnings};
use crate::scene::solve::Explicit as Spec;
use crate::scene::spec::EdgeSpec;
use crate::scene::validated::Scene;
use crate::solve::explicit::{Explicit, ExplicitParams};
use crate::system::SemiDiscrete;

/// How often whoever watches is told.
const TOLD_EVERY: Duration = Duration::from_millis(200);

/// Whether an instant of a regular sequence lies in the step from `before` to `after`.
fn is_due(before: f64, after: f64, interval: f64) -> bool {
    // an instant that falls on the end of a step belongs to it, whatever rounding says
    let count = |t: f64| (t / interval * (1.0 + 1e-12) + 1e-9).floor();
    count(after) > count(before)
}

/// The sizes of a model that moves.
pub fn sizes<const D: usize>(model: &Model<D>, operator: &dyn Operator<D>) -> Sizes {
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
    /// The nonlocal zone has to change to these cells.
    Switch(Vec<bool>),
}

/// Where a run with one layout of zones begins.
enum From<'a, const D: usize> {
    /// At time zero, or at a checkpoint.
    Start(CheckpointFile, Option<Box<Saved>>),
    /// Where the zones have changed.
    Switch(Box<RezoneState<'a, D>>),
}

/// How it ends.
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
    let (mut begun, mut problem, rest) = begun(scene);
    let (file, saved) = opened(&rest, options, &mut begun.choices)?;
    if let Some(saved) = &saved {
        let cells = problem.mesh.cell_count();
        let fits = |zone: &FollowedZone| zone.nonlocal.len() == cells && zone.wanted.len() == cells;
        if saved.zone.is_some() != rest.follow.is_some()
            || saved.zone.as_ref().is_some_and(|z| !fits(z))
        {
            return Err(RunError::Checkpoint(CheckpointError::Content {
                path: file.path().to_path_buf(),
                message: "its nonlocal zone is not one of this mesh".to_owned(),
            }));
        }
        if let Some(zone) = &saved.zone {
            problem.zones = zones_of(&zone.nonlocal);
        }
    }
    let mut from = From::Start(file, saved.map(Box::new));
    loop {
        let (leg, back) = match from {
            From::Start(..) => lay_out(begun, problem, &rest, None, progress, |laid_out| {
                leg(laid_out, from, &rest, spec, options, progress)
            })?,
            From::Switch(mut between) => {
                let bonds = std::mem::take(&mut between.broken);
                let broken = Some(&bonds);
                lay_out(begun, problem, &rest, broken, progress, |laid_out| {
                    leg(
                        laid_out,
                        From::Switch(between),
                        &rest,
                        spec,
                        options,
                        progress,
                    )
                })?
            }
        };
        problem = back;
        match leg {
            RunSegment::Ended(summary) => return Ok(*summary),
            RunSegment::Switch(next, between) => {
                problem.zones = zones_of(&between.nonlocal);
                begun = next;
                from = From::Switch(between);
            }
        }
    }
}

/// Zones of cells that are nonlocal or local.
fn zones_of(nonlocal: &[bool]) -> Vec<Zone> {
    let zone = |n: &bool| if *n { Zone::Nonlocal } else { Zone::Local };
    nonlocal.iter().map(zone).collect()
}

/// Steps with one layout of the zones, from the beginning, a checkpoint, or where the last one ended.
fn leg<'r, const D: usize>(
    laid_out: ModelSetup<'_, D>,
    from: From<'r, D>,
    rest: &'r RunSettings<D>,
    spec: &Spec,
    options: &RunOptions<'r>,
    progress: &dyn Progress,
) -> Result<RunSegment<'r, D>, RunError> {
    let ModelSetup {
        title,
        joining,
        remedy,
        proved,
        model,
        operator,
        moving,
        mut choices,
        mut proof,
        mut timings,
        mut watch,
        ..
    } = laid_out;
    progress.stage("stable step", None);
    let before = PreStep {
        model,
        rest,
        spec,
        moving,
        remedy,
        proved,
        choices: &mut choices,
        timings: &mut timings,
        watch: &mut watch,
    };
    let StepState {
        mut moving,
        mut recorder,
        state,
        pace,
        drive,
        mut edge,
        mut zone,
        seen,
        growth,
        told,
        taken: (taken_before, seconds_before),
        resumed,
        due,
    } = match from {
        From::Start(file, saved) => {
            let saved = saved.map(|saved| *saved);
            before.at_start(*options, file, saved)?
        }
        From::Switch(between) => before.after_switch(*between)?,
    };
    let breaks = breaks(moving.system.as_ref(), rest);
    let zones = solution::zone_of_site(model);
    let is_linear = moving.is_linear;
    let balance = proved.map_or(Balance::Watched, |_| Balance::Proved);
    let mut guard = Guard::new(model, balance, spec, is_linear, pace.steps, seen);
    let eyes = match &rest.follow {
        Some(follow) => critical_stretch(model, rest)?
            .zip(model.body())
            .map(|(critical, body)| {
                let critical = critical.at(body.cloud.horizon[0]);
                let speed = fastest_crack(model, |m| rest.density[m as usize]);
                ZoneMonitor::new(follow, model, critical, speed, pace.step)
            }),
        None => None,
    };
    let mut motion = Explicit::new(
        moving.system.as_mut(),
        &drive,
        ExplicitParams::with_step(pace.step),
        state,
    )?;
    let solved =
        |moment: &Moment<'_>, visit: &mut dyn FnMut(&Solved<'_, D>) -> Result<(), ObserveError>| {
            visit(&Solved {
                model,
                operator,
                displacement: &moment.state.u,
                residual: &[],
                zone_of_site: &zones,
                system: Some(moment.system),
                broken: &moment.broken_bonds(),
            })
        };
    let place = |site: usize| model.sites[site].position;
    let first = motion.state().step;
    {
        let moment = moment(&motion, is_linear);
        if !resumed {
            recorder.begin(&moment);
            let energies = recorder.energies(&moment);
            guard.look_at_energies(&moment, &energies);
            recorder.row(&moment, energies, place)?;
            solved(&moment, &mut |s| recorder.output(&moment, s))?;
        }
        if due {
            recorder.checkpoint(&moment, pace, edge, zone.clone(), &guard.seen)?;
        }
    }
    // a checkpoint that an interrupt left behind, in the step in which the zone was to be looked at
    let mut stop = match (&eyes, &mut zone) {
        (Some(eyes), Some(zone)) if !zone.looked => {
            let arrived = edge.is_none() && motion.system().damage_at_edge().is_some();
            let [due, whole] = eyes.looks_after(first).map(|due| due || arrived);
            due.then(|| {
                let state = motion.state();
                eyes.look(
                    &state.u,
                    (state.time, pace.steps - state.step),
                    motion.system(),
                    whole,
                    &mut zone.wanted,
                )
            })
            .flatten()
            .map(Stop::Switch)
        }
        _ => None,
    };
    watch.lap(&mut timings, "start");
    let written = recorder.seconds;

    progress.stage("steps", Some(pace.steps));
    progress.advance(first);
    let must_switch = stop.is_some();
    let clock = Instant::now();
    let mut looking = 0.0;
    let mut told_at = Instant::now();
    let mut known_broken = u64::MAX;
    let mut is_late = false;
    options.begin_steps();
    let mut observe = |motion: &Explicit<'_>| -> ControlFlow<()> {
        let moment = moment(motion, is_linear);
        let state = moment.state;
        let last = state.step == pace.steps;
        let (mut ended, mut arrived) = (None, false);
        if breaks == Breaks::Possibly && state.broken != known_broken && edge.is_none() {
            known_broken = state.broken;
            edge = motion.system().damage_at_edge().map(|site| EdgeReached {
                step: state.step,
                time: state.time,
                site: site as u64,
            });
            arrived = edge.is_some();
        }
        let mut next = None;
        if let (Some(eyes), Some(zone)) = (&eyes, &mut zone) {
            // damage that has come to the edge between two looks is looked at too
            let [due, whole] = eyes.looks_after(state.step).map(|due| due || arrived);
            zone.looked = !last && due;
            if zone.looked {
                let begun = Instant::now();
                next = eyes.look(
                    &state.u,
                    (state.time, pace.steps - state.step),
                    motion.system(),
                    whole,
                    &mut zone.wanted,
                );
                looking += begun.elapsed().as_secs_f64();
            }
            if next.is_some() {
                edge = None;
            }
        }
        let (before, after) = (pace.time(state.step - 1), pace.time(state.step));
        let row_is_due = last || is_due(before, after, spec.history_interval);
        let energies =
            (row_is_due || guard.wants_energies(state.step)).then(|| recorder.energies(&moment));
        let gained = energies.and_then(|e| guard.look_at_energies(&moment, &e));
        let limit = guard.look_at_rotation(&moment, last).or(gained);
        if edge.is_some() && rest.breaking.at_edge == EdgeSpec::Stop {
            ended = Some(Ended::DamageAtEdge);
        } else if limit.is_some() {
            ended = limit;
        } else if options.interrupt.is_some_and(|i| i.load(Ordering::Relaxed)) && !last {
            ended = Some(Ended::Interrupted);
        }
        let stops = ended.is_some_and(|e| e != Ended::Interrupted);
        if let (Some(_), Some(zone)) = (ended, &mut zone) {
            // the run that goes on from here looks again
            zone.looked = false;
            next = None;
        }
        let mut write = || -> Result<(), ObserveError> {
            if row_is_due || stops {
                let energies = energies.unwrap_or_else(|| recorder.energies(&moment));
                recorder.row(&moment, energies, place)?;
            }
            if last || stops || is_due(before, after, spec.output_interval) {
                solved(&moment, &mut |s| recorder.output(&moment, s))?;
            }
            let leave = ended.is_some() || (last && recorder.keeps_state());
            if leave || recorder.is_checkpoint_due(state.step) {
                if next.is_some() {
                    // of the state in the next layout
                    is_late = true;
                } else {
                    recorder.checkpoint(&moment, pace, edge, zone.clone(), &guard.seen)?;
                }
            }
            Ok(())
        };
        if let Err(error) = write() {
            stop = Some(Stop::Failed(error));
            return ControlFlow::Break(());
        }
        progress.advance(1);
        if told_at.elapsed() >= TOLD_EVERY {
            told_at = Instant::now();
            let speed = (state.step - first) as f64 / clock.elapsed().as_secs_f64();
            let energy = recorder.last.kinetic + recorder.last.stored;
            let broken = match breaks {
                Breaks::Possibly => format!(", {} bonds broken", state.broken),
                Breaks::Never | Breaks::Dissipating => String::new(),
            };
            progress.tell(&format!(
                "step {}, t = {:.3e}, energy {energy:.3e}{broken}, {speed:.0} steps/s",
                state.step, state.time
            ));
        }
        match (ended, next) {
            (Some(why), _) => {
                stop = Some(Stop::Ended(why));
                ControlFlow::Break(())
            }
            (None, Some(nonlocal)) => {
                stop = Some(Stop::Switch(nonlocal));
                ControlFlow::Break(())
            }
            (None, None) => ControlFlow::Continue(()),
        }
    };
    if !must_switch {
        motion.run(pace.steps, &mut observe)?;
    }
    let seconds = clock.elapsed().as_secs_f64();
    timings.add("steps", seconds - (recorder.seconds - written) - looking);
    timings.add("output", recorder.seconds - written);
    if eyes.is_some() {
        timings.add("looks at the zone", looking);
    }
    let taken = (
        taken_before + motion.state().step - first,
        seconds_before + seconds,
    );
    let ended = match stop {
        Some(Stop::Failed(error)) => return Err(error.into()),
        Some(Stop::Switch(nonlocal)) => {
            let state = motion.into_state();
            let system = moving.system.as_ref();
            let next = RunSetup {
                title,
                joining,
                remedy,
                choices,
                timings: Timings::default(),
                watch: Stopwatch::start(),
            };
            let between = RezoneState {
                told,
                timings,
                broken: BrokenBonds::of(model, &system.broken_bonds()),
                spent: system.dissipation(),
                leaving: Leaving::of(model, system, state),
                nonlocal,
                recorder,
                due: is_late,
                pace,
                edge,
                zone,
                seen: guard.seen,
                growth,
                taken,
            };
            return Ok(RunSegment::Switch(next, Box::new(between)));
        }
        Some(Stop::Ended(why)) => why,
        None => Ended::Finished,
    };
    progress.finish();

    let moment = moment(&motion, is_linear);
    let stored = moment.system.stored_energy(&moment.state.u);
    let plane = plane_energy(model, rest)?;
    let state = moment.state;
    let (_, applied) = loads::loads(model, &rest.conditions, state.time)?;
    let energy_gain = guard.energy_gain();
    let rotation = guard.rotation();
    proof.parts.extend(growth);
    let mut told = warnings(model, joining, &proof);
    told.extend(locking(model, &rest.local_laws));
    told.extend(energy_gain.as_ref().and_then(EnergyGain::warning));
    told.extend(rotation.as_ref().map(Rotation::warning));
    let (switches, shares) = zone.map_or((Vec::new(), [0.0; 2]), |z| (z.switches, z.shares));
    Ok(RunSegment::Ended(Box::new(RunSummary {
        scene: title,
        dimension: D,
        coupling: joining.name.to_owned(),
        sizes: sizes(model, operator),
        choices,
        total_seconds: timings.total(),
        timings,
        peak_memory_bytes: peak_memory_bytes(),
        warnings: told,
        proof,
        applied,
        rotation,
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
            energy_gain,
            cracks: cracks(moment.system, breaks, plane),
            inelastic_energy: inelastic_energy(moment.system),
            broken_bonds: state.broken,
            edge_reached: edge.map(|e| {
                let x = place(e.site as usize);
                (e.time, x.iter().copied().collect())
            }),
            steps_per_second: if taken.0 > 0 {
                taken.0 as f64 / taken.1
            } else {
                0.0
            },
            nonlocal_share: [shares[0], shares[1], share(model)],
            switches,
        }),
        files: recorder.files(),
        ..RunSummary::default()
    })))
}

/// What breaking bonds cost so far; none where none can break.
pub(crate) fn cracks(
    system: &dyn SemiDiscrete,
    breaks: Breaks,
    plane: Option<PlaneEnergy>,
) -> Option<CrackSummary> {
    let spent = system
        .dissipation()
        .filter(|_| breaks == Breaks::Possibly)?;
    Some(CrackSummary {
        plane_energy: plane.map(|p| p.of_plane),
        fracture_energy: plane.and_then(|p| p.typed),
        ..CrackSummary::new(spent.energy, spent.area)
    })
}

/// What a law with memory dissipated; none of any other.
pub fn inelastic_energy(system: &dyn SemiDiscrete) -> Option<f64> {
    let inelastic = system.dissipation().map(|d| d.inelastic);
    inelastic.filter(|energy| *energy != 0.0)
}

/// The present moment of a run, as tables write it.
pub fn moment<'m>(motion: &'m Explicit<'_>, is_linear: bool) -> Moment<'m> {
    let energies = motion.energies();
    Moment {
        state: motion.state(),
        system: motion.system(),
        kinetic: energies.kinetic,
        discrete: is_linear.then_some(energies.discrete),
        supports: (motion.external_force(), motion.applied()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_are_met_once_each_whatever_rounding_says() {
        let due =
            |n: u64, dt: f64, interval: f64| is_due((n - 1) as f64 * dt, n as f64 * dt, interval);
        for (steps, duration) in [(253u64, 60.0), (1000, 0.1), (7, 7.0), (30_000, 3e-5)] {
            let dt = duration / steps as f64;
            for count in [1u64, 3, 7] {
                let interval = duration / count as f64;
                let due: Vec<u64> = (1..=steps).filter(|&n| due(n, dt, interval)).collect();
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
        assert_eq!((1..=5).filter(|&n| due(n, 1.0, 0.1)).count(), 5);
    }
}
