//! A patch of lattice cells embedded in the elements of any mesh.
//!
//! | file | content |
//! |---|---|
//! | `cells.rs` | cells of the zone, the rim around them, and the faces Γ of the rim |
//! | `cuts.rs` | elements that Γ cuts: what is left of them |
//! | `tie.rs` | the displacement of the nodes of Γ, by a dual mortar |
//! | `followers.rs` | nodes that no good element holds |
//! | `surface.rs` | facets at the surface of the body that the patch covers |
//! | `composite.rs` | zone, rim and what is left of the elements as one mesh |
//!
//! The peridynamic zone is a union of lattice cells. Around it lies a *rim* of elements on the same lattice, so that a coupling sees a seam that follows the lattice, whatever the mesh is. The elements of the mesh end at Γ, the outer face of the rim:
//! their integrals are over what lies outside. The rim's nodes on Γ follow the elements in the mean,
//!
//! ```text
//! ∫_Γ ψ_i (u_rim − u_mesh) dA = 0
//! ```
//!
//! with functions ψ that are dual to the shape functions on each plane part of Γ [Wohlmuth2000] and add up to one, so that the tie carries a constant traction and the patch test passes. Each node of Γ has a row of its own. A node where parts of Γ
//! with different normals meet belongs to the part whose axis comes first. Nodes of the mesh with no element of which enough is left follow the nearest one that has, as in aggregated cut elements [Badia2018].
//! All of this is the transfer T of the model, and constant.

mod cells;
mod composite;
mod cuts;
mod followers;
mod surface;
mod tie;

#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::collections::BTreeMap;

use rustc_hash::{FxHashMap, FxHashSet};

use self::{
    cells::{Index, PatchCells},
    composite::Composite,
    cuts::Cuts,
};
use crate::{
    fem,
    mesh::{CellShape, Mesh},
    model::simplex::{Cells, Simplex, as_box},
    tensor::{Tensor, Vector},
};

/// Reasons for which a patch cannot be embedded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatchError {
    /// No cell of the lattice has its centre in the zone and lies within the body.
    #[error(
        "no cell of the lattice, of edge {edge}, lies in the zone and within the body; make the zone larger or the spacing smaller"
    )]
    Empty {
        /// Edge of the cells \[m\].
        edge: f64,
    },
    /// Nodes at the rim follow one another.
    #[error(
        "nodes of the rim of the zone follow one another near {position:?}; move the zone, or take a smaller spacing"
    )]
    Circle {
        /// Position of one of them \[m\].
        position: Vec<f64>,
    },
    /// The outer face of the rim cuts a cell of a kind that it may not.
    #[error(
        "cell {cell}, a {shape:?}, at {position:?}, is cut by the rim of the zone; only lines, triangles, tetrahedra, and rectangles and cuboids along the axes may be"
    )]
    Kind {
        /// Number of the cell.
        cell: usize,
        /// Its shape.
        shape: CellShape,
        /// Its middle \[m\].
        position: Vec<f64>,
    },
    /// Cells of several materials meet in the patch.
    #[error(
        "the zone or its rim holds two materials at {position:?}; keep both away from the border of materials"
    )]
    Materials {
        /// Middle of the cell of the lattice \[m\].
        position: Vec<f64>,
    },
    /// No element near a node is left.
    #[error(
        "a node at {position:?} keeps no element of which enough is left beside the rim of the zone; refine the mesh there, or move the zone"
    )]
    Alone {
        /// Its position \[m\].
        position: Vec<f64>,
    },
    /// A node would have no mass.
    #[error(
        "the elements that are left at {position:?} beside the rim of the zone give a node the volume {volume:.3e}; move the zone, or refine the mesh there"
    )]
    Mass {
        /// Position of the node \[m\].
        position: Vec<f64>,
        /// Its volume [m^D].
        volume: f64,
    },
}

