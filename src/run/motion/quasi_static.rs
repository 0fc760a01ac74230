//! A scene under a load that grows: one equilibrium after another, each broken through until no bond breaks.

use std::ops::ControlFlow;
use std::sync::atomic::Ordering;
use std::time::Instant;

use super::RunOptions;
use super::dynamic_system::{plane_energy, start};
use super::explicit::{cracks, inelastic_energy, sizes};
use super::setup::{ModelSetup, breaks, laid_out, opened, restore};
use super::time_dependent_loads::SceneDrive;
use super::writer::{Breaks, EdgeReached, Moment, Recorder, Saved, StepChoice};
use crate::coupling::{Model, Operator, Sampler};
use crate::observe::ObserveError;
use crate::observe::checkpoint::CheckpointFile;
use crate::observe::report::number;
use crate::observe::summary::{
    Decision, Ended, MotionSummary, Rotation, RunSummary, peak_memory_bytes,
};
use crate::progress::Progress;
use crate::run::equilibrium;
use crate::run::error::RunError;
use crate::run::loads;
use crate::run::motion::seen::Seen;
use crate::run::rotation::Rotations;
use crate::run::setup::RunSettings;
use crate::run::solution::{self, Solved};
use crate::run::warnings::{locking, warnings};
use crate::scene::solve::QuasiStatic as Spec;
use crate::scene::spec::{EdgeSpec, LoadStepSpec};
use crate::scene::validated::Scene;
use crate::solve::direct::Factor;
use crate::solve::explicit::Drive;
use crate::solve::krylov::LinearMap;
use crate::solve::quasi_static::{self, Equilibrium, LoadState, LoadStep, QuasiStaticParams};
use crate::solve::statics::{self, StaticProblem};
use crate::system::Symmetry;
use crate::tensor::padded;

/// Runs a scene under a load that grows.
pub(crate) fn run<const D: usize>(
    scene: Scene<D>,
    spec: &Spec,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    laid_out(
        scene,
        progress,
        |rest, choices| opened(rest, options, choices),
        |laid_out, (file, saved)| load_steps(laid_out, file, saved, spec, options, progress),
    )
}

