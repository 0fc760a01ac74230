//! `accuracy = 0.01`: what a scene leaves open is chosen so that its error is predicted to stay below that, at the least cost;
//! and the error of any scene, predicted.
//!
//! | file | what |
//! |---|---|
//! | `open.rs` | what a scene leaves open, and the keys of a candidate |
//! | `pilot.rs` | small runs of a scene, and how far they are from each other |
//! | `estimate.rs` | error and order from the differences of pilots; the constants, and where they come from |
//! | `coarsest.rs` | the coarsest candidate whose error is small enough, by looking at candidates themselves |
//! | `ladder.rs` | a family of candidates, with runs of it from coarse to fine |
//! | `choose.rs` | the cheapest candidate whose predicted error is small enough |
//!
//! Errors are those of `bondline trade`: relative root mean square of the displacement along the scene's lines and probes, over time
//! for histories. Where nothing is cut and no bond can break the horizon is numerical, and errors are against elasticity; else it is a
//! length of the material, and errors are against the same horizon with many more points.

mod choose;
mod coarsest;
mod estimate;
mod ladder;
mod open;
mod pilot;

use std::path::Path;

use serde::Serialize;

pub use choose::{Candidate, Chosen};
pub use open::Family;

pub(crate) use estimate::{SPREAD, difference};
pub(crate) use pilot::Bench;

use super::error::SceneError;
use super::predict::Prediction;
use super::run::RunError;
use super::source::Source;
use super::spec::SceneSpec;
use super::validate::{AnyScene, read};
use crate::progress::Progress;
use crate::trade::Base;

/// Why there is nothing to tell of a scene.
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

/// Seconds that pilots may take whatever the run does.
const LEAST: f64 = 1.0;

/// What a run of a scene file will need, and how large its error will be, without running it.
///
/// # Errors
/// [`CheckError`], each with place and remedy.
pub fn check(
    path: &Path,
    overrides: &[String],
    progress: &dyn Progress,
) -> Result<Prediction, CheckError> {
    let (source, directory, name) = read(path, overrides)?;
    let chosen = completed(&source, directory)?;
    let complete = chosen.as_ref().map_or(&source, |(complete, _)| complete);
    let mut scene = AnyScene::complete(complete, directory, &name)?;
    if let Some((_, chosen)) = &chosen {
        scene.chose(chosen.choices.clone());
    }
    let mut prediction = scene.predict(progress)?;
    let run = prediction.total_seconds - prediction.timings.seconds("output");
    let most = (PILOTS * run).max(LEAST);
    progress.stage("coarser runs", None);
    prediction.error = match chosen.as_ref().and_then(|(_, c)| c.prediction()) {
        Some(known) => Some(known),
        None => predicted_error(complete, directory, run, most)?,
    };
    progress.finish();
    Ok(prediction)
}

/// An error, predicted from coarser runs of the scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrorPrediction {
    /// What is compared.
    pub quantities: Vec<String>,
    /// The relative error.
    pub error: f64,
    /// The measured error was within this factor in so many scenes as `share` says.
    pub spread: f64,
    /// Of how many scenes that is true, see `docs/choosing.md`.
    pub share: &'static str,
    /// The order in the spacing that the pilots show.
    pub order: f64,
    /// Runs that it comes from.
    pub pilots: usize,
    /// Seconds that they took.
    pub seconds: f64,
}

/// The scene with all that its `accuracy` leaves open filled in, and what was chosen; `None` where it has no `accuracy`.
///
/// # Errors
/// [`SceneError`] where the choice cannot be made: nothing runs, or a length of the material is missing.
pub fn completed(
    source: &Source,
    directory: &Path,
) -> Result<Option<(Source, Chosen)>, SceneError> {
    let Some(asked) = open::Asked::of(source)? else {
        return Ok(None);
    };
    let chosen = choose::choose(&asked, source, directory)?;
    let mut complete = source.clone();
    for o in &chosen.overrides {
        complete.push_override(o)?;
    }
    Ok(Some((complete, chosen)))
}

/// The error of a complete scene from runs at twice the spacing and more; `None` where no coarser scene runs, or where its pilots
/// would take more than `seconds`.
///
/// # Errors
/// [`SceneError`] of the scene itself.
pub fn predicted_error(
    source: &Source,
    directory: &Path,
    run_seconds: f64,
    seconds: f64,
) -> Result<Option<ErrorPrediction>, SceneError> {
    let spec = SceneSpec::parse(source)?;
    let base = Base::of(&spec);
    let dimension = spec.dimension() as i32;
    let mut bench = pilot::Bench::new(source, directory, &spec);
    // a pilot with twice the spacing costs this share, steps included
    let share = 0.5f64.powi(dimension + i32::from(base.moves));
    let mut levels = Vec::new();
    let mut factors = base.coarser();
    factors.retain(|f| run_seconds * share.powf(f.log2()) <= seconds);
    if factors.len() < 2 {
        return Ok(None);
    }
    factors.sort_by(|a, b| b.total_cmp(a));
    for f in factors {
        match bench.run(&base.overrides(&base.scaled(f))) {
            Some(pilot) => levels.push((1.0 / base.coarsened(f), pilot)),
            None => levels.clear(),
        }
    }
    let Some(fit) = estimate::fit(&levels, &bench.quantities) else {
        return Ok(None);
    };
    Ok(Some(ErrorPrediction {
        quantities: bench.quantities.iter().map(|q| q.name()).collect(),
        error: fit.error(1.0),
        spread: estimate::SPREAD,
        share: estimate::CHECKS,
        order: fit.order,
        pilots: levels.len(),
        seconds: bench.seconds,
    }))
}
