//! What a run will need, without solving.

use bondline::progress::Progress;
use bondline::run::chosen::with_choice;
use bondline::run::{AnyScene, RunError};
use bondline::scene::{Scene, Solve};

use crate::resource_estimate::Prediction;
use crate::{counted, motion_estimate, resource_estimate};

/// What a run of a scene will need, without solving; counted from volumes where laying the model out would take too long, see [`Prediction::counted`].
///
/// # Errors
/// [`RunError`], each with place and remedy.
pub fn predict(scene: AnyScene, progress: &dyn Progress) -> Result<Prediction, RunError> {
    scene.fits()?;
    let unused = scene.unused().to_vec();
    let counted = match &scene {
        AnyScene::Bar(s) => counted::counted(s),
        AnyScene::Plane(s) => counted::counted(s),
        AnyScene::Solid(s) => counted::counted(s),
    };
    if let Some(mut prediction) = counted {
        prediction.warnings.extend(unused);
        return Ok(prediction);
    }
    let mut prediction = match scene {
        AnyScene::Bar(s) => with_choice(s.scene, |s| predicted(s, progress)),
        AnyScene::Plane(s) => with_choice(s.scene, |s| predicted(s, progress)),
        AnyScene::Solid(s) => with_choice(s.scene, |s| predicted(s, progress)),
    }?;
    prediction.warnings.extend(unused);
    Ok(prediction)
}

/// What a run of a scene will need, once the model is laid out.
fn predicted<const D: usize>(
    scene: Scene<D>,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    match scene.solve {
        Solve::Static => resource_estimate::predict(scene, progress),
        Solve::Explicit(_) | Solve::QuasiStatic(_) => motion_estimate::predict(scene, progress),
    }
}
