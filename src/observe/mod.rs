//! Output of a computation: fields for ParaView, tables and summaries. Pictures are drawn by `bondline-study`, progress by `bondline-terminal`.
//!
//! | file | what |
//! |---|---|
//! | `vtu.rs` | FE cells and PD points in one VTU, and a PVTU or a PVD over several |
//! | `data_array.rs` | numbers as text of a VTK XML file |
//! | `pieces.rs` | one VTU of each of several processes, and a PVTU over them |
//! | `series.rs` | VTU files over time and their PVD |
//! | `checkpoint.rs` | the state of a run, whole or not at all |
//! | `claim.rs` | claims on a folder, so that no two runs write the same files |
//! | `csv.rs` | values along a line, at probes or over steps, row by row; tables that grow with a run are cut where it resumes |
//! | `report.rs` | rows with a verdict, their table for people and their JSON |
//! | `summary.rs`, `motion_summary.rs` | summary of one run: sizes, choices, timings, balance; energies over time |
//! | `cracks.rs` | energy and area of broken bonds, in a summary |
//! | `tip_summary.rs` | energy release rate and stress intensity factors at the tip of a crack, in a summary |
//! | `provenance.rs` | program, scene, machine and times of a run, in a file beside its outputs |
//! | `proof.rs` | results of the checks of a model before it is solved |
//! | `warning.rs` | doubts about a model or its solution |
//! | `rezoning_event.rs` | changes of the nonlocal zone during a run |
//! | `observer.rs` | results handed to the program that started a run |
//! | `atomic_file.rs` | whole files or none: written beside, then renamed |

pub mod atomic_file;
pub mod checkpoint;
pub mod claim;
pub mod cracks;
pub mod csv;
mod data_array;
mod motion_summary;
mod observer;
pub mod pieces;
pub mod proof;
pub mod provenance;
pub mod report;
pub mod rezoning_event;
pub mod series;
pub mod summary;
pub mod tip_summary;
pub mod vtu;
pub mod warning;

pub use observer::Observer;

use std::path::{Path, PathBuf};

/// Error of an output that could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ObserveError {
    /// The folder of an output is missing and cannot be made.
    #[error("cannot create the folder {}: {source}; {}", path.display(), remedy(source))]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}: {source}; {}", path.display(), remedy(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Another run writes the same file.
    #[error("another run writes {} ({by}); wait for it, or give another folder by --output or another output.name", path.display())]
    Claimed {
        /// The file.
        path: PathBuf,
        /// The process and its scene.
        by: String,
    },
    /// A scene of another name has left this file.
    #[error("{} belongs to {owner}; give another folder by --output or another output.name, or remove it", path.display())]
    OfAnother {
        /// The file.
        path: PathBuf,
        /// Its owner.
        owner: String,
    },
    /// A file of another process does not appear in the folder.
    #[error("{} does not appear in the folder of the first process, and another one has written it; give a folder that all processes share by --output", path.display())]
    NotShared {
        /// The file.
        path: PathBuf,
    },
    /// One of several processes could not write.
    #[error("{message}")]
    OfProcess {
        /// The folder, or the file that one process would write.
        path: PathBuf,
        /// Number of the process and its message.
        message: String,
    },
    /// The encoder refused the data.
    #[error("cannot encode {} as {format}: {message}; please report this with the scene", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// Format that it was to have.
        format: &'static str,
        /// Message of the encoder.
        message: String,
    },
    /// A field has the wrong number of values.
    #[error("the field `{field}` for {} has {found} values where {expected} are needed (entries times components); \
             give one value per component of every point or cell", path.display())]
    FieldLength {
        /// The file.
        path: PathBuf,
        /// The field.
        field: String,
        /// Entries times components.
        expected: usize,
        /// Values given.
        found: usize,
    },
    /// Two fields of one kind (point or cell) have the same name, so that a reader would see one only.
    #[error("two fields for {} are called `{field}`; rename one", path.display())]
    FieldTwice {
        /// The file.
        path: PathBuf,
        /// The name.
        field: String,
    },
    /// A value is NaN or infinite.
    #[error("`{field}` for {} is {value} at entry {entry}; the solution is not usable there: \
             look at the residual, the supports and the material parameters", path.display())]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// The field.
        field: String,
        /// The point, cell or row, from 0.
        entry: usize,
        /// The value.
        value: f64,
    },
    /// The cells do not fit the points.
    #[error("the cells for {} do not fit its points: {message}; build them with `Snapshot::push_cell`", path.display())]
    Cells {
        /// The file.
        path: PathBuf,
        /// The defect.
        message: String,
    },
    /// There is nothing to write.
    #[error("nothing to write into {}: {what}; select at least one", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
        /// The missing items.
        what: &'static str,
    },
    /// A table that a run goes on with has lost rows.
    #[error("{} holds {found} bytes, its checkpoint knows of {expected}; put the file back, or start again without --resume", path.display())]
    Shortened {
        /// The file.
        path: PathBuf,
        /// Bytes at the checkpoint.
        expected: u64,
        /// Bytes found.
        found: u64,
    },
    /// A row of a table has the wrong number of entries.
    #[error("a row of {} has {found} entries where its header has {expected}; give one per column", path.display())]
    RowLength {
        /// The file.
        path: PathBuf,
        /// Columns.
        expected: usize,
        /// Entries given.
        found: usize,
    },
}

impl ObserveError {
    /// The error of a file that the operating system does not write.
    pub(super) fn write(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        move |source| Self::Write {
            path: path.to_path_buf(),
            source,
        }
    }

    /// The file or folder that it is about.
    pub fn path(&self) -> &Path {
        match self {
            Self::Folder { path, .. }
            | Self::Write { path, .. }
            | Self::Claimed { path, .. }
            | Self::OfAnother { path, .. }
            | Self::NotShared { path }
            | Self::OfProcess { path, .. }
            | Self::Encode { path, .. }
            | Self::FieldLength { path, .. }
            | Self::FieldTwice { path, .. }
            | Self::NotFinite { path, .. }
            | Self::Cells { path, .. }
            | Self::Empty { path, .. }
            | Self::Shortened { path, .. }
            | Self::RowLength { path, .. } => path,
        }
    }
}

/// Remedy of the user for an error of the operating system.
fn remedy(error: &std::io::Error) -> &'static str {
    use std::io::ErrorKind;
    match error.kind() {
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "make the folder writable or choose another output folder"
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "free some space, choose an output folder on another disk, or write fewer fields"
        }
        ErrorKind::NotADirectory | ErrorKind::AlreadyExists => {
            "a part of the path is a file: choose another output folder"
        }
        ErrorKind::IsADirectory => "the path is a folder: give the name of a file",
        _ => "check the path or choose another output folder",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_has_a_remedy() {
        let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
        assert!(remedy(&full).contains("free some space"));
    }
}
