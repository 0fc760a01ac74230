//! Scenes from files and texts; the parameters that an `accuracy` leaves open are chosen.

use std::path::Path;

use bondline::model::PointSource;
use bondline::run::AnyScene;
use bondline::scene::{Scene, SceneError, Source, read};

use crate::accuracy;

/// Reads and validates a scene file with overrides `key=value`. What a scene with an `accuracy` leaves open is chosen, by small runs of it.
///
/// # Errors
/// A [`SceneError`] with place, value and remedy.
pub fn load(path: &Path, overrides: &[String]) -> Result<AnyScene, SceneError> {
    let (source, directory, name) = read(path, overrides)?;
    from_source(&source, directory, &name)
}

/// Validates a scene whose relative paths start in `directory` and whose files are named `name` by default. What a scene with an
/// `accuracy` leaves open is chosen, by small runs of it.
///
/// # Errors
/// A [`SceneError`] with place, value and remedy.
pub fn from_source(source: &Source, directory: &Path, name: &str) -> Result<AnyScene, SceneError> {
    let Some((complete, chosen)) = accuracy::completed(source, directory)? else {
        return AnyScene::complete(source, directory, name);
    };
    let mut scene = AnyScene::complete(&complete, directory, name)?;
    scene.chose(chosen.choices);
    Ok(scene)
}

/// The spacing of the scene's lattice of points, if it has one.
pub(crate) fn lattice_spacing(scene: &AnyScene) -> Option<f64> {
    fn of<const D: usize>(scene: &Scene<D>) -> Option<f64> {
        match &scene.peridynamics.as_ref()?.points {
            PointSource::Lattice { spacing, .. } => Some(*spacing),
            PointSource::Cells | PointSource::Lattices { .. } => None,
        }
    }
    match scene {
        AnyScene::Bar(s) => of(s),
        AnyScene::Plane(s) => of(s),
        AnyScene::Solid(s) => of(s),
    }
}
