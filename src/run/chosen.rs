//! Fallback of a run whose chosen coupling does not hold: it goes on with the next one, or with a rim of its own, and says so.

use crate::model::ModelError;
use crate::run::error::RunError;
use crate::scene::validated::Scene;

/// Does something with a scene; where its coupling was chosen and turns out not to hold, with the next choice, which then says what was tried.
///
/// # Errors
/// Those of `then`; [`RunError::NoCoupling`] if no choice holds.
pub fn with_choice<const D: usize, T>(
    scene: Scene<D>,
    mut then: impl FnMut(Scene<D>) -> Result<T, RunError>,
) -> Result<T, RunError> {
    with_each(scene, &mut then)
}

fn with_each<const D: usize, T>(
    mut scene: Scene<D>,
    then: &mut dyn FnMut(Scene<D>) -> Result<T, RunError>,
) -> Result<T, RunError> {
    let Some(mut other) = scene.otherwise.take() else {
        return then(scene);
    };
    // what whoever holds the scene has set since it was read; its layout is its own
    other.output = scene.output.clone();
    other.solve = scene.solve.clone();
    other.solver = scene.solver;
    other.title = scene.title.clone();
    let is_typed = scene.coupling_why.is_none();
    let (first, second) = (scene.coupling.traits().name, other.coupling.traits().name);
    match then(scene) {
        Err(reason) if reason.is_of_coupling() => {
            let tried = format!("`{first}` was tried and does not hold: {reason}");
            other.coupling_why = Some(match is_typed {
                true => tried,
                false => format!("the scene names none; {tried}"),
            });
            with_each(*other, then).map_err(|error| match error.is_of_coupling() {
                true => RunError::NoCoupling {
                    first,
                    reason: Box::new(reason),
                    second,
                    error: Box::new(error),
                },
                false => error,
            })
        }
        done => done,
    }
}

impl RunError {
    /// Returns true if another coupling might do: the seam refuses, or the proof does.
    pub(crate) fn is_of_coupling(&self) -> bool {
        matches!(
            self,
            Self::Indefinite { .. }
                | Self::Unproven { .. }
                | Self::Model(
                    ModelError::Seam { .. }
                        | ModelError::TwoDilatations
                        | ModelError::SeamTooLarge { .. }
                        | ModelError::Unsupported { .. }
                        | ModelError::Family { .. }
                        | ModelError::OtherMaterial { .. }
                        | ModelError::Fit { .. }
                        | ModelError::Derivative { .. }
                )
        )
    }
}
