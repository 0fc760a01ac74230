//! Estimate of a run in time: its stable step, number of steps, memory and time, from a few steps taken.

use std::sync::Arc;
use std::time::Instant;

use super::output_cost::{TrialFolder, output_bytes, output_seconds};
use super::resource_estimate::{MotionPrediction, Prediction, holds, warnings};
use super::solver_estimate::Planned;
use crate::model::Model;
use crate::observe::checkpoint::{CheckpointFile, Fingerprint};
use crate::observe::summary::{Decision, peak_memory_bytes, resident_memory_bytes};
use crate::observe::warning::{Code, Warning};
use crate::progress::Progress;
use crate::run::RunError;
use crate::run::budget::Share;
use crate::run::equilibrium::{may_coarsen, may_factorise};
use crate::run::motion::dynamic_system::start;
use crate::run::motion::impact::impacted;
use crate::run::motion::initial_state::PreStep;
use crate::run::motion::load_stage;
use crate::run::motion::saved::StepChoice;
use crate::run::motion::setup::{ModelSetup, laid_out};
use crate::run::motion::time_step::held;
use crate::run::motion::writer::Moment;
use crate::run::motion::{RunOptions, STILL};
use crate::run::setup::sizes;
use crate::scene::spec::LoadStepSpec;
use crate::scene::{Explicit as Spec, QuasiStatic, Scene, Solve};
use crate::solve::FreeDofs;
use crate::solve::explicit::{Explicit, ExplicitParams};

/// Steps are tried for so long \[s\].
const TRIED_FOR: f64 = 0.2;

/// Steps before the clock starts.
const WARM: u64 = 3;

/// Predicts a run in time or under a load that grows.
///
/// # Errors
/// [`RunError`] as a run would.
pub(crate) fn predict<const D: usize>(
    scene: Scene<D>,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    match scene.solve.clone() {
        Solve::Explicit(solve) => explicit(scene, &solve, progress),
        Solve::QuasiStatic(solve) => load_steps(scene, &solve, progress),
        Solve::Static => Err(STILL),
    }
}

/// Predicts a run in time, from the first steps of it.
///
/// # Errors
/// [`RunError`] as a run would, the refusal of its time step included.
fn explicit<const D: usize>(
    mut scene: Scene<D>,
    spec: &Spec,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    let folder = TrialFolder::new(&scene.output.directory);
    scene.output.directory = folder.path().to_path_buf();
    let nothing = |_: &_, _: &mut Vec<Decision>| Ok(());
    laid_out(scene, None, progress, nothing, |laid_out, ()| {
        steps(laid_out, spec, progress)
    })
}

/// Sizes, memory and the choices so far, as they stand with what moves; `state` has its own bytes.
fn prediction<const D: usize>(
    laid_out: &ModelSetup<'_, D>,
    held: usize,
    state: Option<Share>,
) -> Prediction {
    let sizes = sizes(laid_out.model, laid_out.operator);
    let output = match laid_out.rest.output.vtu || state.is_none() {
        true => output_bytes(laid_out.model, &sizes, &laid_out.rest.output),
        false => 0,
    };
    let peak = peak_memory_bytes().unwrap_or(0);
    let mut memory = vec![
        Share::new("model", laid_out.bytes),
        Share::new("rows, bonds", laid_out.moving.bytes as u64),
    ];
    memory.extend(state);
    memory.push(Share::new("output", output));
    let mut choices = vec![laid_out.rest.coupling(laid_out.setup.traits)];
    // a coupling that was chosen is told already
    let told = choices[0].clone();
    choices.extend(
        laid_out
            .setup
            .choices
            .iter()
            .filter(|c| **c != told)
            .cloned(),
    );
    Prediction {
        scene: laid_out.setup.title.clone(),
        dimension: D,
        coupling: laid_out.setup.traits.name.to_owned(),
        sizes,
        symmetry: laid_out.moving.system.symmetry(),
        unknowns: sizes.dofs - held,
        peak_memory_bytes: (resident_memory_bytes().unwrap_or(0) + output).max(peak),
        memory,
        base_bytes: peak,
        total_seconds: laid_out.setup.timings.total(),
        timings: laid_out.setup.timings.clone(),
        choices,
        proof: laid_out.proof.clone(),
        ..Prediction::default()
    }
}

