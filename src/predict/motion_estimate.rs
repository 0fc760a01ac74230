//! Estimate of a run in time: its stable step, number of steps, memory and time, from a few steps taken.

use std::sync::Arc;
use std::time::Instant;

use super::output_cost::{TrialFolder, file_seconds, made_up};
use super::resource_estimate::{MotionPrediction, Prediction, holds, warnings};
use super::solver_estimate::{Planned, output_bytes};
use crate::coupling::impact::RESOLVED;
use crate::observe::checkpoint::{CheckpointFile, Fingerprint};
use crate::observe::series::Series;
use crate::observe::summary::{Decision, peak_memory_bytes, resident_memory_bytes};
use crate::progress::Progress;
use crate::run::budget::Share;
use crate::run::equilibrium::{may_coarsen, may_factorise};
use crate::run::loads::BodyForces;
use crate::run::motion::STILL;
use crate::run::motion::breaks::{Breaks, breaks};
use crate::run::motion::driven_impactors;
use crate::run::motion::dynamic_system::start;
use crate::run::motion::explicit::sizes;
use crate::run::motion::impact::impacted;
use crate::run::motion::impact_record::ImpactRecord;
use crate::run::motion::saved::StepChoice;
use crate::run::motion::setup::{ModelSetup, laid_out};
use crate::run::motion::time_dependent_loads::SceneDrive;
use crate::run::motion::time_step::{held, paced};
use crate::run::motion::writer::{Moment, Recorder};
use crate::run::proof::growth::{GrowthQuestion, free_start};
use crate::run::setup::RunSettings;
use crate::run::solution::{self, Moved, Solved};
use crate::run::{RunError, RunOptions};
use crate::scene::spec::LoadStepSpec;
use crate::scene::{Explicit as Spec, QuasiStatic, Solve};
use crate::scene::{Output, Scene};
use crate::solve::FreeDofs;
use crate::solve::explicit::{Explicit, ExplicitParams};
use crate::solve::statics::MethodUsed;
use crate::{
    coupling::{Impact, Operator},
    model::{Model, Sampler},
};

/// Steps are tried for a tenth of the run to measure the duration of one, for this long at most \[s\].
const TRIED_FOR: f64 = 0.5;

/// Shortest time for which steps are tried \[s\].
const LEAST_TRIED: f64 = 0.01;

/// Steps before the clock starts.
const WARM: u64 = 3;

/// Rows of the history that are timed.
const ROWS: u32 = 5;

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

/// Predicts a run in time.
///
/// # Errors
/// [`RunError`] as a run would, the refusal of its time step included.
fn explicit<const D: usize>(
    scene: Scene<D>,
    spec: &Spec,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    let nothing = |_: &_, _: &mut Vec<Decision>| Ok(());
    laid_out(scene, None, progress, nothing, |laid_out, ()| {
        steps(laid_out, spec, progress)
    })
}

/// Sizes, memory and the choices so far, as they stand with what moves.
fn prediction<const D: usize>(
    laid_out: &ModelSetup<'_, D>,
    held: usize,
    files: Files,
    state: Option<u64>,
) -> Prediction {
    let sizes = sizes(laid_out.model, laid_out.operator);
    let output = match files {
        Files::Some => output_bytes(&sizes, &laid_out.rest.output),
        Files::None => 0,
    };
    let peak = peak_memory_bytes().unwrap_or(0);
    let share = |name, bytes| Share { name, bytes };
    let mut memory = vec![
        share("model", laid_out.bytes),
        share("rows, bonds", laid_out.moving.bytes as u64),
    ];
    memory.extend(state.map(|bytes| share("state", bytes)));
    memory.push(share("output", output));
    let mut choices = vec![laid_out.rest.coupling(laid_out.traits)];
    // a coupling that was chosen is told already
    let told = choices[0].clone();
    choices.extend(laid_out.choices.iter().filter(|c| **c != told).cloned());
    Prediction {
        scene: laid_out.title.clone(),
        counted: None,
        dimension: D,
        coupling: laid_out.traits.name.to_owned(),
        sizes,
        method: None,
        symmetry: laid_out.moving.system.symmetry(),
        unknowns: sizes.dofs - held,
        factor_nonzeros: 0,
        operations: 0.0,
        peak_memory_bytes: (resident_memory_bytes().unwrap_or(0) + output).max(peak),
        memory,
        base_bytes: peak,
        total_seconds: laid_out.timings.total(),
        timings: laid_out.timings.clone(),
        choices,
        proof: laid_out.proof.clone(),
        warnings: Vec::new(),
        error: None,
        no_error: None,
        motion: None,
        processes: Vec::new(),
        distribution: String::new(),
    }
}

