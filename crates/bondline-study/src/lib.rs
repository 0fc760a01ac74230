//! Many runs of a scene: the predicted cost of one, its error, and the settings of least error for the time.
//!
//! | file | what |
//! |---|---|
//! | `load.rs` | a scene from its file, with the choices of its `accuracy` |
//! | `variants/` | the scene with another value of a key, and the differences of outputs |
//! | `accuracy/` | parameters that a scene leaves open, chosen for the error that it wants; errors predicted |
//! | `converge.rs` | one scene at several refinements |
//! | `pareto/` | cost against accuracy |
//! | `line_plot.rs`, `field_plot.rs` | line plots and coloured fields as SVG |

pub mod accuracy;
mod converge;
pub mod field_plot;
pub mod line_plot;
mod load;
pub mod pareto;
pub mod variants;

pub use accuracy::{CheckError, ErrorPrediction, add_processes, check, check_source};
pub use bondline::predict::{MotionPrediction, Prediction, predict};
pub use converge::{ConvergeError, ConvergeParams, Converged, Level, Refinement, converge};
pub use load::{from_source, load};