/// Load steps from the beginning or a checkpoint.
fn load_steps<const D: usize>(
    laid_out: ModelSetup<'_, D>,
    file: CheckpointFile,
    saved: Option<Saved>,
    spec: &Spec,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    let ModelSetup {
        title,
        joining,
        model,
        operator,
        rest,
        mut moving,
        mut choices,
        proof,
        mut timings,
        mut watch,
        ..
    } = laid_out;
    let step = spec.duration / spec.steps as f64;
    let pace = StepChoice {
        step,
        steps: spec.steps as u64,
        stable: 0.0,
        certified: 0.0,
        site: 0,
        since: (0, 0.0),
    };
    let params = QuasiStaticParams {
        equilibrium: match spec.method {
            LoadStepSpec::Implicit => Equilibrium::Newton,
            LoadStepSpec::Relaxation => Equilibrium::Relaxation,
        },
        tolerance: spec.tolerance,
        max_iterations: spec.max_iterations,
        ..QuasiStaticParams::default()
    };
    choices.push(Decision {
        choice: match params.equilibrium {
            Equilibrium::Newton => "Newton's method, without a matrix",
            Equilibrium::Relaxation => "adaptive dynamic relaxation",
        }
        .to_owned(),
        why: format!("{} load steps to t = {}", spec.steps, number(spec.duration)),
    });
    let near = match params.equilibrium {
        Equilibrium::Newton => {
            let symmetry = moving.system.symmetry();
            let near = factors(model, operator, symmetry, rest, &mut choices, progress)?;
            watch.lap(&mut timings, "factorisation");
            near
        }
        Equilibrium::Relaxation => None,
    };
    let begin = start(model, &rest.initial);
    let drive = SceneDrive::new(model, &rest.conditions, &begin.u, step, pace.steps)?;
    restore(moving.system.as_mut(), saved.as_ref(), &file)?;
    let breaks = breaks(moving.system.as_ref(), rest);
    let mut recorder = Recorder::new(
        &rest.output,
        &rest.conditions,
        &Sampler::new(model),
        breaks,
        false,
        file,
        RunOptions {
            checkpoint_every: options.checkpoint_every.or(spec.checkpoint_every),
            ..*options
        },
        saved.as_ref().map(|s| &s.written),
    )?;
    recorder.hold(drive.holders());
    let zones = solution::zone_of_site(model);
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
    let mut edge = saved.as_ref().and_then(|s| s.edge);
    let dofs = begin.u.len();
    let mut loaded = LoadState::at_rest(dofs);
    // fields, time, step, work, broken bonds: what a checkpoint keeps
    let mut state = begin;
    if let Some(saved) = saved {
        state = saved.state;
        // the state at t = 0 counts as one of the driver's steps
        loaded.step = state.step + 1;
        loaded.u.clone_from(&state.u);
        loaded.broken = state.broken;
    } else {
        loaded.u.clone_from(&state.u);
    }
    let first = state.step;
    let times = |k: u64| (k <= pace.steps).then_some(k as f64 * step);
    watch.lap(&mut timings, "start");
    let written = recorder.seconds;
    progress.stage("load steps", Some(pace.steps));
    progress.advance(first);
    let clock = Instant::now();
    let mut ended = Ended::Finished;
    let mut failed = None;
    let rotations = Rotations::new(model, moving.is_linear);
    let mut rotation = None;
    options.begin_steps();
    let mut observe = |seen: &LoadStep<'_>| -> ControlFlow<()> {
        let begins = seen.state.step == 1;
        state.work += seen.work;
        let loads: Vec<f64> = drive
            .prescribed()
            .iter()
            .map(|&dof| seen.load[dof as usize])
            .collect();
        state.step = seen.state.step - 1;
        state.time = seen.time;
        state.u.copy_from_slice(&seen.state.u);
        state.broken = seen.state.broken;
        if breaks == Breaks::Possibly && edge.is_none() {
            edge = seen.system.damage_at_edge().map(|site| EdgeReached {
                step: state.step,
                time: state.time,
                site: site as u64,
            });
        }
        let last = state.step == pace.steps;
        if edge.is_some() && rest.breaking.at_edge == EdgeSpec::Stop {
            ended = Ended::DamageAtEdge;
        } else if options.interrupt.is_some_and(|i| i.load(Ordering::Relaxed)) && !last {
            ended = Ended::Interrupted;
        }
        let found = rotations.largest(&state.u);
        let limit = spec.largest_rotation.unwrap_or(f64::INFINITY);
        if ended == Ended::Finished && found.as_ref().is_some_and(|r| r.degrees > limit) {
            ended = Ended::ElementsRotated;
        }
        rotation = found.and_then(|r| {
            let when = Some((state.step, state.time));
            rotations.told(r.degrees, r.place, 0.0, 0.0, when)
        });
        let moment = Moment::at_rest(&state, seen.system, (seen.force, &loads));
        let shown = begins
            || last
            || matches!(ended, Ended::DamageAtEdge | Ended::ElementsRotated)
            || state.step.is_multiple_of(spec.output_every as u64);
        let leave = ended != Ended::Finished || (last && recorder.keeps_state());
        let mut write = || -> Result<(), ObserveError> {
            if begins {
                recorder.begin(&moment);
            }
            let energies = recorder.energies(&moment);
            recorder.row(&moment, energies, place)?;
            if shown {
                solved(&moment, &mut |s| recorder.output(&moment, s))?;
            }
            if leave || (!begins && recorder.is_checkpoint_due(state.step)) {
                recorder.checkpoint(&moment, pace, edge, None, &Seen::default())?;
            }
            Ok(())
        };
        if let Err(error) = write() {
            failed = Some(error);
            return ControlFlow::Break(());
        }
        progress.advance(u64::from(!begins));
        progress.tell(&format!(
            "t = {:.3e}, {} iterations, {} bonds broken",
            state.time, seen.iterations, state.broken
        ));
        match ended {
            Ended::Finished => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        }
    };
    let info = quasi_static::run(
        moving.system.as_mut(),
        &drive,
        params,
        near.as_ref().map(|f| f as &dyn LinearMap),
        &times,
        &mut loaded,
        &mut observe,
    )?;
    if let Some(error) = failed {
        return Err(error.into());
    }
    progress.finish();
    let seconds = clock.elapsed().as_secs_f64();
    timings.add("load steps", seconds - (recorder.seconds - written));
    timings.add("output", recorder.seconds - written);
    let stored = moving.system.stored_energy(&state.u);
    let (_, applied) = loads::loads(model, &rest.conditions, state.time)?;
    let plane = plane_energy(model, rest)?;
    choices.push(Decision {
        choice: format!("{} products or passes", info.iterations),
        why: "of all load steps of this run".to_owned(),
    });
    let mut told = warnings(model, joining, &proof);
    told.extend(locking(model, &rest.local_laws));
    told.extend(rotation.as_ref().map(Rotation::warning));
    Ok(RunSummary {
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
        iterations: info.iterations,
        motion: Some(MotionSummary {
            ended,
            steps: state.step,
            of_steps: pace.steps,
            time: state.time,
            step,
            stable_step: None,
            kinetic_energy: 0.0,
            stored_energy: stored,
            external_work: state.work,
            missing_energy: recorder.energy_at_start + state.work - stored,
            energy_gain: None,
            cracks: cracks(moving.system.as_ref(), breaks, plane),
            inelastic_energy: inelastic_energy(moving.system.as_ref()),
            broken_bonds: state.broken,
            edge_reached: edge.map(|e| (e.time, place(e.site as usize).iter().copied().collect())),
            steps_per_second: (state.step - first) as f64 / seconds.max(f64::MIN_POSITIVE),
            switches: Vec::new(),
            nonlocal_share: [0.0; 3],
        }),
        files: recorder.files(),
        ..RunSummary::default()
    })
}