/// Seconds of a step, from a few that are taken.
///
/// # Errors
/// [`RunError`] of a step.
fn seconds_per_step(
    motion: &mut Explicit<'_>,
    steps: u64,
    is_linear: bool,
) -> Result<f64, RunError> {
    // the first touch memory, and wake threads
    let (mut taken, mut clock) = (0, Instant::now());
    while taken < steps && (taken < 2 * WARM || clock.elapsed().as_secs_f64() < TRIED_FOR) {
        motion.step()?;
        Moment::of(motion, is_linear);
        taken += 1;
        if taken == WARM {
            clock = Instant::now();
        }
    }
    let timed = if taken > WARM { taken - WARM } else { taken };
    Ok(clock.elapsed().as_secs_f64() / timed as f64)
}

/// Sizes, memory and time of the steps of a run, from some that are taken.
fn steps<const D: usize>(
    mut laid_out: ModelSetup<'_, D>,
    spec: &Spec,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    let (model, operator, rest) = (laid_out.model, laid_out.operator, laid_out.rest);
    let path = rest.output.directory.join("trial.checkpoint");
    let mut begin = PreStep {
        model,
        operator,
        rest,
        spec,
        moving: laid_out.moving,
        terms: Arc::clone(&laid_out.terms),
        contact: laid_out.contact.clone(),
        proved: laid_out.proved,
        setup: &mut laid_out.setup,
    }
    .at_start(
        RunOptions::default(),
        CheckpointFile::new(path, Fingerprint::default()),
        None,
        None,
    )?;
    laid_out.proof.parts.extend(begin.growth);
    let pace = begin.pace;
    let state_bytes = 12 * 8 * begin.state.u.len() as u64;
    let mut motion = Explicit::new(
        begin.moving.system.as_mut(),
        &begin.drive,
        ExplicitParams::with_step(pace.step),
        begin.state,
    )?;
    let is_linear = begin.moving.is_linear;
    begin.recorder.begin(&Moment::of(&motion, is_linear));
    laid_out.setup.lap("start");
    let seconds_per_step = seconds_per_step(&mut motion, pace.steps, is_linear)?;
    // of a row of the history most is the energies
    let clock = Instant::now();
    begin.recorder.energies(&Moment::of(&motion, is_linear));
    let per_row = clock.elapsed().as_secs_f64();
    drop(motion);
    laid_out.moving = begin.moving;
    let [per_file, _] = output_seconds(model, operator, rest, true)?;
    progress.finish();

    let files = (spec.duration / spec.output_interval).ceil();
    let rows = (spec.duration / spec.history_interval).ceil();
    let timings = &mut laid_out.setup.timings;
    timings.add("start", per_file);
    timings.add("steps", pace.steps as f64 * seconds_per_step);
    timings.add(
        "output",
        files * per_file + rows.min(pace.steps as f64) * per_row,
    );
    let mut prediction = Prediction {
        motion: Some(motion_of(model, &pace, seconds_per_step)),
        ..prediction(
            &laid_out,
            held(model, &rest.conditions)?.len(),
            Some(Share::new("state", state_bytes)),
        )
    };
    if let Some(stage) = &rest.before {
        let held = held(model, &stage.conditions)?;
        factors(&laid_out, &stage.solve, &held, &mut prediction, progress)?;
        prediction.choices.push(load_stage::told(stage));
    }
    prediction.warnings = warnings(model, laid_out.rest, laid_out.setup.traits, &prediction)?;
    let before = rest.before.as_ref().map(|stage| unknown_time(&stage.solve));
    prediction.warnings.extend(before);
    holds(&prediction)?;
    Ok(prediction)
}

