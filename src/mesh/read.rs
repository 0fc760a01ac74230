//! One entry for all mesh files, and the parts common to their readers: from nodes and elements as a file holds them to a [`Mesh`].

use std::path::Path;

pub use super::mend::Options;
use super::raw::{Piece, RawMesh, Source, bytes_of};
pub(crate) use super::vtk_grid::Points;
use super::{Mesh, MeshError, gmsh, inp, mend, vtk};

/// Reads a mesh of dimension `D`; the file's extension chooses the reader: `.msh`, `.inp`, `.vtk`, `.vtu`, `.vts`, `.vtr` or `.vti`.
///
/// Cells are the elements of dimension `D`. Named groups of them become cell sets, groups of dimension `D − 1` facet sets,
/// and groups of still lower dimension node sets. The cell set `all` is added unless the file has one of that name. Nodes
/// that no cell uses, such as centres of circles, are dropped. Node order is kept otherwise.
///
/// # Errors
/// See [`MeshError`]; each names the file, the place in it, the value and the remedy. The shapes of cells are not
/// looked at here: see [`quality::check`](super::quality::check).
pub fn read<const D: usize>(path: &Path) -> Result<Mesh<D>, MeshError> {
    read_with(path, &Options::default())
}

/// As [`read`], with options.
///
/// # Errors
/// As [`read`].
pub fn read_with<const D: usize>(path: &Path, options: &Options) -> Result<Mesh<D>, MeshError> {
    let text = load(path)?;
    let (mut raw, source) = parse(path, &text, options)?;
    mend::prepare(&mut raw, &source, options)?;
    Ok(made(&raw, &source, options)?.0)
}

/// The mesh, and its cells by their numbers among those of the file.
fn made<const D: usize>(
    raw: &RawMesh,
    source: &Source,
    options: &Options,
) -> Result<(Mesh<D>, Vec<u32>), MeshError> {
    let mut mesh = raw.assemble(source)?;
    mend::turn(&mut mesh, |cell| raw.number_in_file(raw.cell_tag(D, cell)));
    let is_type = |word: &&String| {
        !raw.left_out
            .iter()
            .any(|own| word.eq_ignore_ascii_case(own))
    };
    let sets: Vec<&String> = options.ignore.iter().filter(is_type).collect();
    let kept = mend::leave_out(&mut mesh, &sets, source)?;
    Ok((mesh, kept))
}

/// The numbers that a file gives to some cells and nodes of its mesh, as [`read_with`] counts them, from 0; of a deck with several instances
/// `INSTANCE.NUMBER`.
///
/// # Errors
/// As [`read`].
pub fn numbers_in_file<const D: usize>(
    path: &Path,
    options: &Options,
    (cells, nodes): (&[u32], &[u32]),
) -> Result<[Vec<String>; 2], MeshError> {
    let text = load(path)?;
    let (mut raw, source) = parse(path, &text, options)?;
    mend::prepare(&mut raw, &source, options)?;
    let (_, kept) = made::<D>(&raw, &source, options)?;
    let cells = cells
        .iter()
        .map(|&c| raw.cell_tag(D, kept[c as usize] as usize));
    // where cells are left out, nodes may be
    let of_nodes = match kept.iter().zip(0..).all(|(own, c)| *own == c) {
        true => raw.tags_of_nodes(D),
        false => Vec::new(),
    };
    let nodes = nodes
        .iter()
        .filter_map(|&n| of_nodes.get(n as usize).copied());
    let number = |tag| raw.number_in_file(tag);
    Ok([cells.map(number).collect(), nodes.map(number).collect()])
}

/// The largest dimension of any element in the file.
///
/// # Errors
/// As [`read`].
pub fn detect_dimension(path: &Path) -> Result<usize, MeshError> {
    let text = load(path)?;
    let options = Options::default();
    let (mut raw, source) = parse(path, &text, &options)?;
    mend::prepare(&mut raw, &source, &options)?;
    raw.dimension(&source)
}

/// Reads the coordinates of all points of a VTK file, `.vtk` or `.vtu`, and the numbers that its point array `name` has for them.
///
/// # Errors
/// As [`read`]; [`MeshError::Syntax`] for an array that is missing or has several numbers per point.
pub(crate) fn points(path: &Path, name: &str) -> Result<Points, MeshError> {
    let bytes = bytes_of(path)?;
    let flavour = match extension(path).as_str() {
        "vtk" => vtk::Flavour::Legacy,
        _ => vtk::Flavour::Xml,
    };
    vtk::points(path, &bytes, flavour, name)
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
    let bytes = bytes_of(path)?;
    let pieces = Vec::new();
    Ok(Loaded { bytes, pieces })
}

fn parse<'a>(
    path: &Path,
    text: &'a Loaded,
    options: &Options,
) -> Result<(RawMesh, Source<'a>), MeshError> {
    let bytes = &text.bytes;
    match extension(path).as_str() {
        "msh" => gmsh::parse(path, bytes, options.order),
        "inp" => inp::parse(path, (bytes, &text.pieces), &options.ignore),
        "vtk" => vtk::parse(path, bytes, vtk::Flavour::Legacy),
        "vtu" | "vti" | "vts" | "vtr" => vtk::parse(path, bytes, vtk::Flavour::Xml),
        _ => Err(MeshError::UnknownExtension { path: path.into() }),
    }
}
