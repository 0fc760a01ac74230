//! One entry for all mesh files, and what their readers share: from nodes and elements as a file holds them to a [`Mesh`].

use std::path::Path;

use super::raw::{RawMesh, Source};
use super::{Mesh, MeshError, gmsh, vtk};
use crate::regular_file;

/// Reads a mesh of dimension `D`; the file's extension chooses the reader: `.msh`, `.vtk` or `.vtu`.
///
/// Cells are the elements of dimension `D`. Named groups of them become cell sets, groups of dimension `D − 1` facet sets,
/// and groups of still lower dimension node sets. The cell set `all` is added unless the file has one of that name. Nodes
/// that no cell uses, such as centres of circles, are dropped. Node order is kept otherwise.
///
/// # Errors
/// See [`MeshError`]; each names the file, the place in it, the value and the remedy. The shapes of cells are not
/// looked at here: see [`quality::check`](super::quality::check).
pub fn read<const D: usize>(path: &Path) -> Result<Mesh<D>, MeshError> {
    let bytes = load(path)?;
    let (raw, source) = parse(path, &bytes)?;
    raw.assemble(&source)
}

/// The largest dimension of any element in the file.
///
/// # Errors
/// As [`read`].
pub fn detect_dimension(path: &Path) -> Result<usize, MeshError> {
    let bytes = load(path)?;
    let (raw, source) = parse(path, &bytes)?;
    raw.dimension(&source)
}

fn load(path: &Path) -> Result<Vec<u8>, MeshError> {
    regular_file::read(path).map_err(|source| MeshError::Open {
        path: path.into(),
        source,
    })
}

fn parse<'a>(path: &Path, bytes: &'a [u8]) -> Result<(RawMesh, Source<'a>), MeshError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    match extension.to_ascii_lowercase().as_str() {
        "msh" => gmsh::parse(path, bytes),
        "vtk" => vtk::parse(path, bytes, vtk::Flavour::Legacy),
        "vtu" => vtk::parse(path, bytes, vtk::Flavour::Xml),
        _ => Err(MeshError::UnknownExtension { path: path.into() }),
    }
}
