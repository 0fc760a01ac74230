//! One run of a scene: its model laid out, proved, solved and written.
//!
//! | file | what |
//! |---|---|
//! | `any_scene.rs`, `placed_scene.rs` | a scene of any dimension with its zone placed: the input of a run |
//! | `zone_placement/` | `zones = "auto"`: the nonlocal zone that a solution with elements alone asks for |
//! | `setup.rs` | `Scene` to the problem that is coupled, and the settings that a run keeps |
//! | `budget.rs` | the memory that a run may take, and the refusal of a scene that needs more before anything is laid out |
//! | `chosen.rs` | the next coupling where the one that was chosen does not hold |
//! | `definiteness.rs` | stability of a seam that may be unstable |
//! | `loads.rs` | which sites conditions hold, and the force that each site takes |
//! | `proof/` | checks of a model before it is solved |
//! | `equilibrium.rs`, `solution.rs` | assembly, conditions and solution of a static system |
//! | `static_contact.rs` | surfaces and faces of cracks that press on each other in a static scene |
//! | `statics.rs`, `motion/` | the sequence of a static run; scenes in time and load steps, checkpoints |
//! | `results.rs` | a solution that a program keeps: fields and tables by name |
//! | `intact.rs` | bonds between points that stand |
//! | `solution_samples.rs` | a solution along lines and at probes, as tables |
//! | `samples.rs` | displacements of a static scene at places, for studies of convergence |
//! | `linear.rs` | the model alone, for studies of stiffness, eigenvalues and waves |
//! | `fields/` | fields of a solution, which files and tables have |
//! | `field_probes.rs` | fields at probes with each row of a history |
//! | `stresses.rs`, `stress_settings.rs` | stress as outputs show it |
//! | `slopes.rs` | strain and stress between the places that carry them |
//! | `conduction.rs` | the temperature that heat conduction gives |
//! | `thermal.rs` | the force on each site that a change of temperature gives |
//! | `condition_terms.rs` | forces of conditions that depend on the displacement, on the sites of a model |
//! | `energy_release.rs` | energy release rate and stress intensity factors at the tips of cracks |
//! | `sections.rs` | force and moment that the part of the body beyond a plane exerts on the rest |
//! | `balance.rs`, `rotation.rs`, `surface_gradient.rs`, `warnings.rs` | balance of loads and reactions; rotation of elements; stresses that families do not resolve; properties of a model that make its results doubtful |
//! | `linear_parts.rs` | elements, rows and bonds that are linear, or stay whole, beyond where their material is |
//! | `write.rs`, `bonds.rs` | the files of a run; bonds as lines |
//! | `pieces.rs`, `point_cells.rs`, `parts.rs` | the piece of a VTU file that a process writes; the cells shown around points; the parts shown of cut elements |
//! | `error.rs` | errors of a run, with place and remedy |
//! | `block.rs`, `observed_tests.rs` | a block from a scene, for unit tests; tests of the data that an observer receives |

mod any_scene;
mod balance;
#[cfg(test)]
pub(crate) mod block;
pub(crate) mod bonds;
pub mod budget;
pub mod chosen;
pub(crate) mod condition_terms;
mod conduction;
mod definiteness;
mod energy_release;
pub mod equilibrium;
pub(crate) mod error;
mod field_probes;
pub mod fields;
mod intact;
mod linear;
mod linear_parts;
pub mod loads;
pub mod motion;
#[cfg(test)]
mod observed_tests;
mod parts;
pub mod pieces;
pub(crate) mod placed_scene;
mod point_cells;
pub mod proof;
mod results;
mod rotation;
mod samples;
mod sections;
pub mod setup;
mod slopes;
pub mod solution;
mod solution_samples;
mod static_contact;
pub(crate) mod statics;
mod stress_settings;
mod stresses;
mod surface_gradient;
mod thermal;
pub mod warnings;
pub mod write;
mod zone_placement;

pub use crate::run::placed_scene::PlacedScene;
pub use any_scene::AnyScene;
pub use budget::{Share, memory_budget, set_memory_budget};
pub use error::RunError;
pub use linear::SceneModel;
pub use motion::{RunOptions, StartFrom};
pub use results::{BuildError, Frame, NoSuchField, Solution, Table};
pub use samples::Samples;
pub use solution::{Moved, Solved};
pub use statics::solve_with;
pub use write::write;
