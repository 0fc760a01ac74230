//! Parts that only the program has, and not the library: the process around a run.
//!
//! | file | what |
//! |---|---|
//! | `fields.rs` | the list of fields |
//! | `help.rs` | texts below the list of commands |
//! | `interrupt.rs` | signals |
//! | `threads.rs` | the number of threads |
//! | `verify.rs` | the program of the suites, which is built apart |

pub mod fields;
pub mod help;
pub mod interrupt;
pub mod threads;
pub mod verify;
