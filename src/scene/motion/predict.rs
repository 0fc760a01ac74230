//! What a run in time will need: its stable step, number of steps, memory and time, from a few steps taken.

use std::time::Instant;

use super::drive::SceneDrive;
use super::explicit::{choose_step, held, sizes};
use super::system::{dynamic, start};
use crate::coupling::Model;
use crate::observe::summary::{
    Choice, Stopwatch, Timings, peak_memory_bytes, resident_memory_bytes,
};
use crate::progress::Progress;
use crate::scene::predict::{
    MotionPrediction, OUTPUT_BYTES, Prediction, SECONDS_PER_CELL, Share, warnings,
};
use crate::scene::run::{self, RunError};
use crate::scene::solve::{Explicit as Spec, QuasiStatic};
use crate::scene::validate::Scene;
use crate::solve::explicit::{Explicit, ExplicitParams};
use crate::solve::stable_step::stable_step;

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
    let mut timings = Timings::default();
    let mut watch = Stopwatch::start();
    let title = scene.title.clone();
    let joining = scene.coupling.joining();
    let (problem, rest) = run::problem(scene);
    let (model, coupling) = Model::new(problem, progress)?;
    watch.lap(&mut timings, "sites and bonds");
    let operator = coupling.operator(&model)?;
    let mut choices = vec![Choice {
        choice: format!("coupling {}", joining.name),
        why: joining.about.to_owned(),
    }];
    let laid_out = resident_memory_bytes().unwrap_or(0);
    let mut moving = dynamic(
        &model,
        coupling.as_ref(),
        operator.as_ref(),
        &rest,
        &mut choices,
        progress,
    )?;
    let symmetry = moving.system.symmetry();
    watch.lap(&mut timings, "rows and bonds");
    let held = held(&model, &rest.conditions)?;
    let limit = stable_step(moving.system.as_ref(), &held)?;
    let pace = choose_step(spec, &limit, moving.system.as_ref(), &held, &mut choices)?;
    watch.lap(&mut timings, "stable step");

    let begin = start(&model, &rest.initial);
    let drive = SceneDrive::new(&model, &rest.conditions, &begin.u, pace.step, pace.steps)?;
    let state_bytes = 12 * 8 * begin.u.len() as u64;
    let mut motion = Explicit::new(
        moving.system.as_mut(),
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
    progress.finish();

    let sizes = sizes(&model, operator.as_ref());
    let shown = sizes.cells + sizes.points;
    let files = if rest.output.vtu {
        (spec.duration / spec.output_interval).ceil() + 1.0
    } else {
        0.0
    };
    let rows = (spec.duration / spec.history_interval)
        .ceil()
        .min(pace.steps as f64)
        + 1.0;
    timings.add("steps", pace.steps as f64 * seconds_per_step);
    timings.add(
        "output",
        files * shown as f64 * SECONDS_PER_CELL + rows * seconds_per_step,
    );
    let output = if rest.output.vtu {
        OUTPUT_BYTES * shown as u64
    } else {
        0
    };
    let memory = vec![
        Share {
            name: "model",
            bytes: laid_out,
        },
        Share {
            name: "rows, bonds",
            bytes: moving.bytes as u64,
        },
        Share {
            name: "state",
            bytes: state_bytes,
        },
        Share {
            name: "output",
            bytes: output,
        },
    ];
    let held_now = resident_memory_bytes().unwrap_or(0);
    let mut prediction = Prediction {
        scene: title,
        dimension: D,
        coupling: joining.name.to_owned(),
        sizes,
        method: None,
        symmetry,
        unknowns: sizes.dofs - held.len(),
        factor_nonzeros: 0,
        operations: 0.0,
        peak_memory_bytes: (held_now + output).max(peak_memory_bytes().unwrap_or(0)),
        memory,
        total_seconds: timings.total(),
        timings,
        choices,
        warnings: Vec::new(),
        motion: Some(MotionPrediction {
            step: pace.step,
            steps: pace.steps,
            stable_step: limit.stable,
            certified_step: limit.certified,
            certified_at: model.sites[limit.certified_site]
                .position
                .iter()
                .copied()
                .collect(),
            seconds_per_step,
        }),
    };
    prediction.warnings = warnings(&model, joining, &prediction);
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
    let mut timings = Timings::default();
    let mut watch = Stopwatch::start();
    let title = scene.title.clone();
    let joining = scene.coupling.joining();
    let (problem, rest) = run::problem(scene);
    let (model, coupling) = Model::new(problem, progress)?;
    watch.lap(&mut timings, "sites and bonds");
    let operator = coupling.operator(&model)?;
    let mut choices = vec![Choice {
        choice: format!("coupling {}", joining.name),
        why: joining.about.to_owned(),
    }];
    let laid_out = resident_memory_bytes().unwrap_or(0);
    let moving = dynamic(
        &model,
        coupling.as_ref(),
        operator.as_ref(),
        &rest,
        &mut choices,
        progress,
    )?;
    let held = held(&model, &rest.conditions)?;
    watch.lap(&mut timings, "rows and bonds");
    progress.finish();
    let sizes = sizes(&model, operator.as_ref());
    let output = OUTPUT_BYTES * (sizes.cells + sizes.points) as u64;
    let mut prediction = Prediction {
        scene: title,
        dimension: D,
        coupling: joining.name.to_owned(),
        sizes,
        method: None,
        symmetry: moving.system.symmetry(),
        unknowns: sizes.dofs - held.len(),
        factor_nonzeros: 0,
        operations: 0.0,
        peak_memory_bytes: (resident_memory_bytes().unwrap_or(0) + output)
            .max(peak_memory_bytes().unwrap_or(0)),
        memory: vec![
            Share {
                name: "model",
                bytes: laid_out,
            },
            Share {
                name: "rows, bonds",
                bytes: moving.bytes as u64,
            },
            Share {
                name: "output",
                bytes: output,
            },
        ],
        total_seconds: timings.total(),
        timings,
        choices,
        warnings: Vec::new(),
        motion: None,
    };
    prediction.warnings = warnings(&model, joining, &prediction);
    prediction.warnings.push(format!(
        "the time of {} load steps is not in the estimate: it depends on the bonds that break",
        spec.steps
    ));
    Ok(prediction)
}
