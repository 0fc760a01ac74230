//! Cells of which only a part belongs to the body, and nodes that follow others: a mesh into which a patch of other cells is embedded.
//!
//! A cut cell keeps its nodes and shape functions. Its integrals are those over the part that is left, by a rule of its own, so that stiffness, masses and loads
//! are exact for the part.

use std::collections::BTreeMap;

use rustc_hash::{FxHashMap, FxHashSet};

use super::Facet;
use super::facet::{BoundaryFacet, key};
use crate::tensor::{Tensor, Vector, inverse};

/// Distance from a plane between cells of a patch within which places lie in it, in edges.
pub(crate) const IN_PLANE: f64 = 1e-7;

/// A quadrature rule of a cut cell: reference coordinates and weights.
pub type CutRule = Vec<([f64; 3], f64)>;

/// The rules of a cell of which only a part belongs to the body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CutCell {
    /// The part of its volume that belongs to the body.
    pub fraction: f64,
    /// Integrates a stiffness.
    pub stiffness: CutRule,
    /// Integrates polynomials of degree two: masses and body forces.
    pub mass: CutRule,
}

/// The part of a facet that belongs to the surface of the body.
#[derive(Clone, Debug, PartialEq)]
pub struct CutFacet<const D: usize> {
    /// A quadrature rule: places \[m\] and weights [m^(D−1)].
    pub rule: Vec<(Vector<D>, f64)>,
    /// True if its cell is divided.
    pub is_divided: bool,
}

/// Changes that an embedded patch makes to a mesh; empty in a mesh without one.
#[derive(Clone, Debug, PartialEq)]
pub struct Embedded<const D: usize> {
    /// Cells of which only a part belongs to the body.
    pub cut: FxHashMap<u32, CutCell>,
    /// Cut quadrilaterals and hexahedra whose shape functions are linear in simplices around their middle.
    pub divided: FxHashSet<u32>,
    /// Cells of which too little is left for a strain of their own, each with the one whose strain they show.
    pub shown: FxHashMap<u32, u32>,
    /// Nodes that follow others, with weights that add up to one and are exact for affine fields. The others follow none.
    pub followers: BTreeMap<u32, Vec<(u32, f64)>>,
    /// Rows by which nodes that follow hand on masses and loads, where it is not those of their displacement: as many, or none.
    pub shares: BTreeMap<u32, Vec<(u32, f64)>>,
    /// Facets of one cell only that are no surface of the body, by their sorted corners.
    pub(super) inner: FxHashSet<[u32; 4]>,
    /// Facets of which only a part belongs to the surface, by their sorted corners, with a rule for the part.
    pub(super) cut_facets: FxHashMap<[u32; 4], CutFacet<D>>,
    /// The part of each cell of the patch that the surface of the body cuts, as simplices; corners beyond `D + 1` have no meaning.
    pub pieces: FxHashMap<u32, Vec<[Vector<D>; 4]>>,
    /// The surface of the body in cells that it crosses, by sorted nodes: these belong to no cell.
    pub(super) surface: BTreeMap<[u32; 4], BoundaryFacet>,
    /// The place of the patch.
    pub covered: Covered<D>,
}

/// A union of cells of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Covered<const D: usize> {
    /// Lower corner of the cell of index zero.
    pub corner: Vector<D>,
    /// Edge of the cells.
    pub edge: f64,
    /// Its cells.
    pub cells: FxHashSet<[i32; D]>,
}

impl<const D: usize> Covered<D> {
    /// Returns true if places lie in a plane between cells.
    pub fn is_plane(&self, places: impl Iterator<Item = Vector<D>> + Clone) -> bool {
        let at = |x: Vector<D>, axis: usize| (x - self.corner)[axis] / self.edge;
        let first = places.clone().next().unwrap_or(self.corner);
        (0..D).any(|axis| {
            let plane = at(first, axis).round();
            places
                .clone()
                .all(|x| (at(x, axis) - plane).abs() < IN_PLANE)
        })
    }
}

impl<const D: usize> Default for Embedded<D> {
    fn default() -> Self {
        Self {
            cut: FxHashMap::default(),
            divided: FxHashSet::default(),
            shown: FxHashMap::default(),
            followers: BTreeMap::new(),
            shares: BTreeMap::new(),
            inner: FxHashSet::default(),
            cut_facets: FxHashMap::default(),
            pieces: FxHashMap::default(),
            surface: BTreeMap::new(),
            covered: Covered {
                corner: Vector::zeros(),
                edge: 1.0,
                cells: FxHashSet::default(),
            },
        }
    }
}

impl<const D: usize> Covered<D> {
    /// Distance from the faces, in edges, within which a position does not lie within.
    const ON_FACE: f64 = 1e-7;

