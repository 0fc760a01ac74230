//! VTK files: XML unstructured grids (`.vtu`) and legacy ones (`.vtk`), as meshio and VTK itself write them.
//!
//! VTK has no named groups. An integer value per cell becomes a set `NAME_VALUE` for each of its values: meshio's
//! `gmsh:physical` becomes `physical_1`, `physical_2`, … (its value 0 means "no group" and makes no set), and VTK's
//! `CellEntityIds` becomes `CellEntityIds_1`, …. Characters of `NAME` other than letters, digits and `-` become `_`.
//! The dimension of a cell decides whether it enters a cell, facet or node set, as in Gmsh files. Arrays of reals, of
//! several components, or with more than 256 values per dimension are fields or numberings, not groups, and are skipped.

use std::collections::{BTreeSet, HashMap};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use vtkio::Vtk;
use vtkio::model::{
    Attribute, CellType, DataSet, IOBuffer, Piece, UnstructuredGridPiece, VertexNumbers,
};

use super::read::{Encoding, RawElement, RawMesh, RawNode, Source};
use super::{CellShape, MeshError, Place};

/// More different values than this make an integer array a numbering, not a grouping.
const MOST_GROUPS: usize = 256;

/// The two families of VTK files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Flavour {
    /// `.vtk`
    Legacy,
    /// `.vtu`
    Xml,
}

/// Our shape for VTK's, or a remedy.
fn shape(kind: CellType) -> Result<CellShape, &'static str> {
    match kind {
        CellType::Vertex => Ok(CellShape::Vertex),
        CellType::Line => Ok(CellShape::Line2),
        CellType::Triangle => Ok(CellShape::Tri3),
        CellType::Quad => Ok(CellShape::Quad4),
        CellType::Tetra => Ok(CellShape::Tet4),
        CellType::Hexahedron => Ok(CellShape::Hex8),
        _ => Err(
            "supported are Vertex, Line, Triangle, Quad, Tetra and Hexahedron of first order: convert the mesh",
        ),
    }
}

/// Parses a file.
pub(super) fn parse<'a>(
    path: &Path,
    bytes: &'a [u8],
    flavour: Flavour,
) -> Result<(RawMesh, Source<'a>), MeshError> {
    let source = Source {
        path: path.into(),
        bytes,
        encoding: Encoding::Opaque,
    };
    let syntax = |found: String, wanted: &str| MeshError::Syntax {
        path: path.into(),
        place: Place::File,
        found,
        wanted: wanted.into(),
        remedy: "it may be truncated: write it again, for instance with meshio",
    };
    // the parser beneath unwraps in places; no file may end the run
    let parsed = catch_unwind(AssertUnwindSafe(|| match flavour {
        Flavour::Legacy => Vtk::parse_legacy_be(bytes),
        Flavour::Xml => Vtk::parse_xml(bytes),
    }))
    .map_err(|_| syntax("a broken structure".into(), "a VTK unstructured grid"))?
    .map_err(|e| syntax(format!("\"{e}\""), "a VTK unstructured grid"))?;
    let DataSet::UnstructuredGrid { pieces, .. } = parsed.data else {
        return Err(MeshError::Unsupported {
            path: path.into(),
            place: Place::File,
            what: "a VTK data set other than an unstructured grid".into(),
            remedy: "convert it to an unstructured grid",
        });
    };
    let mut raw = RawMesh::default();
    for piece in pieces {
        match piece {
            Piece::Inline(piece) => add_piece(&mut raw, &piece, &source)
                .map_err(|e| e.unwrap_or_else(|found| syntax(found, "one entry per cell")))?,
            Piece::Source(..) | Piece::Loaded(_) => {
                return Err(MeshError::Unsupported {
                    path: path.into(),
                    place: Place::File,
                    what: "a grid spread over several files".into(),
                    remedy: "merge its pieces into one .vtu file",
                });
            }
        }
    }
    Ok((raw, source))
}

/// What is wrong with a piece: an error, or what was found where an entry per cell should be.
type PieceError = Result<MeshError, String>;

