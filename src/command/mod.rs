//! What only the program has, and not the library: the process around a run.
//!
//! | file | what |
//! |---|---|
//! | `interrupt.rs` | signals |
//! | `memory.rs` | the limit of memory, and the end of a run that exceeds it |
//! | `threads.rs` | how many threads compute |
//! | `terminal.rs` | standard output and standard error, which may be full or closed |

pub mod interrupt;
pub mod memory;
pub mod terminal;
pub mod threads;
