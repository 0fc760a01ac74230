//! Parts that the programs of bondline share, and the library does without: the process around a computation, and the person who waits for it.
//!
//! | file | what |
//! |---|---|
//! | `progress.rs` | a bar on standard error, if that is a terminal |
//! | `progress_log.rs` | lines in its place, if it is a file or a pipe |
//! | `report.rs` | a mistake in a scene, with the text underlined |
//! | `streams.rs` | standard output and standard error, which may be full or closed |
//! | `memory.rs` | the limit of memory, and the end of a run that exceeds it |
//! | `processes.rs` | several processes under `mpirun` |

pub mod memory;
mod processes;
pub mod progress;
mod progress_log;
mod report;
mod streams;

pub use processes::{Processes, refuse_several};
pub use progress::TerminalProgress;
pub use report::report;
pub use streams::{print, tell};
