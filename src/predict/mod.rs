//! Prediction of the resources of a run, without solving.
//!
//! | file | what |
//! |---|---|
//! | `resource_estimate.rs` | of a static scene: sizes, memory, time |
//! | `solver_estimate.rs` | cost of solving with a stiffness |
//! | `motion_estimate.rs` | of one that moves |
//! | `counted.rs` | the same from volumes, where the model is too large to be laid out |
//! | `output_cost.rs` | memory and time of the outputs |
//! | `display.rs` | a prediction, as people read it |
//! | `error_prediction.rs` | an error, predicted |
//! | `processes.rs` | share of each of several processes |
//! | `process_memory.rs` | the memory of each |

pub mod counted;
mod display;
mod error_prediction;
mod motion_estimate;
pub mod output_cost;
mod process_memory;
mod processes;
mod resource_estimate;
mod solver_estimate;

pub use error_prediction::{ErrorPrediction, ErrorReference};
pub use processes::{Processes, processes};
pub use resource_estimate::{MotionPrediction, Prediction, ProcessShare};

use crate::progress::Progress;
use crate::run::chosen::with_choice;
use crate::run::{AnyScene, RunError};
use crate::scene::{Scene, Solve};

/// Predicts the resources of a run of a scene, without solving; counted from volumes where laying the model out would take too long, see [`Prediction::counted`].
///
/// # Errors
/// [`RunError`], each with place and remedy.
pub fn predict(scene: AnyScene, progress: &dyn Progress) -> Result<Prediction, RunError> {
    scene.fits()?;
    let counted = match &scene {
        AnyScene::Bar(s) => counted::counted(s),
        AnyScene::Plane(s) => counted::counted(s),
        AnyScene::Solid(s) => counted::counted(s),
    };
    if let Some(mut prediction) = counted {
        prediction.warnings.extend(scene.unused());
        scene.warning_policy().apply(&mut prediction.warnings);
        return Ok(prediction);
    }
    laid_out(scene, progress)
}

/// As [`predict`], of the model laid out, however long that takes.
///
/// # Errors
/// [`RunError`], each with place and remedy.
pub fn laid_out(scene: AnyScene, progress: &dyn Progress) -> Result<Prediction, RunError> {
    scene.fits()?;
    let (unused, policy) = (scene.unused(), scene.warning_policy().clone());
    let mut prediction = match scene {
        AnyScene::Bar(s) => with_choice(s.scene, |s| predicted(s, progress)),
        AnyScene::Plane(s) => with_choice(s.scene, |s| predicted(s, progress)),
        AnyScene::Solid(s) => with_choice(s.scene, |s| predicted(s, progress)),
    }?;
    prediction.warnings.extend(unused);
    policy.apply(&mut prediction.warnings);
    Ok(prediction)
}

/// Predicts the resources of a run of a scene, once the model is laid out.
fn predicted<const D: usize>(
    scene: Scene<D>,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    match scene.solve {
        Solve::Static => resource_estimate::predict(scene, progress),
        Solve::Explicit(_) | Solve::QuasiStatic(_) => motion_estimate::predict(scene, progress),
    }
}
