//! Cost of the outputs of a run, from a part of them written into a folder of its own.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use crate::coupling::Operator;
use crate::model::Model;
use crate::observe::ObserveError;
use crate::observe::summary::Sizes;
use crate::observe::vtu::{Compression, write_vtu};
use crate::run::bonds;
use crate::run::setup::RunSettings;
use crate::run::solution::{Moved, Solved, zone_of_site};
use crate::run::write::{Shown, snapshot, write};
use crate::scene::Output;
use crate::scene::spec::PointOutputSpec;

/// Cells and points of a trial file at most.
const SHOWN: usize = 50_000;

/// Bytes per cell and point of the output while it is encoded: fields, their copy for the encoder, its text.
const OUTPUT_BYTES: u64 = 900;

/// Bytes per further corner of a point that is shown as a cell: its position and fields, their copy, its text.
const CORNER_BYTES: u64 = 250;

/// Bytes of the output while it is encoded.
pub(crate) fn output_bytes<const D: usize>(
    model: &Model<D>,
    sizes: &Sizes,
    output: &Output<D>,
) -> u64 {
    let corners = match output.points {
        PointOutputSpec::Vertices => 0,
        PointOutputSpec::Cells => ((1 << D) - 1) * sizes.points as u64,
    };
    let of_body = OUTPUT_BYTES * (sizes.cells + sizes.points) as u64 + CORNER_BYTES * corners;
    of_body.max(bonds::bytes(model, output))
}

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

/// Seconds of one VTU file of a run, none without VTU, and of the tables of a run at rest; files are written where the run would, with displacements that no compression finds easy.
///
/// # Errors
/// [`ObserveError`] if nothing can be written, as a run would.
pub(crate) fn output_seconds<const D: usize>(
    model: &Model<D>,
    operator: &Operator<'_, D>,
    rest: &RunSettings<D>,
    moves: bool,
) -> Result<[f64; 2], ObserveError> {
    let made_up = |k: usize| 1e-3 * (1.7 * k as f64 + 0.3 * (k as f64).sqrt()).sin();
    let u: Vec<f64> = (0..model.sites.len() * D).map(made_up).collect();
    let solved = Solved {
        model,
        operator,
        displacement: &u,
        residual: if moves { &[] } else { &u },
        zone_of_site: &zone_of_site(model),
        system: None,
        moved: Moved {
            velocity: moves.then_some(&u),
            ..Moved::default()
        },
        sections: &[],
        stresses: (&rest.stresses, 0.0),
    };
    let mut file = 0.0;
    if rest.output.vtu {
        let every = (model.mesh.cell_count() + model.sites.len())
            .div_ceil(SHOWN)
            .max(1);
        let begun = Instant::now();
        let shown = snapshot(&solved, &[], &rest.output, Shown::Every(every));
        write_vtu(
            &rest.output.directory.join("trial.vtu"),
            &shown,
            Compression::default(),
        )?;
        file = every as f64 * begun.elapsed().as_secs_f64();
    }
    if moves {
        return Ok([file, 0.0]);
    }
    let tables = Output {
        vtu: false,
        ..rest.output.clone()
    };
    let begun = Instant::now();
    write(&tables, &solved)?;
    Ok([file, begun.elapsed().as_secs_f64()])
}

#[cfg(test)]
mod tests {
    use super::*;

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
