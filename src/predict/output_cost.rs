//! Cost of the outputs of a run, from a part of them written into a folder of its own.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use crate::observe::ObserveError;
use crate::observe::vtu::{Compression, Snapshot, write_vtu};
use crate::run::solution::Solved;
use crate::run::write::{Shown, snapshot, write};
use crate::scene::Output;

/// Cells and points of the larger of two trial files, at least.
const SHOWN: usize = 1500;

/// The same of the smaller one, which gives the cost of a file however little it holds.
const FEW: usize = 150;

/// Of all files of a run together, the larger trial file may be this share.
const SHARE: f64 = 0.05;

/// Folders so far, so that each has a name of its own.
static FOLDERS: AtomicUsize = AtomicUsize::new(0);

/// A folder that goes when it is dropped.
pub struct TrialFolder(PathBuf);

impl TrialFolder {
    /// A folder beside the results, so that it lies on the same disk, or among temporary files where there is none yet.
    pub fn new(directory: &Path) -> Self {
        let parent = if directory.is_dir() {
            directory.to_path_buf()
        } else {
            std::env::temp_dir()
        };
        let number = FOLDERS.fetch_add(1, Ordering::Relaxed);
        Self(parent.join(format!(".bondline-check-{}-{number}", std::process::id())))
    }

    /// Path of the folder; whoever writes makes it.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for TrialFolder {
    fn drop(&mut self) {
        // nothing depends on its being gone
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A displacement that no compression finds easy.
pub(crate) fn made_up(dofs: usize) -> Vec<f64> {
    (0..dofs)
        .map(|k| 1e-3 * (1.7 * k as f64 + 0.3 * (k as f64).sqrt()).sin())
        .collect()
}

/// Seconds of one VTU file of a run that writes `files` by `write`, from two files of a part of its cells and points.
///
/// # Errors
/// [`ObserveError`] if nothing can be written, as a run would.
pub(crate) fn file_seconds<const D: usize>(
    solved: &Solved<'_, D>,
    output: &Output<D>,
    files: f64,
    mut write: impl FnMut(Snapshot) -> Result<(), ObserveError>,
) -> Result<f64, ObserveError> {
    let all = (solved.model.mesh.cell_count() + solved.model.sites.len()) as f64;
    let mut trial = |wanted: f64| -> Result<(f64, f64), ObserveError> {
        let every = (all / wanted).floor().max(1.0);
        let begun = Instant::now();
        write(snapshot(solved, &[], output, Shown::Every(every as usize)))?;
        Ok((all / every, begun.elapsed().as_secs_f64()))
    };
    // the first of all makes the folder
    trial(FEW as f64)?;
    let few = trial(FEW as f64)?;
    let many = trial((SHARE * files * all).max(SHOWN as f64))?;
    Ok(line_through(few, many, all))
}

/// The value at `x` of the line through two points of ascending abscissa, which neither falls nor begins below zero.
fn line_through(few: (f64, f64), many: (f64, f64), x: f64) -> f64 {
    let slope = ((many.1 - few.1) / (many.0 - few.0)).max(0.0);
    if !slope.is_finite() {
        return many.1;
    }
    (many.1 + slope * (x - many.0)).min(many.1 * x / many.0)
}

/// Seconds of all outputs of a scene at rest.
///
/// # Errors
/// [`ObserveError`] if nothing can be written, as a run would.
pub(crate) fn output_seconds<const D: usize>(
    output: &Output<D>,
    solved: &Solved<'_, D>,
) -> Result<f64, ObserveError> {
    let folder = TrialFolder::new(&output.directory);
    let mut seconds = 0.0;
    if output.vtu {
        let path = folder.path().join("trial.vtu");
        seconds += file_seconds(solved, output, 1.0, |s| {
            write_vtu(&path, &s, Compression::default())
        })?;
    }
    let tables = Output {
        directory: folder.path().to_path_buf(),
        vtu: false,
        ..output.clone()
    };
    let begun = Instant::now();
    write(&tables, solved)?;
    Ok(seconds + begun.elapsed().as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_costs_something_and_so_much_per_cell() {
        // 2 ms, and 0.1 ms per cell
        let t = |n: f64| (n, 2.0 + 0.1 * n);
        assert!((line_through(t(10.0), t(100.0), 1000.0) - 102.0).abs() < 1e-12);
        // a disturbed clock: not below what was measured, not above proportion
        assert_eq!(line_through((10.0, 9.0), (100.0, 5.0), 1000.0), 5.0);
        assert_eq!(line_through((50.0, 5.0), (50.0, 6.0), 50.0), 6.0);
    }

    #[test]
    fn a_trial_folder_goes() {
        let parent = tempfile::tempdir().unwrap();
        let folder = TrialFolder::new(parent.path());
        let path = folder.path().to_path_buf();
        assert!(path.starts_with(parent.path()));
        std::fs::create_dir_all(&path).unwrap();
        drop(folder);
        assert!(!path.exists());
    }
}