/// Warns of load steps, whose time is not estimated.
fn unknown_time(spec: &QuasiStatic) -> Warning {
    let steps = match spec.accuracy {
        None => format!("{} load steps", spec.steps),
        Some(_) => "the load steps, and their number,".to_owned(),
    };
    let text =
        format!("the time of {steps} is not in the estimate: it depends on the bonds that break");
    Warning::new(Code::Cost, text)
}

/// The steps of a run.
fn motion_of<const D: usize>(
    model: &Model<D>,
    pace: &StepChoice,
    seconds_per_step: f64,
) -> MotionPrediction {
    MotionPrediction {
        step: pace.step,
        steps: pace.steps,
        stable_step: pace.stable,
        certified_step: pace.certified,
        certified_at: model.sites[pace.site as usize]
            .position
            .iter()
            .copied()
            .collect(),
        seconds_per_step,
    }
}

/// Predicts a run under a load that grows: sizes and memory, for what a load step takes shows only when bonds break.
///
/// # Errors
/// [`RunError`] as a run would.
pub(crate) fn load_steps<const D: usize>(
    scene: Scene<D>,
    spec: &QuasiStatic,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    let nothing = |_: &_, _: &mut Vec<Decision>| Ok(());
    laid_out(scene, None, progress, nothing, |mut laid_out, ()| {
        let held = held(laid_out.model, &laid_out.rest.conditions)?;
        let (model, rest) = (laid_out.model, laid_out.rest);
        let begin = start(model, rest);
        let (moving, _) = impacted(
            model,
            rest,
            laid_out.moving,
            &begin,
            1.0,
            &mut laid_out.setup.choices,
        )?;
        laid_out.moving = moving;
        progress.finish();
        let mut prediction = prediction(&laid_out, held.len(), None);
        factors(&laid_out, spec, &held, &mut prediction, progress)?;
        prediction.warnings = warnings(
            laid_out.model,
            laid_out.rest,
            laid_out.setup.traits,
            &prediction,
        )?;
        prediction.warnings.push(unknown_time(spec));
        if laid_out.rest.breaking.damages {
            // small runs may take minutes where cracks open
            prediction.no_error =
                Some("the time of runs with other spacings is not known: --pilots 60".to_owned());
        }
        holds(&prediction)?;
        Ok(prediction)
    })
}

/// Memory and operations of what leads the iteration, if there is anything.
fn factors<const D: usize>(
    laid_out: &ModelSetup<'_, D>,
    spec: &QuasiStatic,
    held: &[u32],
    prediction: &mut Prediction,
    progress: &dyn Progress,
) -> Result<(), RunError> {
    let symmetry = prediction.symmetry;
    let (model, method) = (laid_out.model, laid_out.rest.solver.method);
    let coarsens = may_coarsen(model, method, symmetry);
    if spec.method == LoadStepSpec::Relaxation
        || !(coarsens || may_factorise(model, method, symmetry))
    {
        return Ok(());
    }
    let mut prescribed = vec![None; prediction.sizes.dofs];
    held.iter()
        .for_each(|&dof| prescribed[dof as usize] = Some(0.0));
    let free = FreeDofs::from_prescribed(&prescribed, D);
    let stiffness = model.assemble(laid_out.operator, progress);
    let plan = Planned::of(model, &stiffness, &free, laid_out.rest, symmetry)?;
    if !(plan.is_factorised() || coarsens) {
        return Ok(());
    }
    prediction.factor_nonzeros = plan.cost.factor_nnz;
    prediction.operations = plan.cost.flops;
    prediction.method = Some(plan.method);
    prediction.peak_memory_bytes += plan.stiffness + plan.solver;
    for (name, bytes) in [("stiffness", plan.stiffness), ("solver", plan.solver)] {
        prediction.memory.push(Share::new(name, bytes));
    }
    Ok(())
}
