//! Scenes as people type them, defaults included, on meshes that fit nothing: loads, affine fields, order, motion and fracture.
//!
//! | file | what |
//! |---|---|
//! | `loads.rs` | masses, totals and first moments of loads |
//! | `motion.rs` | growth that the proof tells of beside that of the run; discrete energy |
//! | `affine.rs` | affine fields on eight families of meshes |
//! | `fracture.rs` | planes pulled apart, balance of energy of bodies that break |
//! | `order.rs` | orders of convergence to exact solutions beside every coupling |
//! | `scene.rs` | a scene as text, run in a folder of its own, and its summary; or its model alone |
//! | `gmsh.rs`, `deck.rs` | meshes as Gmsh text, and as decks |
//!
//! A row passes, or the scene is refused with its reason, and both are counted. Nothing here builds a model by another way than a scene does.

pub mod affine;
pub(crate) mod deck;
pub mod fracture;
pub mod gmsh;
pub mod loads;
mod motion;
pub(crate) mod order;
pub mod scene;

use super::{Effort, tell};
use bondline::{observe::report::Table, progress::Progress};

/// The tables of one file.
type Tables = fn(Effort, &dyn Progress) -> Vec<Table>;

/// Every table of the suite.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let parts: &[Tables] = &[
        loads::run,
        motion::tables,
        affine::tables,
        fracture::planes,
        fracture::balances,
    ];
    let mut tables = Vec::new();
    for part in parts {
        for table in part(effort, progress) {
            tell(&table, effort, progress);
            tables.push(table);
        }
    }
    // these take the longest, and tell of each problem by themselves
    tables.extend(order::order(effort, progress));
    tables
}
