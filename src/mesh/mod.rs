//! Meshes: nodes, cells and named sets. Geometry only; a mesh knows no unknowns and no physics.
//!
//! | file | what |
//! |---|---|
//! | `cell_shape.rs` | the shapes of cells, each with its facets, edges, volume, and names in files |
//! | `generate.rs` | line, rectangle and box with cut-outs and grading |
//! | `read.rs` | one entry for all files |
//! | `raw.rs` | content of a file before it is a mesh |
//! | `mend.rs` | nodes merged, cells split and turned |
//! | `parts.rs` | a mesh in memory, as another program hands it over |
//! | `gmsh.rs`, `gmsh_kinds.rs`, `gmsh_words.rs` | Gmsh MSH 4.1 and 2.2, ASCII and binary |
//! | `inp/` | decks of Abaqus and CalculiX: nodes, elements, sets, surfaces, instances |
//! | `vtk.rs`, `vtk_grid.rs` | VTK files: cells, and groups of them by integers |
//! | `vtu.rs`, `vtk_legacy.rs`, `vtk_legacy/` | their two formats, XML and `.vtk` |
//! | `vtk_structured.rs` | grids of rows, columns and layers: images (`.vti`), rectilinear (`.vtr`) and structured ones (`.vts`) |
//! | `vtu_array.rs`, `vtu_data.rs`, `xml.rs` | arrays, data and tags of the former |
//! | `quality.rs` | checks that refuse a mesh no element can live on |
//! | `boxes.rs` | separate boxes around places |
//! | `facet.rs` | a facet seen from its cell |
//! | `boundary.rs` | boundary and interface facets, distances to them |
//! | `bodies.rs` | nodes that cells hold together |
//! | `twins.rs` | nodes at one place: cracks that the mesher made |
//! | `conformity.rs` | conformity of cells, which have to meet face to face |
//! | `visibility.rs` | bonds that leave the mesh |
//! | `dilate_erode.rs` | sets of cells that grow and shrink |
//! | `embedded.rs` | cut cells and nodes that follow others, around an embedded patch |
//! | `order.rs` | cells of first and second order: corners, mid-side nodes, from the one to the other |
//! | `error.rs` | errors of a mesh or its file |

use std::collections::BTreeMap;

mod bodies;
pub mod boundary;
pub(crate) mod boxes;
mod cell_shape;
mod conformity;
mod dilate_erode;
mod embedded;
pub(crate) use embedded::IN_PLANE;
mod error;
mod facet;
pub mod generate;
pub mod gmsh;
mod gmsh_kinds;
mod inp;
mod mend;
mod order;
mod parts;
pub mod quality;
pub(crate) mod raw;
pub mod read;
mod twins;
pub mod visibility;
pub mod vtk;
pub(crate) mod vtk_grid;
mod vtk_legacy;
mod vtk_structured;
mod vtu;
mod vtu_array;
mod vtu_data;
mod xml;

pub use cell_shape::CellShape;
pub use embedded::{Covered, CutCell, CutFacet, CutRule, Embedded};
pub use error::{MeshError, Place};
pub use order::{Order, Tie, facet_corners};
pub use parts::MeshParts;

use crate::tensor::Vector;

/// A facet of the mesh: its nodes, one in 1D, two in 2D, three or four in 3D; of a cell of second order also those in the middle of its edges, after the corners.
pub type Facet = Vec<u32>;

/// A mesh of `D`-dimensional cells with named sets.
///
/// Shapes: `shapes` and `offsets` describe cell `c` by `connectivity[offsets[c]..offsets[c + 1]]`.
/// Units: whatever the scene uses for length, throughout.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh<const D: usize> {
    /// Node positions.
    pub nodes: Vec<Vector<D>>,
    /// Shape of each cell.
    pub shapes: Vec<CellShape>,
    /// Start of each cell in `connectivity`; one entry more than cells.
    pub offsets: Vec<u32>,
    /// Node numbers of all cells, one after another.
    pub connectivity: Vec<u32>,
    /// Named sets of cells.
    pub cell_sets: BTreeMap<String, Vec<u32>>,
    /// Named sets of facets (points in 1D, edges in 2D, faces in 3D).
    pub facet_sets: BTreeMap<String, Vec<Facet>>,
    /// Named sets of single nodes.
    pub node_sets: BTreeMap<String, Vec<u32>>,
    /// Notes on what the reader of its file left out, a sentence each.
    pub notes: Vec<String>,
    /// Cut cells and nodes that follow others.
    pub embedded: Embedded<D>,
}

impl<const D: usize> Default for Mesh<D> {
    fn default() -> Self {
        Self {
            nodes: Vec::new(),
            shapes: Vec::new(),
            offsets: vec![0],
            connectivity: Vec::new(),
            cell_sets: BTreeMap::new(),
            facet_sets: BTreeMap::new(),
            node_sets: BTreeMap::new(),
            notes: Vec::new(),
            embedded: Embedded::default(),
        }
    }
}

