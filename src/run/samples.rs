//! Displacements of a static scene at places.

use crate::model::Sampler;
use crate::progress::Progress;
use crate::run::any_scene::{AnyScene, each};
use crate::run::error::RunError;
use crate::run::placed_scene::PlacedScene;
use crate::run::solution::Solved;
use crate::run::statics::solve_with;
use crate::tensor::{Vector, padded};

/// A solved static scene as its displacements at some places.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    /// Horizon in the middle of the body \[m\].
    pub horizon: f64,
    /// Spacing of the points; without points the mean size of a cell \[m\].
    pub spacing: f64,
    /// Number of unknowns.
    pub dofs: usize,
    /// Displacement at each place \[m\], padded with zeros; none outside of the body.
    pub displacement: Vec<Option<[f64; 3]>>,
}

/// Largest number of places that are taken of the sites of a model; of more sites, every so manyth.
const MOST: usize = 20_000;

impl AnyScene {
    /// Solves the scene, and takes its displacements at `places` \[m\]; if there are none, its own sites become the places.
    ///
    /// # Errors
    /// [`RunError`], each with place and remedy.
    pub fn samples(
        self,
        places: &mut Vec<[f64; 3]>,
        progress: &dyn Progress,
    ) -> Result<Samples, RunError> {
        each!(self, scene => samples(*scene, places, progress))
    }
}

fn samples<const D: usize>(
    scene: PlacedScene<D>,
    places: &mut Vec<[f64; 3]>,
    progress: &dyn Progress,
) -> Result<Samples, RunError> {
    let (low, high) = scene.mesh.bounds();
    let horizon = scene.horizon_at(&((low + high) * 0.5));
    let cell = ((high - low).product() / scene.mesh.cell_count() as f64).powf(1.0 / D as f64);
    let mut samples = Samples {
        horizon,
        spacing: 0.0,
        dofs: 0,
        displacement: Vec::new(),
    };
    solve_with(scene, progress, |_, solved: &Solved<'_, D>| {
        let sampler = Sampler::new(solved.model);
        let points = solved.model.spacing();
        samples.spacing = if points > 0.0 { points } else { cell };
        samples.dofs = solved.displacement.len();
        if places.is_empty() {
            let sites = &solved.model.sites;
            let every = sites.len().div_ceil(MOST).max(1);
            places.extend(sites.iter().step_by(every).map(|s| padded(&s.position)));
        }
        samples.displacement = places
            .iter()
            .map(|x| {
                let x = Vector::from_fn(|a, _| x[a]);
                let u = sampler.displacement(&x, solved.displacement)?;
                Some(padded(&u))
            })
            .collect();
        Ok(Vec::new())
    })?;
    Ok(samples)
}
