//! A patch of lattice cells embedded in the elements of any mesh.
//!
//! | file | content |
//! |---|---|
//! | `places.rs` | places that a scene wants, holds, and keeps a patch off |
//! | `cells.rs` | cells of the zone, the rim around them, and the faces Γ of the rim |
//! | `halves.rs` | quadrilaterals of second order that the patch cuts, in two triangles |
//! | `replaced.rs` | cells of second order that the patch meets, with straight sides, and linear but for simplices; quadrilaterals and hexahedra that it cuts, divided |
//! | `cuts.rs` | elements that Γ cuts: what is left of them |
//! | `plane_parts.rs` | plane parts of Γ, in an order in which rows of their nodes resolve |
//! | `tie.rs` | the displacement of the nodes of Γ, by a dual mortar |
//! | `shares.rs` | masses that nodes hand on which follow others |
//! | `followers.rs` | nodes that no good element holds |
//! | `sides.rs` | nodes inside the patch that elements on different sides share |
//! | `left.rs` | what is left of cut cells, as simplices |
//! | `surface.rs` | facets at the surface of the body that the patch covers |
//! | `moments.rs`, `rows.rs`, `error.rs` | shared: moments of parts, rows of nodes that follow, errors |
//! | `shown.rs` | cells that show the strain of another |
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
mod halves;
mod left;
mod moments;
mod places;
mod plane_parts;
mod replaced;
mod rows;
mod shares;
mod shown;
mod sides;
mod surface;
mod tie;

pub use self::{
    composite::Patched, error::PatchError, left::Left, places::Places, replaced::Replaced,
};

use std::collections::BTreeMap;

use self::{
    cells::PatchCells,
    composite::Composite,
    cuts::Cuts,
    halves::Halves,
    rows::{Place, Rows, mass_row, row_of_cell},
    sides::Sides,
    tie::Tied,
};
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
    let mut halves = Halves::none(mesh);
    loop {
        let is_held = |n| halves.is_held(n, &places);
        let own = Places {
            is_held: &is_held,
            ..places
        };
        let of_cell = |c| material(halves.origin(c));
        match embedded_by_some_way(&halves.mesh, lattice, own, &of_cell)? {
            Found::ToHalve(cells) => halves.halve(&cells),
            Found::Patched(mut patched) => {
                for c in &mut patched.origin {
                    *c = halves.origin(*c);
                }
                patched.replaced.halved = halves.count();
                return Ok(*patched);
            }
        }
    }
}

/// Outcome of embedding a patch.
enum Found<const D: usize> {
    Patched(Box<Patched<D>>),
    /// Quadrilaterals of second order that the patch cuts.
    ToHalve(Vec<u32>),
}

/// The same by the first way to let the patch grow that succeeds.
fn embedded_by_some_way<const D: usize>(
    mesh: &Mesh<D>,
    lattice: PatchLattice<D>,
    places: Places<'_, D>,
    material: &dyn Fn(u32) -> u16,
) -> Result<Found<D>, PatchError> {
    let orders: &[bool] = if D == 3 { &[false, true] } else { &[false] };
    // at rest no node needs a mass
    let takes_strips: &[bool] = if lattice.has_masses {
        &[true, false]
    } else {
        &[false]
    };
    let ways = takes_strips.iter().flat_map(|&takes_strips| {
        orders.iter().map(move |&orders_parts| Growth {
            orders_parts,
            takes_strips,
        })
    });
    let mut first = None;
    for way in ways {
        match grown(mesh, lattice, places, material, way) {
            Err(error @ (PatchError::Empty { .. } | PatchError::Large { .. })) => {
                return Err(error);
            }
            Err(error) => first = first.or(Some(error)),
            found => return found,
        }
    }
    Err(first.expect("some way was tried"))
}

/// Growth of a patch to what it must have too.
#[derive(Clone, Copy)]
struct Growth {
    /// True if nodes of the rim belong to plane parts by an order of these, not by their axes: the patch then grows less, where a staircase has steps of one cell.
    orders_parts: bool,
    /// True if the rim goes to a surface that no element with enough left lies before.
    takes_strips: bool,
}

