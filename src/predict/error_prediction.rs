//! The error of a scene, predicted from other runs of it.

use serde::Serialize;

/// Reference of a predicted error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ErrorReference {
    /// Elasticity: nothing is cut, and no bond can break, so that the horizon is a number of the method.
    Elasticity,
    /// Peridynamics everywhere, with the horizon of the scene.
    Peridynamics,
    /// The scene itself with many more points under its horizon: what elements do to a body whose bonds are cut or break is not in it.
    FinerScene,
}

impl std::fmt::Display for ErrorReference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Elasticity => "elasticity",
            Self::Peridynamics => "peridynamics everywhere",
            Self::FinerScene => "finer points with the same horizon",
        })
    }
}

/// An error, predicted from other runs of the scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrorPrediction {
    /// Quantities that are compared.
    pub quantities: Vec<String>,
    /// The relative error.
    pub error: f64,
    /// Reference that it is measured against.
    pub against: ErrorReference,
    /// The measured error was within this factor in so many scenes as `share` says.
    pub spread: f64,
    /// Share of the scenes for which that is true, see `docs/choosing.md`.
    pub share: &'static str,
    /// The order in the spacing that the pilots show.
    pub order: f64,
    /// Runs that it comes from.
    pub pilots: usize,
    /// Seconds that they took.
    pub seconds: f64,
}
