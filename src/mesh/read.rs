//! One entry for all mesh files, and the parts common to their readers: from nodes and elements as a file holds them to a [`Mesh`].

use std::path::Path;

use super::raw::{Piece, RawMesh, Source};
use super::{Mesh, MeshError, Order, gmsh, inp, vtk};
use crate::regular_file;

/// Reads a mesh of dimension `D`; the file's extension chooses the reader: `.msh`, `.inp`, `.vtk` or `.vtu`.
///
/// Cells are the elements of dimension `D`. Named groups of them become cell sets, groups of dimension `D − 1` facet sets,
/// and groups of still lower dimension node sets. The cell set `all` is added unless the file has one of that name. Nodes
/// that no cell uses, such as centres of circles, are dropped. Node order is kept otherwise.
///
/// # Errors
/// See [`MeshError`]; each names the file, the place in it, the value and the remedy. The shapes of cells are not
/// looked at here: see [`quality::check`](super::quality::check).
pub fn read<const D: usize>(path: &Path) -> Result<Mesh<D>, MeshError> {
    read_of(path, Order::Kept)
}

/// As [`read`], with the order that cells of second order are to have.
///
/// # Errors
/// As [`read`].
pub fn read_of<const D: usize>(path: &Path, order: Order) -> Result<Mesh<D>, MeshError> {
    let text = load(path)?;
    let (mut raw, source) = parse(path, &text)?;
    raw.set_order(order);
    raw.assemble(&source)
}

/// The largest dimension of any element in the file.
///
/// # Errors
/// As [`read`].
pub fn detect_dimension(path: &Path) -> Result<usize, MeshError> {
    let text = load(path)?;
    let (raw, source) = parse(path, &text)?;
    raw.dimension(&source)
}

/// The content of a file and of those that it includes.
struct Loaded {
    bytes: Vec<u8>,
    pieces: Vec<Piece>,
}

fn extension(path: &Path) -> String {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    extension.to_ascii_lowercase()
}

fn load(path: &Path) -> Result<Loaded, MeshError> {
    if extension(path) == "inp" {
        let (bytes, pieces) = inp::load(path)?;
        return Ok(Loaded { bytes, pieces });
    }
    let bytes = regular_file::read(path).map_err(|source| MeshError::Open {
        path: path.into(),
        source,
    })?;
    let pieces = Vec::new();
    Ok(Loaded { bytes, pieces })
}

fn parse<'a>(path: &Path, text: &'a Loaded) -> Result<(RawMesh, Source<'a>), MeshError> {
    let bytes = &text.bytes;
    match extension(path).as_str() {
        "msh" => gmsh::parse(path, bytes),
        "inp" => inp::parse(path, bytes, &text.pieces),
        "vtk" => vtk::parse(path, bytes, vtk::Flavour::Legacy),
        "vtu" => vtk::parse(path, bytes, vtk::Flavour::Xml),
        _ => Err(MeshError::UnknownExtension { path: path.into() }),
    }
}
