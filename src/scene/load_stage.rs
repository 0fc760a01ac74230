//! Load steps before the motion of a validated scene.

use super::conditions::Condition;
use super::solve::QuasiStatic;

/// Load steps whose last state of equilibrium a motion begins with.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadStage<const D: usize> {
    /// Its name.
    pub name: String,
    /// Its load steps.
    pub solve: QuasiStatic,
    /// Supports and loads that act in it.
    pub conditions: Vec<Condition<D>>,
}
