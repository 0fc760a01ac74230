//! User materials: compiled routines with the calling convention of Abaqus' UMAT, loaded at run time, as local laws of solids (docs/umat.md).
//!
//! A program that calls [`register`] once takes scenes whose materials are `umat`; the program `bondline` does so with its feature `umat`. All else is the library's
//! ([`bondline::material::UmatSettings`]).

mod law;
// calls of routines that other compilers made: the other module has no unsafe code
#[allow(unsafe_code)]
mod library;

use std::path::Path;
use std::sync::Arc;

use bondline::material::{LocalLaw, RoutineError, UmatSettings, set_routine_loader};

pub use law::Umat;
pub use library::Routine;

/// Lets scenes name routines.
pub fn register() {
    set_routine_loader(load);
}

fn load(
    library: &Path,
    symbol: Option<&str>,
    settings: UmatSettings,
) -> Result<Arc<dyn LocalLaw<3>>, RoutineError> {
    let routine = Routine::load(library, symbol)?;
    Ok(Arc::new(Umat::new(routine, settings)))
}