/// The same with a patch that grows in one way.
fn grown<const D: usize>(
    mesh: &Mesh<D>,
    lattice: PatchLattice<D>,
    places: Places<'_, D>,
    material: &dyn Fn(u32) -> u16,
    growth: Growth,
) -> Result<Found<D>, PatchError> {
    let cells = lattice.cells(&mesh.bounds().0);
    let width = 1 + (lattice.reach / cells.spacing - 1e-6).ceil() as i32;
    // at least one spacing of it
    let skin = (lattice.has_skin).then(|| 1.0 / f64::from(lattice.per_cell));
    let mut patch = PatchCells::new(
        mesh,
        cells,
        (width, skin, growth.orders_parts),
        lattice.within,
        &places,
    )?;
    let is_held = places.is_held;
    for _ in 0..ABSORBED {
        patch.check_materials(material)?;
        patch.check_connected(mesh)?;
        let (cut, replaced) = match replaced::replaced(mesh, &patch) {
            Ok(found) => found,
            Err(quadrilaterals) => return Ok(Found::ToHalve(quadrilaterals)),
        };
        let cuts = Cuts::new(cut.as_ref(), &patch, lattice.has_masses)?;
        let strips = match growth.takes_strips {
            true => cuts.strips(cut.as_ref(), &patch, is_held),
            false => Vec::new(),
        };
        if !strips.is_empty() {
            match patch.take(strips) {
                true => continue,
                false => return Err(PatchError::Grown),
            }
        }
        let found = embedded((cut.as_ref(), &cuts), &patch, (is_held, material), lattice);
        let error = match found {
            Ok(patched) => {
                let patched = Patched {
                    replaced,
                    ..patched
                };
                return Ok(Found::Patched(Box::new(patched)));
            }
            Err(error) => error,
        };
        // a strip between the rim and a surface that no element carries: the rim goes to the surface
        if !error.place().is_some_and(|x| patch.absorb(&x)) {
            return Err(error);
        }
    }
    Err(PatchError::Grown)
}

/// Strips of elements that a rim takes in, at most.
const ABSORBED: usize = 60;

/// The mesh with these cells as its patch.
fn embedded<const D: usize>(
    (mesh, cuts): (&Mesh<D>, &Cuts),
    patch: &PatchCells<D>,
    (is_held, material): (&dyn Fn(u32) -> bool, &dyn Fn(u32) -> u16),
    lattice: PatchLattice<D>,
) -> Result<Patched<D>, PatchError> {
    if lattice.may_part {
        sides::check_elements(mesh, patch, cuts)?;
    }
    let sides = Sides::new(mesh, patch, cuts);
    let is_held = |n: u32| is_held(sides.origin(n));
    // masses and displacements by the same weights, or what accelerates strains cells: none of second order, which are negative in a cell too
    let row_at = match lattice.has_masses {
        true => mass_row,
        false => row_of_cell,
    };
    let mut rows = followers::of_mesh(&sides.mesh, cuts, (&is_held, material), row_at)?;
    rows.extend(followers::of_rim(patch)?);
    let tied = tie::rows(&sides.mesh, patch, cuts);
    let mut all = rows.clone();
    all.extend(
        tied.rows
            .iter()
            .map(|(n, row)| (Place::Patch(*n), row.clone())),
    );
    let mut composite = Composite::new((mesh, &sides), patch, cuts);
    let all = followers::resolved(&all, patch)?;
    composite.patched.mesh.embedded.followers = composite.numbered(&all);
    let origin = &composite.patched.origin;
    let of_cell = |c: u32| material(origin[c as usize]);
    composite.patched.mesh.embedded.shown = shown::shown(&composite.patched, of_cell);
    composite.patched.skin = patch.skin;
    composite.patched.kept_off = patch.kept_off;
    share_masses(
        &mut composite,
        (&sides.mesh, patch, cuts),
        (rows, tied),
        lattice,
    )?;
    Ok(composite.patched)
}

