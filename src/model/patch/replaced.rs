//! Cells that a patch replaces before it cuts: those of second order that it meets by linear ones with straight sides, and quadrilaterals that it may not cut by two triangles.
//!
//! The sides of a quadrilateral are straight, as those of its triangles are: the cells beside it stay as they are, and affine fields exact.

use std::borrow::Cow;

use super::{
    cells::PatchCells,
    cuts::{NOTHING, may_be_cut},
};
use crate::{
    mesh::{CellShape, Mesh},
    tensor::Vector,
};

/// Cells that were replaced.
#[derive(Clone, Debug, Default)]
pub struct Replaced {
    /// Number of cells of second order that became linear.
    pub linear: usize,
    /// Distance \[m\] by which nodes in the middle of their edges moved, at most: that of a curved side from a straight one.
    pub moved: f64,
    /// Quadrilaterals that became two triangles, ascending: the first has the number of the quadrilateral, the second ones are the last cells, in this order.
    pub halved: Vec<u32>,
    /// Number of cells before.
    before: usize,
}

impl Replaced {
    /// The cell of the mesh before that a cell is, or is a half of.
    pub(super) fn origin(&self, c: u32) -> u32 {
        match (c as usize).checked_sub(self.before) {
            Some(second) => self.halved[second],
            None => c,
        }
    }
}

/// The mesh with what replaces cells that the patch meets, and the patch in that mesh.
pub(super) fn replaced<'m, const D: usize>(
    mesh: &'m Mesh<D>,
    patch: &'m PatchCells<D>,
) -> (Cow<'m, Mesh<D>>, Cow<'m, PatchCells<D>>, Replaced) {
    let mut found = Replaced {
        before: mesh.cell_count(),
        ..Replaced::default()
    };
    let (mut mesh, mut patch) = (Cow::Borrowed(mesh), Cow::Borrowed(patch));
    let inside = inside(&mesh, &patch);
    if mesh.has_quadratic_cells() {
        straighten(mesh.to_mut(), &inside, &mut found);
    }
    found.halved = (0..found.before as u32)
        .filter(|&c| to_halve(&mesh, c as usize, inside[c as usize]))
        .collect();
    if !found.halved.is_empty() {
        halve(mesh.to_mut(), &found.halved);
        patch = Cow::Owned(patch.in_halves(&mesh, &found.halved));
    }
    (mesh, patch, found)
}

/// Volume of each cell in the patch, none of those that it does not meet.
fn inside<const D: usize>(mesh: &Mesh<D>, patch: &PatchCells<D>) -> Vec<Option<f64>> {
    let mut inside = vec![None; mesh.cell_count()];
    for index in &patch.all {
        for &(c, volume) in &patch.held[index] {
            *inside[c as usize].get_or_insert(0.0) += volume;
        }
    }
    inside
}

/// Makes linear cells, of straight sides, of those of second order that the patch meets.
fn straighten<const D: usize>(mesh: &mut Mesh<D>, inside: &[Option<f64>], found: &mut Replaced) {
    let is_met: Vec<bool> = (0..mesh.cell_count())
        .map(|c| inside[c].is_some() && mesh.shapes[c].is_quadratic())
        .collect();
    for c in (0..is_met.len()).filter(|&c| is_met[c]) {
        found.linear += 1;
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
    mesh.linearise(|c| is_met[c]);
}

/// Returns true if a cell, of which this volume lies in the patch, is a quadrilateral that has to be two triangles.
fn to_halve<const D: usize>(mesh: &Mesh<D>, c: usize, inside: Option<f64>) -> bool {
    let Some(inside) = inside.filter(|_| mesh.shapes[c] == CellShape::Quad4) else {
        return false;
    };
    let whole = mesh.cell_volume(c).abs();
    inside.min(whole - inside) > NOTHING * whole && !may_be_cut(mesh, c)
}

/// Makes two triangles of quadrilaterals; sets of cells hold both.
fn halve<const D: usize>(mesh: &mut Mesh<D>, cells: &[u32]) {
    let old = std::mem::take(&mut mesh.connectivity);
    let ends = std::mem::take(&mut mesh.offsets);
    let shapes = std::mem::take(&mut mesh.shapes);
    mesh.offsets.push(0);
    let mut second = Vec::new();
    for (c, shape) in shapes.into_iter().enumerate() {
        let nodes = &old[ends[c] as usize..ends[c + 1] as usize];
        if cells.binary_search(&(c as u32)).is_err() {
            mesh.push_cell(shape, nodes);
            continue;
        }
        let halves = halves(mesh, nodes);
        mesh.push_cell(CellShape::Tri3, &halves[0]);
        second.push(halves[1]);
    }
    let first = mesh.cell_count() as u32;
    for nodes in second {
        mesh.push_cell(CellShape::Tri3, &nodes);
    }
    for set in mesh.cell_sets.values_mut() {
        let held = set.iter().filter_map(|c| cells.binary_search(c).ok());
        let held: Vec<u32> = held.map(|k| first + k as u32).collect();
        set.extend(held);
    }
}

/// The two triangles of a quadrilateral whose smallest angle is the larger; where a corner points inwards, one of the other two would be negative.
fn halves<const D: usize>(mesh: &Mesh<D>, corners: &[u32]) -> [[u32; 3]; 2] {
    let at = |places: [usize; 3]| places.map(|i| corners[i]);
    let pairs = [
        [at([0, 1, 2]), at([0, 2, 3])],
        [at([1, 2, 3]), at([1, 3, 0])],
    ];
    let least = |pair: &[[u32; 3]; 2]| {
        let x = |triangle: &[u32; 3]| triangle.map(|n| mesh.nodes[n as usize]);
        pair.iter()
            .map(|triangle| smallest_angle(x(triangle)))
            .fold(f64::INFINITY, f64::min)
    };
    match least(&pairs[0]) >= least(&pairs[1]) {
        true => pairs[0],
        false => pairs[1],
    }
}

/// The smallest angle of a triangle, negative where its corners are clockwise.
fn smallest_angle<const D: usize>(x: [Vector<D>; 3]) -> f64 {
    let angle = |i: usize| {
        let (a, b) = (x[(i + 1) % 3] - x[i], x[(i + 2) % 3] - x[i]);
        (a[0] * b[1 % D] - b[0] * a[1 % D]).atan2(a.dot(&b))
    };
    angle(0).min(angle(1)).min(angle(2))
}