    /// Returns true if a position lies within, and not on a face.
    pub fn holds(&self, x: &Vector<D>) -> bool {
        let at = (x - self.corner) / self.edge;
        (0..1usize << D).all(|bits| {
            self.cells.contains(&std::array::from_fn(|i| {
                let sign = if bits >> i & 1 == 1 { 1.0 } else { -1.0 };
                (at[i] + sign * Self::ON_FACE).floor() as i32
            }))
        })
    }
}

impl<const D: usize> Embedded<D> {
    /// Returns true if a position lies in the part of a cell that is none of the body: which a patch took, or which lies beyond the surface.
    pub fn is_taken(&self, c: usize, x: &Vector<D>) -> bool {
        self.cut_cell(c).is_some()
            && match self.pieces.get(&(c as u32)) {
                None => self.covered.holds(x),
                Some(pieces) => !pieces.iter().any(|piece| in_simplex(piece, x)),
            }
    }

    /// Adds a facet to the surface of the body in a cell that it crosses; its nodes, of which the normal points outwards, belong to no cell.
    pub fn add_surface(&mut self, cell: u32, nodes: Facet) {
        let facet = key(nodes.iter().copied());
        let local = BoundaryFacet::CROSSING;
        self.surface
            .insert(facet, BoundaryFacet { nodes, cell, local });
    }

    /// The facet of the surface with these nodes, where the surface crosses a cell.
    pub fn crossing(&self, nodes: &[u32]) -> Option<&BoundaryFacet> {
        match self.surface.is_empty() || nodes.len() > 4 {
            true => None,
            false => self.surface.get(&key(nodes.iter().copied())),
        }
    }

    /// The facets of the surface that cross cells.
    pub fn crossings(&self) -> impl Iterator<Item = &BoundaryFacet> {
        self.surface.values()
    }

    /// Returns true if a cell is divided.
    #[inline]
    pub fn is_divided(&self, c: usize) -> bool {
        !self.divided.is_empty() && self.divided.contains(&(c as u32))
    }

    /// Returns true if a patch is embedded in the mesh.
    pub fn has_patch(&self) -> bool {
        !self.covered.cells.is_empty()
    }

    /// Returns true if a cell is one of the patch, which are the first of the mesh.
    pub fn is_of_patch(&self, c: usize) -> bool {
        c < self.covered.cells.len()
    }

    /// The cell whose strain a cell shows.
    pub fn shown_by(&self, c: usize) -> usize {
        match self.shown.is_empty() {
            true => c,
            false => (self.shown.get(&(c as u32))).map_or(c, |&other| other as usize),
        }
    }

    /// Returns true if enough is left of a cell for a strain of its own.
    pub fn has_strain(&self, c: usize) -> bool {
        self.shown.is_empty() || !self.shown.contains_key(&(c as u32))
    }

    /// The rules of a cell, where only a part of it belongs to the body.
    #[inline]
    pub fn cut_cell(&self, c: usize) -> Option<&CutCell> {
        match self.cut.is_empty() {
            true => None,
            false => self.cut.get(&(c as u32)),
        }
    }

    /// The part of a facet with these corners, where only a part of it belongs to the surface.
    pub fn cut_facet(&self, corners: &[u32]) -> Option<&CutFacet<D>> {
        match self.cut_facets.is_empty() {
            true => None,
            false => {
                let facet = key(corners.iter().copied());
                self.cut_facets.get(&facet)
            }
        }
    }

    /// Leaves a part of a facet, by its corners.
    pub fn cut_facet_to(&mut self, corners: &[u32], part: CutFacet<D>) {
        let facet = key(corners.iter().copied());
        self.cut_facets.insert(facet, part);
    }

    /// Takes a facet, by its corners, out of the surface of the body.
    pub fn hide(&mut self, corners: &[u32]) {
        self.inner.insert(key(corners.iter().copied()));
    }
}

/// Returns true if a position lies in a simplex, or within rounding of it.
fn in_simplex<const D: usize>(corners: &[Vector<D>; 4], x: &Vector<D>) -> bool {
    const SLACK: f64 = 1e-9;
    let own = &corners[..=D];
    let (low, high) =
        (own.iter()).fold((own[0], own[0]), |(low, high), x| (low.inf(x), high.sup(x)));
    let margin = (high - low) * (10.0 * SLACK);
    if (0..D).any(|i| x[i] < low[i] - margin[i] || x[i] > high[i] + margin[i]) {
        return false;
    }
    let edges = Tensor::<D>::from_fn(|i, k| (corners[k + 1] - corners[0])[i]);
    let Some((inverse, _)) = inverse(&edges) else {
        return false;
    };
    let t = inverse * (x - corners[0]);
    t.iter().all(|t| *t >= -SLACK) && t.sum() <= 1.0 + SLACK
}