impl<const D: usize> Mesh<D> {
    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.shapes.len()
    }

    /// Node numbers of cell `c`.
    pub fn cell(&self, c: usize) -> &[u32] {
        &self.connectivity[self.offsets[c] as usize..self.offsets[c + 1] as usize]
    }

    /// Appends a cell.
    pub fn push_cell(&mut self, shape: CellShape, nodes: &[u32]) {
        debug_assert_eq!(nodes.len(), shape.node_count());
        self.shapes.push(shape);
        self.connectivity.extend_from_slice(nodes);
        self.offsets.push(self.connectivity.len() as u32);
    }

    /// Mean of the positions of the corners of cell `c`.
    pub fn centroid(&self, c: usize) -> Vector<D> {
        let nodes = self.corners(c);
        nodes
            .iter()
            .map(|&n| self.nodes[n as usize])
            .sum::<Vector<D>>()
            / nodes.len() as f64
    }

    /// Smallest and largest coordinates.
    pub fn bounds(&self) -> (Vector<D>, Vector<D>) {
        let mut lo: Vector<D> = Vector::repeat(f64::INFINITY);
        let mut hi: Vector<D> = Vector::repeat(f64::NEG_INFINITY);
        for x in &self.nodes {
            lo = lo.inf(x);
            hi = hi.sup(x);
        }
        (lo, hi)
    }

    /// Smallest and largest coordinates of some nodes.
    pub fn bounds_of(&self, nodes: &[u32]) -> (Vector<D>, Vector<D>) {
        let mut lo: Vector<D> = Vector::repeat(f64::INFINITY);
        let mut hi: Vector<D> = Vector::repeat(f64::NEG_INFINITY);
        for &n in nodes {
            lo = lo.inf(&self.nodes[n as usize]);
            hi = hi.sup(&self.nodes[n as usize]);
        }
        (lo, hi)
    }

    /// For each node, the cells that it belongs to: offsets and cell numbers.
    pub fn node_cells(&self) -> (Vec<u32>, Vec<u32>) {
        let mut offsets = vec![0u32; self.nodes.len() + 1];
        for &n in &self.connectivity {
            offsets[n as usize + 1] += 1;
        }
        for i in 0..self.nodes.len() {
            offsets[i + 1] += offsets[i];
        }
        let mut next = offsets.clone();
        let mut cells = vec![0u32; self.connectivity.len()];
        for c in 0..self.cell_count() {
            for &n in self.cell(c) {
                cells[next[n as usize] as usize] = c as u32;
                next[n as usize] += 1;
            }
        }
        (offsets, cells)
    }

    /// The nodes of a named set: of a node set, or all nodes of a facet or cell set of that name; sorted, without repeats.
    pub fn nodes_of_set(&self, name: &str) -> Option<Vec<u32>> {
        let mut nodes: Vec<u32> = if let Some(set) = self.node_sets.get(name) {
            set.clone()
        } else if let Some(set) = self.facet_sets.get(name) {
            set.iter().flatten().copied().collect()
        } else if let Some(set) = self.cell_sets.get(name) {
            set.iter()
                .flat_map(|&c| self.cell(c as usize).iter().copied())
                .collect()
        } else {
            return None;
        };
        nodes.sort_unstable();
        nodes.dedup();
        Some(nodes)
    }

    /// Removes nodes that no cell uses (and what node and facet sets say of them); the others keep their order.
    pub fn drop_unused_nodes(&mut self) {
        const UNUSED: u32 = u32::MAX;
        let mut new_number = vec![UNUSED; self.nodes.len()];
        for &n in &self.connectivity {
            new_number[n as usize] = 0;
        }
        let mut kept = Vec::with_capacity(self.nodes.len());
        for (number, x) in new_number.iter_mut().zip(&self.nodes) {
            if *number != UNUSED {
                *number = kept.len() as u32;
                kept.push(*x);
            }
        }
        self.nodes = kept;
        for n in &mut self.connectivity {
            *n = new_number[*n as usize];
        }
        for facet in self.facet_sets.values_mut().flatten() {
            for n in facet {
                *n = new_number[*n as usize];
            }
        }
        for set in self.facet_sets.values_mut() {
            set.retain(|facet| !facet.contains(&UNUSED));
        }
        for set in self.node_sets.values_mut() {
            *set = set
                .iter()
                .map(|&n| new_number[n as usize])
                .filter(|&n| n != UNUSED)
                .collect();
        }
    }

    /// The names of all sets, for messages.
    pub fn set_names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self
            .cell_sets
            .keys()
            .chain(self.facet_sets.keys())
            .chain(self.node_sets.keys())
            .map(String::as_str)
            .collect();
        names.sort_unstable();
        names.dedup();
        names
    }
}
