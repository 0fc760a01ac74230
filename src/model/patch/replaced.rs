//! Cells that a patch replaces before it cuts: those of second order that it meets by ones with straight sides, and quadrilaterals and hexahedra by divided ones.
//!
//! Simplices with straight sides have polynomials for shape functions, so that the moments of what is left of them give their stiffness. They keep their order. Quadrilaterals are halved before ([`super::halves`]), hexahedra of second order become linear. The shape functions of general quadrilaterals and hexahedra are no polynomials in space. Divided about their middle they are linear in each part ([`crate::fem`], `divided.rs`), and neighbours that are whole stay as they are.

use std::borrow::Cow;

use super::{
    cells::PatchCells,
    cuts::{NOTHING, has_constant_jacobian},
};
use crate::mesh::{CellShape, IN_PLANE, Mesh};

/// Cells that were replaced.
#[derive(Clone, Debug, Default)]
pub struct Replaced {
    /// Number of cells of second order that became linear.
    pub linear: usize,
    /// Number of quadrilaterals of second order that are two triangles each.
    pub halved: usize,
    /// Distance \[m\] by which nodes in the middle of their edges moved, at most: that of a curved side from a straight one.
    pub moved: f64,
    /// Quadrilaterals and hexahedra that are divided about their middle.
    pub divided: usize,
}

/// The mesh with what replaces cells that the patch meets; its nodes and cells keep their numbers. Quadrilaterals of second order that have to be halved before, if there are some.
pub(super) fn replaced<'m, const D: usize>(
    mesh: &'m Mesh<D>,
    patch: &PatchCells<D>,
) -> Result<(Cow<'m, Mesh<D>>, Replaced), Vec<u32>> {
    let mut found = Replaced::default();
    let mut mesh = Cow::Borrowed(mesh);
    let met = met(&mesh, patch);
    if mesh.has_quadratic_cells() {
        let to_halve = cut_cells(&mesh, &met, |shape| shape == CellShape::Quad8);
        if !to_halve.is_empty() {
            return Err(to_halve);
        }
        straighten(mesh.to_mut(), &met, &mut found);
    }
    let divided = to_divide(&mesh, &met);
    if !divided.is_empty() {
        found.divided = divided.len();
        mesh.to_mut().embedded.divided.extend(divided);
    }
    Ok((mesh, found))
}

/// A cell that the patch meets.
#[derive(Clone, Copy, Default)]
struct Met {
    /// Its volume in the patch.
    inside: f64,
    /// True if a facet of it lies in a face of the patch: its trace there is integrated as that of a cell that is cut.
    touches: bool,
}

/// The cells that the patch meets.
fn met<const D: usize>(mesh: &Mesh<D>, patch: &PatchCells<D>) -> Vec<Option<Met>> {
    let mut met: Vec<Option<Met>> = vec![None; mesh.cell_count()];
    for index in &patch.all {
        for &(c, volume) in &patch.held[index] {
            met[c as usize].get_or_insert_default().inside += volume;
        }
    }
    for face in patch.faces() {
        let plane = patch.node(&face.nodes()[0])[face.axis];
        let near = IN_PLANE * patch.cells.spacing;
        for &(c, _) in &patch.held[&face.neighbour()] {
            let in_plane = |n: &&u32| (mesh.nodes[**n as usize][face.axis] - plane).abs() <= near;
            if mesh.corners(c as usize).iter().filter(in_plane).count() >= D {
                met[c as usize].get_or_insert_default().touches = true;
            }
        }
    }
    met
}

/// Gives straight sides to cells of second order that the patch meets, and makes linear ones of those whose order is not kept.
fn straighten<const D: usize>(mesh: &mut Mesh<D>, met: &[Option<Met>], found: &mut Replaced) {
    let is_met: Vec<bool> = (0..mesh.cell_count())
        .map(|c| met[c].is_some() && mesh.shapes[c].is_quadratic())
        .collect();
    for c in (0..is_met.len()).filter(|&c| is_met[c]) {
        // cells of second order beside it share the sides
        let sides: Vec<_> = mesh.mid_sides(c).collect();
        for side in sides {
            let [p, q] = side.ends.map(|n| mesh.nodes[n as usize]);
            let x = &mut mesh.nodes[side.node as usize];
            let middle = (p + q) * 0.5;
            found.moved = found.moved.max((*x - middle).norm());
            *x = middle;
        }
    }
    let is_simplex = |shape| matches!(shape, CellShape::Line3 | CellShape::Tri6 | CellShape::Tet10);
    let is_linear: Vec<bool> = (is_met.iter().zip(&mesh.shapes))
        .map(|(is_met, &shape)| *is_met && !is_simplex(shape))
        .collect();
    // of those that the patch covers nothing is left
    let is_left = |c: usize| {
        let whole = mesh.cell_volume(c).abs();
        met[c].is_some_and(|met| whole - met.inside > NOTHING * whole)
    };
    found.linear = (0..is_linear.len())
        .filter(|&c| is_linear[c] && is_left(c))
        .count();
    mesh.linearise(|c| is_linear[c]);
}

/// Quadrilaterals and hexahedra to divide: all that the patch cuts or touches, if one of them is neither a parallelogram nor a parallelepiped. Cells that share a cut face have to have the same displacement there.
fn to_divide<const D: usize>(mesh: &Mesh<D>, met: &[Option<Met>]) -> Vec<u32> {
    let is_kind = |shape| matches!(shape, CellShape::Quad4 | CellShape::Hex8);
    let cut = cut_cells(mesh, met, is_kind);
    match cut.iter().all(|&c| has_constant_jacobian(mesh, c as usize)) {
        true => Vec::new(),
        false => cut,
    }
}

/// Cells of some shapes that the patch cuts or touches.
fn cut_cells<const D: usize>(
    mesh: &Mesh<D>,
    met: &[Option<Met>],
    is_kind: impl Fn(CellShape) -> bool,
) -> Vec<u32> {
    let is_cut = |c: &u32| {
        let c = *c as usize;
        let Some(Met { inside, touches }) = met[c].filter(|_| is_kind(mesh.shapes[c])) else {
            return false;
        };
        let whole = mesh.cell_volume(c).abs();
        let part = whole - inside;
        part > NOTHING * whole && (touches || inside > NOTHING * whole)
    };
    (0..met.len() as u32).filter(is_cut).collect()
}