fn add_piece(
    raw: &mut RawMesh,
    piece: &UnstructuredGridPiece,
    source: &Source,
) -> Result<(), PieceError> {
    let first_node = raw.nodes.len() as u64;
    let points: Vec<f64> = piece
        .points
        .cast_into()
        .ok_or_else(|| Err("points that are no numbers".to_owned()))?;
    if !points.len().is_multiple_of(3) {
        return Err(Err(format!(
            "{} coordinates, not three per point",
            points.len()
        )));
    }
    for x in points.chunks_exact(3) {
        raw.nodes.push(RawNode {
            tag: raw.nodes.len() as u64,
            x: [x[0], x[1], x[2]],
            at: 0,
        });
    }
    let types = &piece.cells.types;
    let starts = cell_ranges(&piece.cells.cell_verts, types.len()).map_err(Err)?;
    let mut shapes = Vec::with_capacity(types.len());
    for (c, (&kind, nodes)) in types.iter().zip(&starts).enumerate() {
        let element = raw.elements.len() as u64 + c as u64;
        let shape = shape(kind).map_err(|remedy| {
            Ok(MeshError::UnsupportedElement {
                path: source.path.clone(),
                place: Place::File,
                element,
                kind: kind as i64,
                name: "by VTK's numbering",
                remedy,
            })
        })?;
        if nodes.len() != shape.node_count() {
            return Err(Err(format!(
                "cell {element} ({shape:?}) with {} nodes",
                nodes.len()
            )));
        }
        shapes.push(shape);
    }
    let groups = group_numbers(raw, &piece.data.cell, &shapes);
    for ((shape, nodes), group) in shapes.into_iter().zip(&starts).zip(groups) {
        raw.elements.push(RawElement {
            tag: raw.elements.len() as u64,
            shape,
            start: raw.element_nodes.len(),
            group,
            at: 0,
        });
        raw.element_nodes
            .extend(nodes.iter().map(|n| n + first_node));
    }
    Ok(())
}

/// The nodes of each cell.
fn cell_ranges(numbers: &VertexNumbers, cells: usize) -> Result<Vec<Vec<u64>>, String> {
    let found = match numbers {
        VertexNumbers::Legacy { vertices, .. } => {
            let mut found = Vec::with_capacity(cells);
            let mut rest = vertices.as_slice();
            while let [count, tail @ ..] = rest {
                let count = *count as usize;
                if count > tail.len() {
                    return Err("a list of cells that ends early".into());
                }
                found.push(tail[..count].iter().map(|&n| u64::from(n)).collect());
                rest = &tail[count..];
            }
            found
        }
        VertexNumbers::XML {
            connectivity,
            offsets,
        } => {
            // files of version 5 and later start with a zero
            let ends = if offsets.len() == cells + 1 {
                &offsets[1..]
            } else {
                offsets
            };
            let mut start = 0;
            let mut found = Vec::with_capacity(cells);
            for &end in ends {
                let nodes = connectivity.get(start..end as usize).ok_or_else(|| {
                    format!("offset {end} into {} node numbers", connectivity.len())
                })?;
                found.push(nodes.to_vec());
                start = end as usize;
            }
            found
        }
    };
    if found.len() == cells {
        return Ok(found);
    }
    Err(format!("{} cells with {cells} types", found.len()))
}

/// An integer array as numbers, if it is one.
fn integers(data: &IOBuffer) -> Option<Vec<i64>> {
    match data {
        IOBuffer::F32(_) | IOBuffer::F64(_) | IOBuffer::Bit(_) => None,
        _ => data.cast_into(),
    }
}

/// For each cell the number of its list of groups.
fn group_numbers(raw: &mut RawMesh, attributes: &[Attribute], shapes: &[CellShape]) -> Vec<u32> {
    let mut names: Vec<Vec<String>> = vec![Vec::new(); shapes.len()];
    let mut add = |name: &str, data: &IOBuffer| {
        let Some(values) = integers(data).filter(|v| v.len() == shapes.len()) else {
            return;
        };
        let distinct: BTreeSet<(usize, i64)> = shapes
            .iter()
            .zip(&values)
            .map(|(s, v)| (s.dimension(), *v))
            .collect();
        let many = (0..4).any(|d| {
            distinct
                .iter()
                .filter(|(dimension, _)| *dimension == d)
                .count()
                > MOST_GROUPS
        });
        if many {
            return;
        }
        let physical = name == "gmsh:physical";
        let stem: String = match physical {
            true => "physical".into(),
            false => name
                .chars()
                .map(|c| {
                    if c.is_ascii_alphanumeric() || c == '-' {
                        c
                    } else {
                        '_'
                    }
                })
                .collect(),
        };
        for (names, value) in names.iter_mut().zip(values) {
            if !(physical && value == 0) {
                names.push(format!("{stem}_{value}"));
            }
        }
    };
    for attribute in attributes {
        match attribute {
            Attribute::DataArray(array) => add(&array.name, &array.data),
            Attribute::Field { data_array, .. } => {
                data_array
                    .iter()
                    .for_each(|array| add(&array.name, &array.data));
            }
        }
    }
    let mut known: HashMap<Vec<String>, u32> = HashMap::from([(Vec::new(), 0)]);
    names
        .into_iter()
        .map(|names| {
            *known.entry(names).or_insert_with_key(|names| {
                raw.groups.push(names.clone());
                raw.groups.len() as u32 - 1
            })
        })
        .collect()
}

#[cfg(test)]
#[path = "vtk_tests.rs"]
mod tests;
