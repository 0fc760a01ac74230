//! VTK files: XML grids and images (`.vtu`, `.vts`, `.vtr`, `.vti`, read in `vtu.rs`) and legacy grids (`.vtk`, read in `vtk_legacy.rs`), as meshio and VTK itself write them.
//!
//! VTK has no named groups. An integer value per cell becomes a set `NAME_VALUE` for each of its values: meshio's
//! `gmsh:physical` becomes `physical_1`, `physical_2`, … (its value 0 means "no group" and makes no set), and VTK's
//! `CellEntityIds` becomes `CellEntityIds_1`, …. Characters of `NAME` other than letters, digits and `-` become `_`.
//! The dimension of a cell decides whether it enters a cell, facet or node set, as in Gmsh files. Arrays of reals, of
//! several components, or with more than 256 values per dimension are fields or numberings, not groups, and are skipped.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use super::vtk_grid::{Grid, Points};
use super::vtk_structured::{PIXEL, VOXEL};
use super::{CellShape, MeshError, vtk_legacy, vtu};
use crate::mesh::raw::{OtherShape, RawMesh, RawNode, RawShape, Source};

/// More different values than this make an integer array a numbering, not a grouping.
const MOST_GROUPS: usize = 256;

/// The two families of VTK files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Flavour {
    /// `.vtk`
    Legacy,
    /// `.vtu`, `.vts`, `.vtr` or `.vti`
    Xml,
}

/// Parses a file.
pub(super) fn parse<'a>(
    path: &Path,
    bytes: &'a [u8],
    flavour: Flavour,
) -> Result<(RawMesh, Source<'a>), MeshError> {
    let (grids, source) = match flavour {
        Flavour::Legacy => {
            let (grid, source) = vtk_legacy::parse(path, bytes)?;
            (vec![grid], source)
        }
        Flavour::Xml => vtu::parse(path, bytes)?,
    };
    let mut raw = RawMesh::default();
    let mut first = (0, 0);
    for grid in &grids {
        add_piece(&mut raw, grid, first, &source)?;
        first.0 = u64::saturating_add(first.0, grid.points);
        first.1 += grid.types.len() as u64;
    }
    Ok((raw, source))
}

/// The points of a file, each with its number in a point array.
pub(super) fn points(
    path: &Path,
    bytes: &[u8],
    flavour: Flavour,
    name: &str,
) -> Result<Points, MeshError> {
    match flavour {
        Flavour::Legacy => vtk_legacy::points(path, bytes, name),
        Flavour::Xml => vtu::points(path, bytes, name),
    }
}

/// Adds a piece, whose nodes and cells have numbers from the first on.
fn add_piece(
    raw: &mut RawMesh,
    grid: &Grid,
    (first_node, first): (u64, u64),
    source: &Source,
) -> Result<(), MeshError> {
    for (point, &x) in grid.used.iter().zip(&grid.coordinates) {
        raw.nodes.push(RawNode {
            tag: point.saturating_add(first_node),
            x,
            at: grid.at,
        });
    }
    let mut shapes = Vec::with_capacity(grid.types.len());
    let mut start = 0;
    for (c, (&kind, &end)) in grid.types.iter().zip(&grid.ends).enumerate() {
        let element = first + c as u64;
        let Some(shape) = shape(kind) else {
            return Err(MeshError::UnsupportedElement {
                path: source.path.clone(),
                place: source.place(grid.at),
                element,
                kind: kind.to_string(),
                name: "by VTK's numbering",
                remedy: "supported are Vertex, Line, Triangle, Pixel, Quad, Tetra, Voxel, Hexahedron, Wedge and Pyramid, and quadratic cells without nodes inside of faces: convert the mesh",
            });
        };
        if end - start != shape.node_count() as u64 {
            return Err(MeshError::Syntax {
                path: source.path.clone(),
                place: source.place(grid.at),
                found: format!("cell {element} ({shape:?}) with {} nodes", end - start),
                wanted: format!("{}", shape.node_count()),
                remedy: "write the file again, for instance with VTK, ParaView or meshio",
            });
        }
        start = end;
        shapes.push(shape);
    }
    let is_ghost = ghosts(&grid.cell_data, &shapes);
    let ghosts = is_ghost.iter().filter(|is| **is).count();
    if ghosts > 0 {
        raw.notes.push(format!(
            "{}: {ghosts} of {} cells, which {GHOSTS} marks as hidden or as those of another piece, are left out",
            source.path.display(),
            shapes.len()
        ));
    }
    let groups = group_numbers(raw, &grid.cell_data, &shapes);
    let mut start = 0;
    let cells = shapes.into_iter().zip(&grid.ends).zip(groups);
    let cells = cells.zip(&grid.types).zip(is_ghost);
    for (tag, ((((shape, &end), group), &kind), is_ghost)) in (first..).zip(cells) {
        if is_ghost {
            start = end as usize;
            continue;
        }
        let mut nodes: Vec<u64> = (grid.nodes[start..end as usize].iter())
            .map(|n| n.saturating_add(first_node))
            .collect();
        // along the axes, one after another, instead of around
        let swapped: &[usize] = match kind {
            PIXEL => &[2],
            VOXEL => &[2, 6],
            _ => &[],
        };
        swapped.iter().for_each(|&k| nodes.swap(k, k + 1));
        raw.push((tag, group, grid.at), shape, &nodes);
        start = end as usize;
    }
    Ok(())
}

/// The shape to which VTK gives a number.
fn shape(kind: u8) -> Option<RawShape> {
    match kind {
        PIXEL => Some(RawShape::Cell(CellShape::Quad4)),
        VOXEL => Some(RawShape::Cell(CellShape::Hex8)),
        13 => Some(RawShape::Other(OtherShape::Prism)),
        14 => Some(RawShape::Other(OtherShape::Pyramid)),
        _ => CellShape::of_vtk(kind).map(RawShape::Cell),
    }
}

/// VTK's array of marks of cells that are hidden, or belong to another piece of a grid; 0 for all others.
const GHOSTS: &str = "vtkGhostType";

/// True for each cell that is no part of the grid.
fn ghosts(data: &[(String, Vec<i64>)], shapes: &[RawShape]) -> Vec<bool> {
    let is_its =
        |(name, marks): &&(String, Vec<i64>)| name == GHOSTS && marks.len() == shapes.len();
    match data.iter().find(is_its) {
        Some((_, marks)) => marks.iter().map(|mark| *mark != 0).collect(),
        None => vec![false; shapes.len()],
    }
}

/// For each cell the number of its list of groups.
fn group_numbers(raw: &mut RawMesh, data: &[(String, Vec<i64>)], shapes: &[RawShape]) -> Vec<u32> {
    let mut names: Vec<Vec<String>> = vec![Vec::new(); shapes.len()];
    let mut add = |name: &str, values: &[i64]| {
        if values.len() != shapes.len() {
            return;
        }
        let distinct: BTreeSet<(usize, i64)> = shapes
            .iter()
            .zip(values)
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
            if !(physical && *value == 0) {
                names.push(format!("{stem}_{value}"));
            }
        }
    };
    for (name, values) in data.iter().filter(|(name, _)| name != GHOSTS) {
        add(name, values);
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
