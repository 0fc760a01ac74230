//! Many runs of a scene: what one will need, how large its error is, and what leaves the least error for the time.
//!
//! | file | what |
//! |---|---|
//! | `resource_estimate.rs`, `motion_estimate.rs`, `counted.rs` | what a run will need, without solving; counted where the model is too large to be laid out |
//! | `error_prediction.rs` | an error, predicted |
//! | `output_cost.rs` | what its outputs will cost |
//! | `variants/` | the scene with another value of a key, and how far outputs are apart |
//! | `accuracy/` | what a scene leaves open, chosen for the error that it wants; errors predicted |
//! | `converge.rs` | one scene at several refinements |
//! | `trade/` | what speed costs in accuracy |

pub mod accuracy;
mod converge;
mod counted;
mod error_prediction;
mod motion_estimate;
mod output_cost;
mod resource_estimate;
pub mod trade;
pub mod variants;

use std::path::Path;

pub use accuracy::{CheckError, ErrorPrediction, check};
pub use converge::{ConvergeError, ConvergeParams, Converged, Level, Refinement, converge};
pub use resource_estimate::{MotionPrediction, Prediction};

use crate::progress::Progress;
use crate::run::chosen::with_choice;
use crate::run::{AnyScene, RunError};
use crate::scene::source::read;
use crate::scene::{Points, Scene, SceneError, Solve, Source};

impl AnyScene {
    /// Reads and validates a scene file with overrides `key=value`.
    ///
    /// # Errors
    /// A [`SceneError`] with place, value and remedy.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, SceneError> {
        let (source, directory, name) = read(path, overrides)?;
        Self::from_source(&source, directory, &name)
    }

    /// Validates a scene whose relative paths start in `directory` and whose files are named `name` by default. What a scene with an
    /// `accuracy` leaves open is chosen, by small runs of it.
    ///
    /// # Errors
    /// A [`SceneError`] with place, value and remedy.
    pub fn from_source(source: &Source, directory: &Path, name: &str) -> Result<Self, SceneError> {
        let Some((complete, chosen)) = accuracy::completed(source, directory)? else {
            return Self::complete(source, directory, name);
        };
        let mut scene = Self::complete(&complete, directory, name)?;
        scene.chose(chosen.choices);
        Ok(scene)
    }

    /// What a run will need, without solving; counted from volumes where laying the model out would take too long, see [`Prediction::counted`].
    ///
    /// # Errors
    /// [`RunError`], each with place and remedy.
    pub fn predict(self, progress: &dyn Progress) -> Result<Prediction, RunError> {
        self.fits()?;
        let unused = self.unused().to_vec();
        let counted = match &self {
            Self::Bar(s) => counted::counted(s),
            Self::Plane(s) => counted::counted(s),
            Self::Solid(s) => counted::counted(s),
        };
        if let Some(mut prediction) = counted {
            prediction.warnings.extend(unused);
            return Ok(prediction);
        }
        let mut prediction = match self {
            Self::Bar(s) => with_choice(s.scene, |s| predicted(s, progress)),
            Self::Plane(s) => with_choice(s.scene, |s| predicted(s, progress)),
            Self::Solid(s) => with_choice(s.scene, |s| predicted(s, progress)),
        }?;
        prediction.warnings.extend(unused);
        Ok(prediction)
    }

    /// The spacing of the scene's lattice of points, if it has one.
    pub(crate) fn lattice_spacing(&self) -> Option<f64> {
        fn of<const D: usize>(scene: &Scene<D>) -> Option<f64> {
            match &scene.peridynamics.as_ref()?.points {
                Points::Lattice { spacing, .. } => Some(*spacing),
                Points::Cells | Points::Lattices { .. } => None,
            }
        }
        match self {
            Self::Bar(s) => of(s),
            Self::Plane(s) => of(s),
            Self::Solid(s) => of(s),
        }
    }
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
