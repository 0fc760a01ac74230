//! Parameters of load steps.

use crate::progress::{Progress, Silent};
use crate::solve::krylov::LinearMap;
use crate::system::{ElementTangent, Symmetry};

/// Method by which equilibrium is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Equilibrium {
    /// By Newton's method.
    #[default]
    Newton,
    /// By damped motion.
    Relaxation,
}

/// Method and stopping criteria of a load step.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct QuasiStaticParams {
    /// Method by which equilibrium is found.
    pub equilibrium: Equilibrium,
    /// `‖f − F‖₂` on free dofs to be reached, relative to the norm of all internal and external forces, or of those in equilibrium before bonds broke
    /// in this load step.
    pub tolerance: f64,
    /// Products with the stiffness, or passes over the bonds, for one equilibrium.
    pub max_iterations: usize,
    /// Times that bonds may break within one load step.
    pub max_rounds: usize,
}

impl Default for QuasiStaticParams {
    fn default() -> Self {
        QuasiStaticParams {
            equilibrium: Equilibrium::Newton,
            tolerance: 1e-8,
            max_iterations: 50_000,
            max_rounds: 100_000,
        }
    }
}

/// Makes factors of the tangent within a load step.
pub trait Refactor: Sync {
    /// Factors of the tangent of [`Aids::near`] with what `elements` have beyond it; none where a tangent that is to be symmetric has directions of no or negative stiffness.
    fn factors(&self, elements: &ElementTangent, symmetry: Symmetry) -> Option<Box<dyn LinearMap>>;

    /// Returns the number of iterations that take as long as a factorisation.
    fn worth(&self) -> usize;

    /// Factors of a tangent at rest of which bonds are broken, by its products; none where a tangent that is to be symmetric has directions of no or negative stiffness.
    fn factors_of(&self, tangent: &dyn LinearMap, symmetry: Symmetry)
    -> Option<Box<dyn LinearMap>>;

    /// Returns the number of iterations that take as long as such products and their factorisation.
    fn worth_of_products(&self) -> usize;
}

/// Preconditioners of a run, and its listener.
#[derive(Clone, Copy)]
pub struct Aids<'a> {
    /// An inverse of the tangent before bonds broke, or something near it, symmetric if the tangent is; it saves Newton's method iterations.
    pub near: Option<&'a dyn LinearMap>,
    /// Makes factors of the tangent at a displacement where elements know it, and of that which broken bonds leave; if absent, those of `near` serve throughout.
    pub refactor: Option<&'a dyn Refactor>,
    /// Listener to iterations within a load step; it may end the run there.
    pub progress: &'a dyn Progress,
}

impl Default for Aids<'_> {
    fn default() -> Self {
        Self {
            near: None,
            refactor: None,
            progress: &Silent,
        }
    }
}
