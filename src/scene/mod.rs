//! Scenes: TOML to a validated problem to its results. The only module that knows TOML and the run-time dimension.
//!
//! | file | what |
//! |---|---|
//! | `source.rs` | the text and its overrides on one axis of positions |
//! | `choice.rs` | tables of exactly one key, and how overrides replace them |
//! | `expression.rs`, `value.rs` | numbers, expressions, coordinates with their places |
//! | `spec/` | what is typed; the JSON Schema comes from here |
//! | `parse.rs` | text to `SceneSpec`, with errors that underline |
//! | `error.rs` | place, value and remedy |

mod choice;
mod error;
mod expression;
mod parse;
mod source;
pub mod spec;
mod value;

pub use error::{SceneError, SceneErrorKind};
pub use expression::{Expression, ExpressionError};
pub use source::{Source, Span};
pub use spec::SceneSpec;
pub use value::{Coordinates, Count, Number, Text};

/// The JSON Schema of scene files, for editors.
pub fn schema() -> schemars::Schema {
    schemars::schema_for!(SceneSpec)
}
