//! The native half of the Python package `bondline`: scenes, runs and their results as numpy arrays.
//!
//! Users import the Python half in `python/bondline`; it alone documents the interface. Nothing here solves or writes: this crate hands scenes to the library
//! and results back.
//!
//! | file | what |
//! |---|---|
//! | `scene.rs` | a scene: loaded, checked, run |
//! | `attend.rs` | a computation on a thread of its own, while the interpreter goes on and signals are seen |
//! | `frame.rs` | cells, points and fields as numpy arrays, without a copy |
//! | `mesh.rs` | a mesh in memory |
//! | `value.rs` | Python's values as those of a scene |
//! | `errors.rs` | errors of the library as exceptions |
//! | `program.rs` | the command line |

mod attend;
mod errors;
mod frame;
mod function;
mod mesh;
mod program;
mod scene;
mod value;

use pyo3::prelude::*;

#[pymodule]
fn _bondline(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<scene::Scene>()?;
    module.add_class::<mesh::Mesh>()?;
    module.add_function(wrap_pyfunction!(program::command, module)?)?;
    module.add_function(wrap_pyfunction!(frame::frame_of_vertices, module)?)
}
