//! Results of a run handed to the program that started it, beside files or instead of them.

use super::csv::Entry;
use super::vtu::Snapshot;

/// Takes the results of a run while they become known.
///
/// A static run shows one snapshot, a run in time one for each time that is written. Calls come from the thread that runs the scene.
pub trait Observer: std::fmt::Debug + Sync {
    /// Returns true if the run writes files as well.
    fn wants_files(&self) -> bool {
        true
    }

    /// Takes a row of a table: `history` and `tip_NAME` of a run in time, the lines and `probes` of a static one.
    ///
    /// Shapes: `row` has one entry per column.
    fn row(&self, table: &str, columns: &[String], row: &[Entry]);

    /// Takes cells, points and fields, the same that a VTU file shows. They are handed over whole: nothing is copied.
    fn snapshot(&self, snapshot: Snapshot);
}
