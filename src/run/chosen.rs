//! Fallback of a run whose chosen coupling does not hold: it goes on with the next one, or with a rim of its own, and says so.

use crate::model::ModelError;
use crate::run::error::RunError;
use crate::scene::validated::Scene;

/// The faces along which a coupling is tried where they are not those of the mesh.
const OWN_RIM: &str = "with a rim of its own";

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
        let (along_faces, refused) = (tried(&scene), scene.refused_rim.take());
        return then(scene).map_err(|error| match refused {
            Some(why) if error.is_of_coupling() => RunError::NoCoupling {
                tried: vec![
                    (format!("{along_faces} {OWN_RIM}"), RunError::Rim(why)),
                    (along_faces, error),
                ],
            },
            _ => error,
        });
    };
    // what whoever holds the scene has set since it was read; its layout is its own
    let sections = std::mem::take(&mut other.output.sections);
    other.output = scene.output.clone();
    // these know the body before its patch, if it has one
    other.output.sections = sections;
    other.solve = scene.solve.clone();
    other.before.clone_from(&scene.before);
    other.solver = scene.solver;
    other.title = scene.title.clone();
    let is_typed = scene.coupling_why.is_none();
    let [first, second] = [tried(&scene), tried(&other)];
    match then(scene) {
        Err(reason) if reason.is_of_coupling() => {
            let why = format!("{first} was tried and does not hold: {reason}");
            other.coupling_why = Some(match is_typed {
                true => why,
                false => format!("the scene names none; {why}"),
            });
            with_each(*other, then).map_err(|error| match error {
                RunError::NoCoupling { mut tried } => {
                    tried.insert(0, (first, reason));
                    RunError::NoCoupling { tried }
                }
                error if error.is_of_coupling() => RunError::NoCoupling {
                    tried: vec![(first, reason), (second, error)],
                },
                error => error,
            })
        }
        done => done,
    }
}

/// The coupling of a scene as it is told of, with the faces along which it is tried.
fn tried<const D: usize>(scene: &Scene<D>) -> String {
    let name = scene.coupling.traits().name;
    match scene.mesh.embedded.has_patch() {
        true => format!("`{name}` {OWN_RIM}"),
        false => format!("`{name}`"),
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
