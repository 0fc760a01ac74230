//! The command line of the program, within the interpreter.

use std::ffi::OsString;
use std::path::PathBuf;

use bondline_terminal::memory::Allocator;
use pyo3::prelude::*;

// `--memory` counts by it; without a limit it is the system's
#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// Carries out the command of the arguments and returns the exit status; `program` starts the command line once more.
#[pyfunction]
pub fn command(py: Python<'_>, program: PathBuf, arguments: Vec<OsString>) -> u8 {
    py.detach(|| bondline_cli::command(Ok(program), arguments))
}
