//! Parts that only the program has, and not the library: the process around a run.
//!
//! | file | what |
//! |---|---|
//! | `fields.rs` | the list of fields |
//! | `interrupt.rs` | signals |
//! | `threads.rs` | the number of threads |
//! | `verify.rs` | the program of the suites, which is built apart |

pub mod fields;
pub mod interrupt;
pub mod threads;
pub mod verify;