/// Presence of VTU files in the output of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Files {
    Some,
    None,
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
    let mut taken = 0u64;
    let mut clock = Instant::now();
    let mut tried = TRIED_FOR;
    while taken < steps && (taken < 2 * WARM || clock.elapsed().as_secs_f64() < tried) {
        motion.step()?;
        Moment::of(motion, is_linear);
        taken += 1;
        if taken == WARM {
            let run = clock.elapsed().as_secs_f64() / WARM as f64 * steps as f64;
            tried = (0.1 * run).clamp(LEAST_TRIED, TRIED_FOR);
            clock = Instant::now();
        }
    }
    let timed = if taken > WARM { taken - WARM } else { taken };
    Ok(clock.elapsed().as_secs_f64() / timed as f64)
}

/// Seconds that output takes.
struct OutputCost {
    /// Seconds of opening the history and its first row.
    opened: f64,
    per_row: f64,
    per_file: f64,
}

impl OutputCost {
    /// Writes rows and a sample of a file as the run does, elsewhere; `count` files are wanted, none without VTU.
    ///
    /// # Errors
    /// [`RunError`] if they cannot be written.
    #[expect(clippy::too_many_arguments, reason = "each is another part of the run")]
    fn of<const D: usize>(
        model: &Model<D>,
        operator: &Operator<'_, D>,
        rest: &RunSettings<D>,
        impact: Option<Arc<Impact<D>>>,
        breaks: Breaks,
        is_linear: bool,
        shown: &Moment<'_>,
        count: Option<f64>,
    ) -> Result<Self, RunError> {
        let folder = TrialFolder::new(&rest.output.directory);
        let output = Output {
            directory: folder.path().to_path_buf(),
            ..rest.output.clone()
        };
        let begun = Instant::now();
        let mut recorder = Recorder::new(
            &output,
            &rest.conditions,
            &Sampler::new(model),
            impact.map(|impact| ImpactRecord::new(impact, &rest.impactors, None)),
            breaks,
            is_linear,
            CheckpointFile::new(
                folder.path().join("trial.checkpoint"),
                Fingerprint::default(),
            ),
            RunOptions::default(),
            None,
        )?;
        recorder.begin(shown);
        let place = |site: usize| model.sites[site].position;
        let energies = recorder.energies(shown);
        let probed = recorder.unprobed();
        recorder.row(shown, energies, &probed, place)?;
        let opened = begun.elapsed().as_secs_f64();
        let begun = Instant::now();
        for _ in 0..ROWS {
            let energies = recorder.energies(shown);
            recorder.row(shown, energies, &probed, place)?;
        }
        let per_row = begun.elapsed().as_secs_f64() / f64::from(ROWS);
        let per_file = if let Some(count) = count {
            let u = made_up(shown.state.u.len());
            let solved = Solved {
                model,
                operator,
                displacement: &u,
                residual: &[],
                zone_of_site: &solution::zone_of_site(model),
                system: None,
                moved: Moved {
                    velocity: Some(&u),
                    ..Moved::default()
                },
                sections: &[],
                stresses: (&rest.stresses, 0.0),
            };
            let mut series = Series::new(folder.path(), "trial");
            file_seconds(&solved, &rest.output, count, |s| {
                series.push(0.0, s).map(drop)
            })?
        } else {
            0.0
        };
        Ok(Self {
            opened,
            per_row,
            per_file,
        })
    }
}

/// Files that a run writes; none without VTU.
fn files_of<const D: usize>(spec: &Spec, rest: &RunSettings<D>) -> Option<f64> {
    let count = (spec.duration / spec.output_interval).ceil() + 1.0;
    rest.output.vtu.then_some(count)
}

