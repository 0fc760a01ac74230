//! Zones that are drawn: shape, place, coupling, law, horizon and lattice, by seeds that are written here, on meshes that fit nothing.
//!
//! | file | content |
//! |---|---|
//! | `draw.rs` | numbers, and zones of every shape and place |
//! | `affine.rs` | affine fields beside them |
//! | `steps.rs` | stable steps beside them |
//! | `obstacles.rs` | bodies whose notches, holes, corners, loads, supports and interfaces they cross |

mod affine;
pub(crate) mod draw;
pub(crate) mod obstacles;
mod steps;

use super::{Effort, tell};
use bondline::{observe::report::Table, progress::Progress};

/// Every table of the suite.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut tables = Vec::new();
    for part in [steps::tables, obstacles::tables, affine::tables] {
        for table in part(effort, progress) {
            tell(&table, effort, progress);
            tables.push(table);
        }
    }
    tables
}
