//! A patch of lattice cells embedded in the elements of any mesh.
//!
//! | file | content |
//! |---|---|
//! | `places.rs` | places that a scene wants, holds, and keeps a patch off |
//! | `cells.rs` | cells of the zone, the rim around them, and the faces Γ of the rim |
//! | `replaced.rs` | cells of second order that the patch meets, linear with straight sides; quadrilaterals and hexahedra that it cuts, divided |
//! | `cuts.rs` | elements that Γ cuts: what is left of them |
//! | `plane_parts.rs` | plane parts of Γ, in an order in which rows of their nodes resolve |
//! | `tie.rs` | the displacement of the nodes of Γ, by a dual mortar |
//! | `followers.rs` | nodes that no good element holds |
//! | `sides.rs` | nodes inside the patch that elements on different sides share |
//! | `left.rs` | what is left of cut cells, as simplices |
//! | `surface.rs` | facets at the surface of the body that the patch covers |
//! | `moments.rs`, `rows.rs`, `error.rs` | shared: moments of parts, rows of nodes that follow, errors |
//! | `composite.rs` | zone, rim and what is left of the elements as one mesh |
//!
//! The peridynamic zone is a union of lattice cells. Around it lies a *rim* of elements on the same lattice, so that a coupling sees a seam that follows the lattice, whatever the mesh is. The elements of the mesh end at Γ, the outer face of the rim:
//! their integrals are over what lies outside. The rim's nodes on Γ follow the elements in the mean,
//!
//! ```text
//! ∫_Γ ψ_i (u_rim − u_mesh) dA = 0
//! ```
//!
//! with functions ψ that are dual to the shape functions on each plane part of Γ \[Wohlmuth2000\] and add up to one, so that the tie carries a constant traction and the patch test passes. Each node of Γ has a row of its own. A node where parts of Γ
//! with different normals meet belongs to the part whose axis comes first, or, where the patch would have to grow too far for that, to the first by an order of the parts. Nodes of the mesh with no element of which enough is left follow the nearest one that has, as in aggregated cut elements \[Badia2018\].
//! All of this is the transfer T of the model, and constant.

mod cells;
mod composite;
mod cuts;
mod error;
mod followers;
mod left;
mod moments;
mod places;
mod plane_parts;
mod replaced;
mod rows;
mod sides;
mod surface;
mod tie;

pub use self::{
    composite::Patched, error::PatchError, left::Left, places::Places, replaced::Replaced,
};

use std::collections::BTreeMap;

use self::{cells::PatchCells, composite::Composite, cuts::Cuts, rows::Place, sides::Sides};
use crate::{fem, mesh::Mesh, model::simplex::Cells, tensor::Vector};

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
    /// Corners of a box around the zone \[m\].
    pub within: (Vector<D>, Vector<D>),
    /// True if the body moves: every node then needs a mass.
    pub has_masses: bool,
    /// True if elements are to lie between the surface of the body and the zone.
    pub has_skin: bool,
    /// True if cracks may part the zone: no element may then reach from one side of it to another.
    pub may_part: bool,
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

/// Embeds a patch in a mesh: the cells of the lattice with their centre in the zone, and a rim around them.
///
/// `material` gives the number of a cell's material.
///
/// # Errors
/// [`PatchError`], each with place and remedy.
pub fn embed<const D: usize>(
    mesh: &Mesh<D>,
    lattice: PatchLattice<D>,
    places: Places<'_, D>,
    material: &dyn Fn(u32) -> u16,
) -> Result<Patched<D>, PatchError> {
    match grown(mesh, lattice, places, material, false) {
        Err(first) if D == 3 => grown(mesh, lattice, places, material, true).map_err(|_| first),
        found => found,
    }
}