/// Sizes, memory and time of the steps of a run, from some that are taken.
fn steps<const D: usize>(
    mut laid_out: ModelSetup<'_, D>,
    spec: &Spec,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    let (model, rest) = (laid_out.model, laid_out.rest);
    let held = held(model, &rest.conditions)?;
    let begin = start(model, rest);
    let choices = &mut laid_out.choices;
    let (moving, impact) = impacted(model, rest, laid_out.moving, &begin, RESOLVED, choices)?;
    let asked = GrowthQuestion {
        remedy: laid_out.remedy,
        proved: laid_out.proved,
        policy: spec.growing_modes,
        place: &|site| model.sites[site].position.iter().copied().collect(),
        ranks: None,
        free_from: free_start((model, rest), moving.is_linear, &begin)?,
    };
    let mut prescribed = held.clone();
    prescribed.extend(driven_impactors::prescribed(
        &rest.impactors,
        model.sites.len(),
    ));
    let (moving, pace, growth) = paced(spec, &asked, moving, &prescribed, None, choices)?;
    laid_out.proof.parts.extend(growth);
    laid_out.moving = moving;
    laid_out.watch.lap(&mut laid_out.timings, "stable step");

    let is_linear = laid_out.moving.is_linear;
    let breaks = breaks(laid_out.moving.system.as_ref(), rest);
    let steps = (pace.step, pace.steps);
    let drive = SceneDrive::new(model, &rest.conditions, &begin.u, steps, BodyForces::Lumped)?
        .with_impactors(&rest.impactors, pace.steps);
    let state_bytes = 12 * 8 * begin.u.len() as u64;
    let mut motion = Explicit::new(
        laid_out.moving.system.as_mut(),
        &drive,
        ExplicitParams::with_step(pace.step),
        begin,
    )?;
    let seconds_per_step = seconds_per_step(&mut motion, pace.steps, is_linear)?;

    let shown = Moment::of(&motion, is_linear);
    let operator = laid_out.operator;
    let cost = OutputCost::of(
        model,
        operator,
        rest,
        impact,
        breaks,
        is_linear,
        &shown,
        files_of(spec, rest),
    )?;
    drop(motion);
    progress.finish();

    let (files, written) = match files_of(spec, rest) {
        Some(count) => (Files::Some, count),
        None => (Files::None, 0.0),
    };
    let timings = &mut laid_out.timings;
    timings.add("start", cost.opened + cost.per_file);
    timings.add("steps", pace.steps as f64 * seconds_per_step);
    let rows = rows_of(spec, &pace);
    timings.add(
        "output",
        (written - 1.0).max(0.0) * cost.per_file + rows * cost.per_row,
    );
    let mut prediction = Prediction {
        motion: Some(motion_of(model, &pace, seconds_per_step)),
        ..prediction(&laid_out, held.len(), files, Some(state_bytes))
    };
    prediction.warnings = warnings(model, laid_out.rest, laid_out.traits, &prediction)?;
    holds(&prediction)?;
    Ok(prediction)
}

/// Rows of the history that a run writes.
fn rows_of(spec: &Spec, pace: &StepChoice) -> f64 {
    let rows = (spec.duration / spec.history_interval).ceil();
    rows.min(pace.steps as f64) + 1.0
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
            &mut laid_out.choices,
        )?;
        laid_out.moving = moving;
        progress.finish();
        let mut prediction = prediction(&laid_out, held.len(), Files::Some, None);
        factors(&laid_out, spec, &held, &mut prediction, progress)?;
        prediction.warnings =
            warnings(laid_out.model, laid_out.rest, laid_out.traits, &prediction)?;
        prediction.warnings.push(format!(
            "the time of {} is not in the estimate: it depends on the bonds that break",
            match spec.accuracy {
                None => format!("{} load steps", spec.steps),
                Some(_) => "the load steps, and their number,".to_owned(),
            }
        ));
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
    let pattern = laid_out.model.pattern(laid_out.operator, &[], progress);
    let plan = Planned::of(laid_out.model, &pattern, &free, laid_out.rest, symmetry)?;
    if matches!(plan.method, MethodUsed::Cholesky | MethodUsed::Lu) {
        prediction.factor_nonzeros = plan.cost.factor_nnz;
        prediction.operations = plan.cost.flops;
    } else if !coarsens {
        return Ok(());
    }
    prediction.method = Some(plan.method);
    for (name, bytes) in [("stiffness", plan.stiffness), ("solver", plan.solver)] {
        prediction.memory.push(Share { name, bytes });
        prediction.peak_memory_bytes += bytes;
    }
    Ok(())
}