/// What is added to the stiffness, as a part of its diagonal, so that pieces that nothing holds have factors too: far above round-off, and too little to
/// cost an iteration.
const RAISED: f64 = 1e-10;

/// Factors of the stiffness before bonds break, which lead Newton's method; none where `[solver]` asks for an iteration, or `"auto"` finds factors dear.
fn factors<const D: usize>(
    model: &Model<D>,
    operator: &dyn Operator<D>,
    symmetry: Symmetry,
    rest: &RunSettings<D>,
    choices: &mut Vec<Decision>,
    progress: &dyn Progress,
) -> Result<Option<Factor>, RunError> {
    let params = equilibrium::params(&rest.solver);
    if !equilibrium::may_factorise(model, params.method, symmetry) {
        return Ok(None);
    }
    let (prescribed, _) = loads::supports(model, &rest.conditions, 0.0)?;
    let positions: Vec<[f64; 3]> = model.sites.iter().map(|s| padded(&s.position)).collect();
    let mut stiffness = model.assemble(operator, progress);
    stiffness.raise_diagonal(RAISED);
    let problem = StaticProblem {
        stiffness: &stiffness,
        symmetry,
        positions: &positions,
        load: &[],
        prescribed: &prescribed,
    };
    let Some((factor, info)) = statics::factors(&problem, &params, progress)? else {
        return Ok(None);
    };
    choices.push(Decision {
        choice: "factors of the stiffness before bonds break lead the iteration".to_owned(),
        why: format!(
            "{:.1} MB, {:.1e} operations once; solver.method = \"krylov\" does without",
            factor.bytes() as f64 * 1e-6,
            info.cost.flops
        ),
    });
    Ok(Some(factor))
}