/// The same with nodes of the rim that belong to plane parts by their axes, or by an order of the parts: the patch then grows less, where a staircase has steps of one cell.
fn grown<const D: usize>(
    mesh: &Mesh<D>,
    lattice: PatchLattice<D>,
    places: Places<'_, D>,
    material: &dyn Fn(u32) -> u16,
    orders_parts: bool,
) -> Result<Patched<D>, PatchError> {
    let cells = lattice.cells(&mesh.bounds().0);
    let width = 1 + (lattice.reach / cells.spacing - 1e-6).ceil() as i32;
    let mut patch = PatchCells::new(
        mesh,
        cells,
        (width, lattice.has_skin, orders_parts),
        lattice.within,
        &places,
    )?;
    let is_held = places.is_held;
    for _ in 0..ABSORBED {
        patch.check_materials(material)?;
        patch.check_connected(mesh)?;
        let found = embedded(mesh, &patch, (is_held, material), lattice);
        let Err(error) = &found else {
            return found;
        };
        // a strip between the rim and a surface that no element carries: the rim goes to the surface
        if !error.place().is_some_and(|x| patch.absorb(&x)) {
            return found;
        }
    }
    embedded(mesh, &patch, (is_held, material), lattice)
}

/// Strips of elements that a rim takes in, at most.
const ABSORBED: usize = 60;

/// The mesh with these cells as its patch.
fn embedded<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    (is_held, material): (&dyn Fn(u32) -> bool, &dyn Fn(u32) -> u16),
    lattice: PatchLattice<D>,
) -> Result<Patched<D>, PatchError> {
    let (mesh, replaced) = replaced::replaced(mesh, patch);
    let mesh = mesh.as_ref();
    let cuts = Cuts::new(mesh, patch)?;
    if lattice.may_part {
        sides::check_elements(mesh, patch, &cuts)?;
    }
    let sides = Sides::new(mesh, patch, &cuts);
    let is_held = |n: u32| is_held(sides.origin(n));
    let mut rows = followers::of_mesh(&sides.mesh, &cuts, &is_held, material)?;
    rows.extend(followers::of_rim(patch)?);
    let tied = tie::rows(&sides.mesh, patch, &cuts);
    let (mut all, mut shares) = (rows.clone(), rows);
    for (node, own) in tied {
        all.insert(Place::Patch(node), own.row);
        shares.insert(Place::Patch(node), own.share);
    }
    let composite = Composite::new((mesh, &sides), patch, &cuts);
    let all = followers::resolved(&all, patch)?;
    let shares = followers::resolved(&shares, patch)?;
    let mut patched = composite.with_followers(&all, &shares);
    if lightest(&patched, &patched.mesh.embedded.followers).is_none() {
        patched.mesh.embedded.shares.clear();
    } else if lattice.has_masses
        && let Some((n, volume)) = lightest(&patched, &patched.mesh.embedded.shares)
    {
        return Err(PatchError::Mass {
            position: patched.mesh.nodes[n as usize].iter().copied().collect(),
            volume,
        });
    }
    Ok(Patched {
        skin: patch.skin,
        kept_off: patch.kept_off,
        replaced,
        ..patched
    })
}

/// Part of a cell of the rim up to which a volume is none: what rounding leaves of it.
const LIGHT: f64 = 1e-9;

/// A node of elements that follows none and has no positive volume, if there is one, where nodes that follow hand theirs on by these rows.
fn lightest<const D: usize>(
    patched: &Patched<D>,
    rows: &BTreeMap<u32, Vec<(u32, f64)>>,
) -> Option<(u32, f64)> {
    let mesh = &patched.mesh;
    let elements = || (0..mesh.cell_count()).filter(|&c| !patched.nonlocal[c]);
    let mut volume = fem::nodal_volumes(mesh, elements());
    for (&n, row) in rows {
        let own = std::mem::take(&mut volume[n as usize]);
        row.iter().for_each(|&(m, w)| volume[m as usize] += w * own);
    }
    let follows = |n: &u32| mesh.embedded.followers.contains_key(n);
    let free = elements()
        .flat_map(|c| mesh.cell(c))
        .filter(|n| !follows(n));
    let least = free.min_by(|&&a, &&b| volume[a as usize].total_cmp(&volume[b as usize]))?;
    let own = volume[*least as usize];
    let cell = mesh.embedded.covered.edge.powi(D as i32);
    (own <= LIGHT * cell).then_some((*least, own))
}
