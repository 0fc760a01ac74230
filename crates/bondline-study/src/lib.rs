//! Many runs of a scene: what one will need, how large its error is, and what leaves the least error for the time.
//!
//! | file | what |
//! |---|---|
//! | `load.rs` | a scene from its file, with what its `accuracy` leaves open |
//! | `prediction.rs`, `resource_estimate.rs`, `motion_estimate.rs`, `counted.rs` | what a run will need, without solving; counted where the model is too large to be laid out |
//! | `error_prediction.rs` | an error, predicted |
//! | `output_cost.rs` | what its outputs will cost |
//! | `variants/` | the scene with another value of a key, and how far outputs are apart |
//! | `accuracy/` | what a scene leaves open, chosen for the error that it wants; errors predicted |
//! | `converge.rs` | one scene at several refinements |
//! | `trade/` | what speed costs in accuracy |
//! | `figure.rs`, `map.rs` | line plots and coloured fields as SVG |

pub mod accuracy;
mod converge;
mod counted;
mod error_prediction;
pub mod figure;
mod load;
pub mod map;
mod motion_estimate;
mod output_cost;
mod prediction;
mod resource_estimate;
pub mod trade;
pub mod variants;

pub use accuracy::{CheckError, ErrorPrediction, check};
pub use converge::{ConvergeError, ConvergeParams, Converged, Level, Refinement, converge};
pub use load::{from_source, load};
pub use prediction::predict;
pub use resource_estimate::{MotionPrediction, Prediction};