/// A mesh with an embedded patch.
#[derive(Clone, Debug)]
pub struct Patched<const D: usize> {
    /// Zone, rim, and what is left of the mesh.
    pub mesh: Mesh<D>,
    /// True for the cells of the zone.
    pub nonlocal: Vec<bool>,
    /// The cell of the mesh before whose material each cell has.
    pub origin: Vec<u32>,
    /// Facets of the surface of which the patch covers a part: their corners in the mesh before, sorted.
    pub covered: FxHashSet<Vec<u32>>,
    /// Named sets of facets that hold a part of a face of the patch.
    pub torn: FxHashSet<String>,
    /// Cells of the rim.
    pub rim: usize,
    /// Cells of second order that became linear.
    pub linear: usize,
}

/// Lattice of a patch.
#[derive(Clone, Copy, Debug)]
pub struct PatchLattice<const D: usize> {
    /// A place where planes between its cells meet \[m\].
    pub corner: Vector<D>,
    /// Spacing \[m\].
    pub spacing: f64,
    /// Spacings along the edge of a cell of zone and rim.
    pub per_cell: u32,
    /// Distance from the zone up to which the rim reaches, beside one cell \[m\].
    pub reach: f64,
}

impl<const D: usize> PatchLattice<D> {
    /// Cells of zone and rim, of which the box around a body that begins at `low` holds whole ones from its corner on, where a plane between points lies there.
    fn cells(&self, low: &Vector<D>) -> Cells<D> {
        let corner = self.corner;
        let edge = self.spacing * f64::from(self.per_cell);
        let first = (low - corner).map(|x| (x / self.spacing - 1e-6).ceil() * self.spacing);
        Cells {
            origin: corner + first + Vector::repeat(0.5 * edge),
            spacing: edge,
        }
    }
}

/// Embeds a patch in a mesh: the cells of the lattice with their centre in the zone, `is_wanted`, and a rim around them.
///
/// Nodes that `is_held` names have a prescribed motion and follow none; `material` gives the number of a cell's material.
///
/// # Errors
/// [`PatchError`], each with place and remedy.
pub fn embed<const D: usize>(
    mesh: &Mesh<D>,
    lattice: PatchLattice<D>,
    is_wanted: &(dyn Fn(&Vector<D>) -> bool + Sync),
    is_held: &dyn Fn(u32) -> bool,
    material: &dyn Fn(u32) -> u16,
) -> Result<Patched<D>, PatchError> {
    let cells = lattice.cells(&mesh.bounds().0);
    let width = 1 + (lattice.reach / cells.spacing - 1e-6).ceil() as i32;
    let patch = PatchCells::new(mesh, cells, width, is_wanted)?;
    patch.check_materials(material)?;
    let (mesh, linear) = linear_at(mesh, &patch);
    let mesh = mesh.as_ref();
    let cuts = Cuts::new(mesh, &patch)?;
    let mut rows = followers::of_mesh(mesh, &cuts, is_held)?;
    rows.extend(followers::of_rim(&patch)?);
    let tied = tie::rows(mesh, &patch, &cuts).into_iter();
    rows.extend(tied.map(|(node, row)| (Place::Patch(node), row)));
    let composite = Composite::new(mesh, &patch, &cuts);
    let patched = composite.with_followers(&followers::resolved(&rows, &patch)?);
    check_masses(&patched)?;
    Ok(Patched { linear, ..patched })
}

/// The mesh with linear cells instead of those of second order that the patch meets, and how many there are.
fn linear_at<'m, const D: usize>(
    mesh: &'m Mesh<D>,
    patch: &PatchCells<D>,
) -> (Cow<'m, Mesh<D>>, usize) {
    if !mesh.has_quadratic_cells() {
        return (Cow::Borrowed(mesh), 0);
    }
    let mut is_met = vec![false; mesh.cell_count()];
    for index in &patch.all {
        for &(c, _) in &patch.held[index] {
            is_met[c as usize] |= mesh.shapes[c as usize].is_quadratic();
        }
    }
    let mut linear = mesh.clone();
    linear.linearise(|c| is_met[c]);
    (Cow::Owned(linear), is_met.iter().filter(|is| **is).count())
}

