//! Scenes: TOML to a validated problem to its results. The only module that knows TOML and the run-time dimension.
//!
//! | file | what |
//! |---|---|
//! | `source.rs` | the text and its overrides on one axis of positions |
//! | `choice.rs` | tables of exactly one key, and how overrides replace them |
//! | `expression.rs`, `value.rs` | numbers, expressions, coordinates with their places |
//! | `spec/` | what is typed; the JSON Schema comes from here |
//! | `parse.rs` | text to `SceneSpec`, with errors that underline |
//! | `validate.rs` | `SceneSpec` to `Scene`: every name resolved, every number checked |
//! | `meshing.rs`, `region.rs`, `zones.rs`, `bodies.rs`, `materials.rs`, `peridynamics.rs`, `default_points.rs`, `obstacles.rs`, `conditions.rs`, `solve.rs`, `initial.rs`, `breaking.rs`, `follow.rs`, `output.rs` | its parts |
//! | `automatic/` | `zones = "auto"`: the nonlocal zone that a solution with elements alone asks for |
//! | `definite.rs` | whether a seam that may be unstable is |
//! | `doubts.rs` | what of a model makes its results doubtful |
//! | `joined.rs`, `chosen.rs` | the coupling that is typed, or the one that suits the scene; the next one where that does not hold |
//! | `agreement.rs` | whether parts that are right alone agree |
//! | `unused.rs` | parts of a scene that touch nothing |
//! | `loads.rs` | which sites conditions hold, and the force that each site takes |
//! | `motion/` | scenes in time: what drives them, what they write, checkpoints |
//! | `setup.rs` | `Scene` to the problem that is coupled, and the settings that a run keeps |
//! | `equilibrium.rs`, `solution.rs` | assembly, conditions and solution of a static system |
//! | `run.rs`, `write.rs` | the sequence of a run; its files |
//! | `budget.rs` | the memory that a run may take, and the refusal of what needs more before anything is laid out |
//! | `proof/` | what is shown about a model before it is solved |
//! | `predict.rs`, `cost.rs` | what a run will need, without solving; what its outputs will cost |
//! | `accuracy/` | what a scene leaves open, chosen for the error that it wants; errors predicted |
//! | `converge.rs` | one scene at several refinements |
//! | `template.rs` | commented scenes to start from |
//! | `error.rs`, `run_error.rs` | place, value and remedy: of what is typed, and of what cannot be run |

pub mod accuracy;
mod agreement;
mod automatic;
mod bodies;
mod breaking;
mod budget;
mod check;
mod choice;
mod chosen;
mod conditions;
mod converge;
mod cost;
pub(crate) mod default_points;
mod definite;
pub(crate) mod doubts;
mod equilibrium;
mod error;
mod expression;
mod follow;
mod initial;
mod joined;
mod linear;
mod loads;
mod materials;
mod meshing;
mod motion;
mod obstacles;
mod output;
mod parse;
mod peridynamics;
mod predict;
mod proof;
mod region;
mod rotation;
mod run;
mod run_error;
mod setup;
mod solution;
mod solve;
mod source;
pub mod spec;
mod template;
mod unused;
mod validate;
mod value;
pub mod variants;
mod write;
mod zones;

pub use accuracy::{CheckError, ErrorPrediction, check};
pub use breaking::{Breaking, Contact};
pub use budget::{memory_budget, set_memory_budget};
pub use conditions::{Components, Condition, Field, Prescribed, Support};
pub use converge::{ConvergeError, ConvergeParams, Converged, Level, Refinement, converge};
pub use error::{SceneError, SceneErrorKind};
pub use expression::{Expression, ExpressionError};
pub use follow::Follow;
pub use initial::{Initial, InitialKind};
pub use linear::LinearModel;
pub use materials::{Fracture, Law, Material};
pub use motion::{RunOptions, StartFrom};
pub use peridynamics::{Peridynamics, Points};
pub use predict::{MotionPrediction, Prediction, Share};
pub(crate) use proof::growth::{REMEDY, REMEDY_SEAM};
pub use region::Region;
pub use run::solve_with;
pub use run_error::RunError;
pub use solution::Solved;
pub use solve::{Explicit, QuasiStatic, Solve};
pub use source::{Source, Span};
pub use spec::SceneSpec;
pub use template::Template;
pub use validate::{AnyScene, Output, Scene, Solver, Tip};
pub use value::{Coordinates, Count, Number, Text};
pub use write::write;

/// The JSON Schema of scene files, for editors.
pub fn schema() -> schemars::Schema {
    let mut schema = schemars::schema_for!(SceneSpec);
    // what a scene with an `accuracy` may leave out
    for (table, keys) in [
        ("LineMeshSpec", &["x", "y", "z"]),
        ("RectangleMeshSpec", &["x", "y", "z"]),
        ("BoxMeshSpec", &["x", "y", "z"]),
        ("PeridynamicsSpec", &["horizon", "points", ""]),
    ] {
        if let Some(serde_json::Value::Array(required)) =
            schema.pointer_mut(&format!("/$defs/{table}/required"))
        {
            required.retain(|key| !keys.iter().any(|k| key == k));
        }
    }
    schema
}
