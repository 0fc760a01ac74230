//! What a run in time will need: its stable step, number of steps, memory and time, from a few steps taken.

use std::time::Instant;

use super::drive::SceneDrive;
use super::explicit::sizes;
use super::laid_out::{LaidOut, laid_out};
use super::pace::{held, paced};
use super::system::start;
use crate::observe::summary::{Choice, peak_memory_bytes, resident_memory_bytes};
use crate::progress::Progress;
use crate::scene::predict::{
    MotionPrediction, OUTPUT_BYTES, Prediction, SECONDS_PER_CELL, Share, warnings,
};
use crate::scene::run::RunError;
use crate::scene::solve::{Explicit as Spec, QuasiStatic};
use crate::scene::validate::Scene;
use crate::solve::explicit::{Explicit, ExplicitParams};

/// Steps are taken for this long to tell what one costs \[s\].
const TRIED_FOR: f64 = 0.5;

/// Predicts a run in time.
///
/// # Errors
/// [`RunError`] as a run would, the refusal of its time step included.
pub(crate) fn predict<const D: usize>(
    scene: Scene<D>,
    spec: &Spec,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    let nothing = |_: &_, _: &mut Vec<Choice>| Ok(());
    laid_out(scene, progress, nothing, |laid_out, ()| {
        steps(laid_out, spec, progress)
    })
}

/// Sizes, memory and the choices so far, as they stand with what moves.
fn prediction<const D: usize>(
    laid_out: &LaidOut<'_, D>,
    held: usize,
    files: Files,
    state: Option<u64>,
) -> Prediction {
    let sizes = sizes(laid_out.model, laid_out.operator);
    let output = match files {
        Files::Some => OUTPUT_BYTES * (sizes.cells + sizes.points) as u64,
        Files::None => 0,
    };
    let share = |name, bytes| Share { name, bytes };
    let mut memory = vec![
        share("model", laid_out.bytes),
        share("rows, bonds", laid_out.moving.bytes as u64),
    ];
    memory.extend(state.map(|bytes| share("state", bytes)));
    memory.push(share("output", output));
    let mut choices = vec![laid_out.rest.coupling(laid_out.joining)];
    // a coupling that was chosen is told already
    let told = choices[0].clone();
    choices.extend(laid_out.choices.iter().filter(|c| **c != told).cloned());
    Prediction {
        scene: laid_out.title.clone(),
        dimension: D,
        coupling: laid_out.joining.name.to_owned(),
        sizes,
        method: None,
        symmetry: laid_out.moving.system.symmetry(),
        unknowns: sizes.dofs - held,
        factor_nonzeros: 0,
        operations: 0.0,
        peak_memory_bytes: (resident_memory_bytes().unwrap_or(0) + output)
            .max(peak_memory_bytes().unwrap_or(0)),
        memory,
        total_seconds: laid_out.timings.total(),
        timings: laid_out.timings.clone(),
        choices,
        warnings: Vec::new(),
        motion: None,
    }
}

/// Whether a run writes VTU files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Files {
    Some,
    None,
}

fn steps<const D: usize>(
    mut laid_out: LaidOut<'_, D>,
    spec: &Spec,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    let (model, rest) = (laid_out.model, laid_out.rest);
    let held = held(model, &rest.conditions)?;
    let (moving, pace) = paced(
        spec,
        laid_out.growing,
        laid_out.moving,
        &held,
        None,
        &mut laid_out.choices,
    )?;
    laid_out.moving = moving;
    laid_out.watch.lap(&mut laid_out.timings, "stable step");

    let begin = start(model, &rest.initial);
    let drive = SceneDrive::new(model, &rest.conditions, &begin.u, pace.step, pace.steps)?;
    let state_bytes = 12 * 8 * begin.u.len() as u64;
    let mut motion = Explicit::new(
        laid_out.moving.system.as_mut(),
        &drive,
        ExplicitParams::with_step(pace.step),
        begin,
    )?;
    let clock = Instant::now();
    let mut taken = 0u64;
    while taken < pace.steps && (taken < 2 || clock.elapsed().as_secs_f64() < TRIED_FOR) {
        motion.step()?;
        taken += 1;
    }
    let seconds_per_step = clock.elapsed().as_secs_f64() / taken as f64;
    drop(motion);
    progress.finish();

    let (files, written) = if rest.output.vtu {
        let count = (spec.duration / spec.output_interval).ceil() + 1.0;
        (Files::Some, count)
    } else {
        (Files::None, 0.0)
    };
    let rows = (spec.duration / spec.history_interval)
        .ceil()
        .min(pace.steps as f64)
        + 1.0;
    let sizes = sizes(model, laid_out.operator);
    let shown = (sizes.cells + sizes.points) as f64;
    let timings = &mut laid_out.timings;
    timings.add("steps", pace.steps as f64 * seconds_per_step);
    timings.add(
        "output",
        written * shown * SECONDS_PER_CELL + rows * seconds_per_step,
    );
    let mut prediction = Prediction {
        motion: Some(MotionPrediction {
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
        }),
        ..prediction(&laid_out, held.len(), files, Some(state_bytes))
    };
    prediction.warnings = warnings(model, laid_out.joining, &prediction);
    Ok(prediction)
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
    let nothing = |_: &_, _: &mut Vec<Choice>| Ok(());
    laid_out(scene, progress, nothing, |laid_out, ()| {
        let held = held(laid_out.model, &laid_out.rest.conditions)?;
        progress.finish();
        let mut prediction = prediction(&laid_out, held.len(), Files::Some, None);
        prediction.warnings = warnings(laid_out.model, laid_out.joining, &prediction);
        prediction.warnings.push(format!(
            "the time of {} load steps is not in the estimate: it depends on the bonds that break",
            spec.steps
        ));
        Ok(prediction)
    })
}