/// Gives nodes that follow others rows of their own for masses, where those of their displacement leave none to a node, and in time.
fn share_masses<const D: usize>(
    composite: &mut Composite<'_, D>,
    (mesh, patch, cuts): (&Mesh<D>, &PatchCells<D>, &Cuts),
    (mut rows, tied): (Rows<D>, Tied<D>),
    lattice: PatchLattice<D>,
) -> Result<(), PatchError> {
    let patched = &composite.patched;
    // small masses shorten the step: beside cells of one spacing they may be, since there are no smaller ones
    let light = match lattice.has_masses && lattice.per_cell > 1 {
        true => SMALL,
        false => LIGHT,
    };
    let volume = volumes(patched);
    let by_ties = lightest(
        patched,
        volume.clone(),
        &patched.mesh.embedded.followers,
        light,
    );
    if by_ties.is_none() && !lattice.has_masses {
        return Ok(());
    }
    let own = shares::of_nodes(mesh, patch, &tied.beyond);
    for (node, row) in tied.rows {
        let row = own.get(&node).map_or(row, |own| own.1.clone());
        rows.insert(Place::Patch(node), row);
    }
    let mut rows = followers::resolved(&rows, patch)?;
    if lattice.has_masses {
        let volume_of = |node: &_| volume[composite.number_of(node) as usize];
        let pooled = shares::pooled(mesh, patch, &tied.beyond, &own, volume_of);
        let changed: Rows<D> = (pooled.iter())
            .map(|(node, (row, _))| (Place::Patch(*node), followers::substituted(row, &rows)))
            .collect();
        rows.extend(changed);
        shares::make_positive(mesh, (patch, cuts), &pooled, &mut rows);
    }
    let rows = composite.numbered(&rows);
    let by_shares = lightest(patched, volume, &rows, light);
    match (lattice.has_masses, by_ties, by_shares) {
        (true, Some(_), Some((n, volume))) => Err(PatchError::Mass {
            position: patched.mesh.nodes[n as usize].iter().copied().collect(),
            volume,
        }),
        (true, None, Some(_)) => Ok(()),
        _ => {
            composite.patched.mesh.embedded.shares = rows;
            Ok(())
        }
    }
}

/// Part of a cell of the rim up to which a volume is none: what rounding leaves of it.
const LIGHT: f64 = 1e-9;

/// The same of nodes whose mass shortens a step.
const SMALL: f64 = 0.01;

/// The volume of the elements that each node stands for.
fn volumes<const D: usize>(patched: &Patched<D>) -> Vec<f64> {
    let elements = (0..patched.mesh.cell_count()).filter(|&c| !patched.nonlocal[c]);
    fem::nodal_volumes(&patched.mesh, elements)
}

/// A node of elements that follows none and has no larger volume than that part of a cell of the patch, and of the smallest element around it, if there is one, where nodes that follow hand theirs on by these rows.
fn lightest<const D: usize>(
    patched: &Patched<D>,
    mut volume: Vec<f64>,
    rows: &BTreeMap<u32, Vec<(u32, f64)>>,
    light: f64,
) -> Option<(u32, f64)> {
    let mesh = &patched.mesh;
    for (&n, row) in rows {
        let own = std::mem::take(&mut volume[n as usize]);
        row.iter().for_each(|&(m, w)| volume[m as usize] += w * own);
    }
    let cell = mesh.embedded.covered.edge.powi(D as i32);
    // nodes of elements that are small whatever is cut off are light by themselves
    let mut smallest = vec![cell; mesh.nodes.len()];
    let elements = || (0..mesh.cell_count()).filter(|&c| !patched.nonlocal[c]);
    for c in elements() {
        let whole = mesh.cell_volume(c).abs();
        for &n in mesh.cell(c) {
            let own = &mut smallest[n as usize];
            *own = own.min(whole);
        }
    }
    let part = |n: u32| volume[n as usize] / smallest[n as usize];
    let follows = |n: &u32| mesh.embedded.followers.contains_key(n);
    let free = elements()
        .flat_map(|c| mesh.cell(c))
        .filter(|n| !follows(n));
    let least = *free.min_by(|&&a, &&b| part(a).total_cmp(&part(b)))?;
    (part(least) <= light).then_some((least, volume[least as usize]))
}
