//! A scene whose nonlocal zone is placed.

use super::zone_placement::CachedSolution;
use crate::scene::Scene;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

/// A validated scene with its nonlocal zone, and with the solution by which that was placed.
#[derive(Clone, Debug)]
pub struct PlacedScene<const D: usize> {
    /// The scene.
    pub scene: Scene<D>,
    pub(super) kept: Option<Arc<CachedSolution<D>>>,
}

impl<const D: usize> From<Scene<D>> for PlacedScene<D> {
    fn from(scene: Scene<D>) -> Self {
        Self { scene, kept: None }
    }
}

impl<const D: usize> Deref for PlacedScene<D> {
    type Target = Scene<D>;

    fn deref(&self) -> &Scene<D> {
        &self.scene
    }
}

impl<const D: usize> DerefMut for PlacedScene<D> {
    fn deref_mut(&mut self) -> &mut Scene<D> {
        &mut self.scene
    }
}