/// Size, first and second moment of a part of a cell or a facet.
#[derive(Clone, Copy, Debug)]
struct PartMoments<const D: usize> {
    size: f64,
    about: Vector<D>,
    first: Vector<D>,
    second: Tensor<D>,
}

impl<const D: usize> PartMoments<D> {
    /// Nothing, with moments about a place.
    fn about(place: Vector<D>) -> Self {
        Self {
            size: 0.0,
            about: place,
            first: Vector::zeros(),
            second: Tensor::zeros(),
        }
    }

    fn add(&mut self, part: &Simplex<D>) {
        part.quadrature(|x, w| {
            let x = x - self.about;
            self.size += w;
            self.first += x * w;
            self.second += x * x.transpose() * w;
        });
    }

    /// Adds another part, with moments about the same place.
    fn join(&mut self, other: &Self) {
        self.size += other.size;
        self.first += other.first;
        self.second += other.second;
    }

    /// Size, centroid, and the second moment about it over the size.
    fn central(&self) -> (f64, Vector<D>, Tensor<D>) {
        let centroid = self.first / self.size;
        let second = self.second / self.size - centroid * centroid.transpose();
        (self.size, self.about + centroid, second)
    }

    /// Places and weights that integrate polynomials of degree two over the part.
    fn rule(&self) -> Vec<(Vector<D>, f64)> {
        let (size, centroid, second) = self.central();
        let places = fem::places_of_part(centroid, &second);
        let weight = size / places.len() as f64;
        places.into_iter().map(|x| (x, weight)).collect()
    }
}

/// A node, of the mesh or of the patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Place<const D: usize> {
    Mesh(u32),
    Patch(Index<D>),
}

/// Weights of nodes.
type Row<const D: usize> = Vec<(Place<D>, f64)>;

/// The row of each node that follows others.
type Rows<const D: usize> = BTreeMap<Place<D>, Row<D>>;

/// Weights, over the largest of their row, that rounding leaves.
const ROUNDING: f64 = 1e-15;

/// Adds up the weights of each node.
fn gathered<const D: usize>(row: impl IntoIterator<Item = (Place<D>, f64)>) -> Row<D> {
    let mut sums: FxHashMap<Place<D>, f64> = FxHashMap::default();
    for (n, w) in row {
        *sums.entry(n).or_insert(0.0) += w;
    }
    let largest = sums.values().fold(0.0, |most: f64, w| most.max(w.abs()));
    let own = sums.into_iter();
    let mut row: Row<D> = own.filter(|e| e.1.abs() > ROUNDING * largest).collect();
    row.sort_unstable_by_key(|e| e.0);
    row
}

/// Refuses a mesh of which a node of elements that follows none has no positive volume.
fn check_masses<const D: usize>(patched: &Patched<D>) -> Result<(), PatchError> {
    let mesh = &patched.mesh;
    let elements = || (0..mesh.cell_count()).filter(|&c| !patched.nonlocal[c]);
    let mut volume = fem::nodal_volumes(mesh, elements());
    for (&n, row) in &mesh.embedded.followers {
        let own = std::mem::take(&mut volume[n as usize]);
        row.iter().for_each(|&(m, w)| volume[m as usize] += w * own);
    }
    let follows = |n: &u32| mesh.embedded.followers.contains_key(n);
    let mut nodes = elements().flat_map(|c| mesh.cell(c));
    match nodes.find(|n| volume[**n as usize] <= 0.0 && !follows(n)) {
        None => Ok(()),
        Some(&n) => Err(PatchError::Mass {
            position: mesh.nodes[n as usize].iter().copied().collect(),
            volume: volume[n as usize],
        }),
    }
}

/// Returns true if a cell may be cut: its shape functions are polynomials in space.
fn may_be_cut<const D: usize>(mesh: &Mesh<D>, c: usize) -> bool {
    match mesh.shapes[c] {
        CellShape::Line2 | CellShape::Tri3 | CellShape::Tet4 => true,
        CellShape::Quad4 | CellShape::Hex8 => as_box(mesh, c).is_some(),
        _ => false,
    }
}
