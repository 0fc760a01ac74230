//! Settings by which a scene calls a user's routine, and the hook of its loader: crate `bondline-umat`, where a program has it. Without it no scene opens a library.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use super::LocalLaw;

/// Source of the energies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "EnergiesSpec")]
pub enum UmatEnergies {
    /// The stress: stored is its elastic energy, the rest of the work is dissipated.
    #[default]
    Stress,
    /// The routine: SSE, SPD and SCD.
    Routine,
}

/// Settings of the calls of a routine.
#[derive(Clone, Debug, PartialEq)]
pub struct UmatSettings {
    /// `CMNAME`: the name of the material.
    pub name: String,
    /// `PROPS`.
    pub constants: Vec<f64>,
    /// `NSTATV`; all are zero at the start.
    pub states: usize,
    /// Lamé's λ and μ of the solid at rest \[Pa\].
    pub lame: (f64, f64),
    /// For strains and rotations of any size, by a rate form.
    pub is_large: bool,
    /// True if routines keep no common state, so that many may be called at a time.
    pub is_thread_safe: bool,
    /// `TEMP`.
    pub temperature: f64,
    /// `CELENT` \[m\]; not a number where it is not known.
    pub length: f64,
    /// Source of the energies.
    pub energies: UmatEnergies,
    /// True if `DDSDDE` is the tangent of Newton's method; else it is differenced.
    pub has_tangent: bool,
    /// See [`LocalLaw::flows_at_constant_volume`].
    pub flows_at_constant_volume: bool,
}

/// Failure to load a routine.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RoutineError {
    /// The library cannot be loaded.
    #[error("the library {} cannot be loaded: {message}", path.display())]
    Library {
        /// Its path.
        path: PathBuf,
        /// Message of the operating system.
        message: String,
    },
    /// It has no such routine.
    #[error("the library {} has no routine `{}`", path.display(), tried.join("`, `"))]
    Symbol {
        /// Its path.
        path: PathBuf,
        /// The names looked for.
        tried: Vec<String>,
    },
}

/// Loads the routine of a library, by its name or the usual ones, as the law of a solid.
pub type RoutineLoader =
    fn(&Path, Option<&str>, UmatSettings) -> Result<Arc<dyn LocalLaw<3>>, RoutineError>;

static LOADER: OnceLock<RoutineLoader> = OnceLock::new();

/// Registers the loader of routines; the first one stays.
pub fn set_routine_loader(loader: RoutineLoader) {
    let _ = LOADER.set(loader);
}

/// Returns the loader of routines, if the program has one.
pub(crate) fn routine_loader() -> Option<RoutineLoader> {
    LOADER.get().copied()
}
