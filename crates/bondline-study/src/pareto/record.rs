//! Records of a study, line by line, so that it can go on.

use std::io::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Cost;
use crate::pareto::parameters::{Case, TradeError};
use crate::variants::{Measured, Quantity};
use bondline::observe::checkpoint::Fingerprint;
use bondline::regular_file;
use bondline::scene::spec::{MeshSpec, PointsSpec};
use bondline::scene::{SceneSpec, Source};

/// The first line of a record: what its errors belong to.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Head {
    /// The program that ran its cases.
    pub program: String,
    pub scene: String,
    /// The mesh file of the reference, see [`mesh`].
    pub mesh: Option<u64>,
    pub overrides: Vec<String>,
    pub reference: Vec<String>,
    /// The text of another scene that is the reference.
    pub other: Option<String>,
    pub quantities: Vec<Quantity>,
    pub cost: Cost,
}

/// The program, by its version and its bytes: another build may find other results.
pub(super) fn program(path: &Path) -> Result<String, TradeError> {
    let bytes = regular_file::read(path).map_err(|source| TradeError::Program {
        path: path.to_path_buf(),
        source,
    })?;
    let sum = crc32fast::hash(&bytes);
    Ok(format!("{} {sum:08x}", env!("CARGO_PKG_VERSION")))
}

/// A number for the bytes of the file of a mesh or of points that a scene reads with these overrides; none where it makes its mesh itself, or would be refused.
///
/// Shapes: `scene` lies in `folder`, from which the path of the mesh counts.
pub(super) fn mesh(scene: &Source, folder: &Path, overrides: &[String]) -> Option<u64> {
    let mut source = scene.clone();
    for o in overrides {
        source.push_override(o).ok()?;
    }
    let spec = SceneSpec::parse(&source).ok()?;
    let points = spec.peridynamics.as_ref().and_then(|p| p.points.as_ref());
    let path = match (&spec.mesh, points) {
        (Some(MeshSpec::File(file)), _) => &file.path,
        (None, Some(PointsSpec::File(file))) => &file.path,
        _ => return None,
    };
    let bytes = regular_file::read(&folder.join(&path.value)).ok()?;
    let mut print = Fingerprint::default();
    print.add(&bytes);
    Some(print.value())
}

/// Reads the outputs of the reference from its folder.
pub(super) fn kept(folder: &Path, probes: &[String]) -> Result<Measured, TradeError> {
    let path = folder.join("summary.json");
    let file_error = |source| TradeError::File {
        path: path.clone(),
        source,
    };
    let text = regular_file::read_to_string(&path).map_err(file_error)?;
    let summary = serde_json::from_str(&text).map_err(|e| TradeError::Summary {
        why: e.to_string(),
        text,
    })?;
    Measured::read(folder, &summary, probes).map_err(file_error)
}

/// The record of a study, if there is one; a last line that was cut off is left out.
pub(super) fn read_record(path: &Path) -> Result<Option<(Head, Vec<Case>)>, TradeError> {
    let text = match regular_file::read_to_string(path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(source) => {
            return Err(TradeError::File {
                path: path.to_path_buf(),
                source,
            });
        }
        Ok(text) => text,
    };
    let mut lines = text.lines();
    let Some(head) = lines.next().and_then(|l| serde_json::from_str(l).ok()) else {
        return Err(TradeError::Another {
            path: path.to_path_buf(),
        });
    };
    let cases = lines.map_while(|l| serde_json::from_str(l).ok()).collect();
    Ok(Some((head, cases)))
}

pub(super) fn new_record(
    path: &Path,
    head: &Head,
    cases: &[Case],
) -> std::io::Result<std::fs::File> {
    let part = path.with_extension("part");
    let mut file = std::fs::File::create(&part)?;
    write_line(&mut file, head)?;
    for case in cases {
        write_line(&mut file, case)?;
    }
    std::fs::rename(&part, path)?;
    Ok(file)
}

pub(super) fn write_line(file: &mut std::fs::File, value: &impl Serialize) -> std::io::Result<()> {
    let mut line = serde_json::to_string(value).map_err(std::io::Error::other)?;
    line.push('\n');
    file.write_all(line.as_bytes())?;
    file.sync_data()
}
