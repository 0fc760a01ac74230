//! `accuracy = 0.01`: the parameters that a scene leaves open are chosen so that its error is predicted to stay below that, at the least cost;
//! and the error of any scene, predicted.
//!
//! | file | what |
//! |---|---|
//! | `free_parameters.rs` | parameters that a scene leaves open, and the keys of a candidate |
//! | `sample_run.rs` | small runs of a scene, and their differences |
//! | `estimate.rs` | error and order from the differences of pilots; the constants, and where they come from |
//! | `coarsest_admissible.rs` | the coarsest candidate whose error is small enough, by looking at candidates themselves |
//! | `refinement_sequence.rs` | a family of candidates, with runs of it from coarse to fine |
//! | `selection.rs` | the cheapest candidate whose predicted error is small enough |
//! | `scene_refinements.rs` | the error of a complete scene, from coarser and finer versions of it |
//!
//! Errors are those of `bondline trade`: relative root mean square of the displacement along the scene's lines and probes, over time
//! for histories. Where nothing is cut and no bond can break the horizon is numerical, and errors are against elasticity; else it is a
//! length of the material, and errors are against the same horizon with many more points.

mod coarsest_admissible;
mod estimate;
mod free_parameters;
mod refinement_sequence;
mod sample_run;
mod scene_refinements;
mod selection;

use std::path::Path;
use std::time::Instant;

pub use free_parameters::Family;
pub use selection::{Candidate, Chosen};

pub use bondline::predict::{ErrorPrediction, ErrorReference};

pub use estimate::{SPREAD, difference};
pub use sample_run::Bench;
use scene_refinements::predicted_error;

use bondline::predict::Prediction;
use bondline::predict::counted::{ANSWERS, TENTH};
use bondline::progress::Progress;
use bondline::run::AnyScene;
use bondline::run::RunError;
use bondline::scene::SceneError;
use bondline::scene::Source;
use bondline::scene::read;
use bondline::system::Ranks;

/// Failure of the check of a scene.
#[derive(Debug, thiserror::Error)]
pub enum CheckError {
    /// The scene is wrong.
    #[error("{}", .0.message())]
    Scene(Box<SceneError>),
    /// It cannot be laid out.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl From<SceneError> for CheckError {
    fn from(error: SceneError) -> Self {
        Self::Scene(Box::new(error))
    }
}

/// Pilots for the error may take this share of the predicted time of a run, or [`LEAST`].
const PILOTS: f64 = 0.15;

/// Pilots take no longer than this \[s\], however long the run is: an answer after a minute is none.
const PATIENCE: f64 = 30.0;

/// Seconds that pilots may take whatever the run does.
pub const LEAST: f64 = 1.0;

/// Predicts the cost of a run of a scene file, and its error, without running it; runs of it with other spacings may take so many
/// seconds for the latter, 0.15 of the predicted time or one second if that is left open.
///
/// # Errors
/// [`CheckError`], each with place and remedy.
pub fn check(
    path: &Path,
    overrides: &[String],
    pilots: Option<f64>,
    progress: &dyn Progress,
) -> Result<Prediction, CheckError> {
    let (source, directory, name) = read(path, overrides)?;
    check_source(&source, directory, &name, pilots, progress)
}

/// Adds to a prediction what each of some processes will have of a scene file, as [`bondline::predict::processes`].
///
/// # Errors
/// [`CheckError`], each with place and remedy.
pub fn add_processes(
    alone: &mut Prediction,
    path: &Path,
    overrides: &[String],
    (count, partitioner): (usize, Option<&dyn Ranks>),
    progress: &dyn Progress,
) -> Result<(), CheckError> {
    let (source, directory, name) = read(path, overrides)?;
    let chosen = completed(&source, directory)?;
    let complete = chosen.as_ref().map_or(&source, |(complete, _)| complete);
    let scene = || AnyScene::complete(complete, directory, &name);
    let shares = bondline::predict::processes(scene()?, count, partitioner, progress)?;
    shares.distribution().clone_into(&mut alone.distribution);
    alone.processes = match alone.counted {
        None => shares.with_memory(alone),
        // what is counted from volumes is too little to take shares from
        Some(_) => shares.with_memory(&bondline::predict::laid_out(scene()?, progress)?),
    };
    Ok(())
}

/// As [`check`], of a scene whose relative paths start in `directory` and whose files are named `name` by default.
///
/// # Errors
/// [`CheckError`], each with place and remedy.
pub fn check_source(
    source: &Source,
    directory: &Path,
    name: &str,
    pilots: Option<f64>,
    progress: &dyn Progress,
) -> Result<Prediction, CheckError> {
    let chosen = completed(source, directory)?;
    let complete = chosen.as_ref().map_or(source, |(complete, _)| complete);
    let mut scene = AnyScene::complete(complete, directory, name)?;
    if let Some((_, chosen)) = &chosen {
        scene.chose(chosen.choices.clone());
    }
    let begun = Instant::now();
    let mut prediction = bondline::predict::predict(scene, progress)?;
    if let (Some(_), None) = (&prediction.counted, pilots) {
        prediction.no_error = Some("the model was counted, not laid out".to_owned());
        return Ok(prediction);
    }
    if prediction.no_error.is_some() && pilots.is_none() {
        return Ok(prediction);
    }
    prediction.no_error = None;
    progress.stage("coarser and finer runs", None);
    let known = chosen.as_ref().and_then(|(_, c)| c.prediction());
    let found = match (known, pilots) {
        (Some(known), _) => Ok(known),
        (None, None) => {
            let run = solving(&prediction);
            let left = (TENTH * run).max(ANSWERS) - begun.elapsed().as_secs_f64();
            let most = (PILOTS * run).min(left).clamp(LEAST, PATIENCE);
            predicted_error(complete, directory, run, most)?
        }
        (None, Some(most)) => predicted_error(complete, directory, solving(&prediction), most)?,
    };
    match found {
        Ok(error) => prediction.error = Some(error),
        Err(why) => prediction.no_error = Some(why),
    }
    progress.finish();
    Ok(prediction)
}

/// The error of a complete scene, from versions of it that take `PILOTS` of its predicted time, or `least` seconds; else why there is none.
///
/// # Errors
/// [`SceneError`] of the scene itself.
pub fn error_of(
    complete: &Source,
    directory: &Path,
    prediction: &Prediction,
    least: f64,
) -> Result<Result<ErrorPrediction, String>, SceneError> {
    let run = solving(prediction);
    predicted_error(complete, directory, run, (PILOTS * run).max(least))
}

/// Seconds of a run but for its output.
fn solving(prediction: &Prediction) -> f64 {
    prediction.total_seconds - prediction.timings.seconds("output")
}

/// The scene with all that its `accuracy` leaves open filled in, and the choices; `None` where it has no `accuracy`.
///
/// # Errors
/// [`SceneError`] where the choice cannot be made: nothing runs, or a length of the material is missing.
pub fn completed(
    source: &Source,
    directory: &Path,
) -> Result<Option<(Source, Chosen)>, SceneError> {
    let Some(asked) = free_parameters::AccuracyRequest::of(source)? else {
        return Ok(None);
    };
    let chosen = selection::choose(&asked, source, directory)?;
    let mut complete = source.clone();
    for o in &chosen.overrides {
        complete.push_override(o)?;
    }
    Ok(Some((complete, chosen)))
}
