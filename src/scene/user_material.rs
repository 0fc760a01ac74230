//! Materials whose stress a user's routine gives: from what is typed to a law.

use std::path::Path;
use std::sync::Arc;

use super::bounds_checks::{not_negative, positive};
use super::error::SceneError;
use super::spec::{StrainsSpec, TangentSpec, UmatSpec};
use super::value::Text;
use crate::material::{RoutineError, UmatSettings, routine_loader};
use crate::observe::checkpoint::Fingerprint;
use crate::peridynamics::Law;
use crate::peridynamics::laws::{Constants, LocalCorrespondence};

/// The law of a routine, whose library lies relative to `directory`.
pub(crate) fn umat<const D: usize>(
    name: &Text,
    spec: &UmatSpec,
    constants: Constants,
    directory: &Path,
) -> Result<Arc<dyn Law<D>>, SceneError> {
    let Some(load) = routine_loader() else {
        return Err(SceneError::conflict(format!("`materials.{name}.umat` names a routine, and this program was built without the feature `umat`"))
            .label(spec.library.span.clone(), "cannot be loaded")
            .help("build it with the feature: cargo build --release -p bondline-cli --features umat"));
    };
    let place = |key: &str| format!("materials.{name}.umat.{key}");
    let stabilisation = match &spec.stabilisation {
        Some(s) => not_negative(&place("stabilisation"), s)?,
        None => 1.0,
    };
    let length = match &spec.element_length {
        Some(l) => positive(&place("element-length"), l)?,
        None => f64::NAN,
    };
    let states = match &spec.state {
        Some(count) if count.value > MOST_STATES => {
            return Err(SceneError::wrong_value(format!(
                "`{}` is {}",
                place("state"),
                count.value
            ))
            .label(count.span.clone(), "for every point")
            .help(format!("make it {MOST_STATES} or less")));
        }
        count => count.as_ref().map_or(0, |count| count.value),
    };
    let path = directory.join(&spec.library.value);
    let symbol = spec.symbol.as_ref();
    let settings = UmatSettings {
        name: name.value.clone(),
        constants: spec.constants.iter().map(|c| c.value).collect(),
        states,
        lame: (constants.solid_lambda(), constants.shear),
        is_large: spec.strains == StrainsSpec::Large,
        is_thread_safe: spec.thread_safe,
        temperature: spec.temperature.as_ref().map_or(0.0, |t| t.value),
        length,
        energies: spec.energies,
        has_tangent: spec.tangent == TangentSpec::Routine,
        flows_at_constant_volume: spec.mean_dilatation.unwrap_or(true),
    };
    let solid = load(&path, symbol.map(|s| s.value.as_str()), settings).map_err(|error| {
        let wrong = SceneError::file(format!("`{}`: {error}", place("library")));
        match (&error, symbol) {
            (RoutineError::Library { .. }, _) => wrong
                .label(spec.library.span.clone(), "this library")
                .help("the path is relative to the scene file; compile the routine with ABA_PARAM.INC and abaqus_utilities.c of the folder umat, as docs/umat.md says"),
            (RoutineError::Symbol { .. }, Some(symbol)) => wrong
                .label(symbol.span.clone(), "no such routine")
                .help("Fortran compilers write names in small letters with `_` behind them; `nm -D` of the library lists its names"),
            (RoutineError::Symbol { .. }, None) => wrong
                .label(spec.library.span.clone(), "this library")
                .help("give the routine's name with `symbol`; `nm -D` of the library lists its names"),
        }
    })?;
    let local = constants.local(solid);
    let control = spec.zero_energy_control as usize;
    let linear = constants.correspondence(stabilisation, control as f64);
    let law = LocalCorrespondence::new("user material (UMAT)", linear, local);
    Ok(Arc::new(law))
}

/// The most numbers that a routine may remember of a point.
const MOST_STATES: usize = 10_000;

/// Adds the library to the number that stands for all that determines the results: a routine that is compiled anew gives others.
pub(crate) fn add_library(
    name: &Text,
    spec: &UmatSpec,
    directory: &Path,
    print: &mut Fingerprint,
) -> Result<(), SceneError> {
    let path = directory.join(&spec.library.value);
    let bytes = std::fs::read(&path).map_err(|error| {
        SceneError::file(format!(
            "`materials.{name}.umat.library`: {}: {error}",
            path.display()
        ))
        .label(spec.library.span.clone(), "this library")
        .help("the path is relative to the scene file")
    })?;
    print.add(&bytes);
    Ok(())
}
