//! Cells of second order that a patch meets: linear, with straight sides.

use std::borrow::Cow;

use super::cells::PatchCells;
use crate::mesh::Mesh;

/// Cells of second order that became linear.
#[derive(Clone, Copy, Debug, Default)]
pub struct Linear {
    /// Their number.
    pub cells: usize,
    /// Distance \[m\] by which nodes in the middle of their edges moved, at most: that of a curved side from a straight one.
    pub moved: f64,
}

/// The mesh with linear cells, of straight sides, instead of those of second order that the patch meets.
pub(super) fn linear_at<'m, const D: usize>(
    mesh: &'m Mesh<D>,
    patch: &PatchCells<D>,
) -> (Cow<'m, Mesh<D>>, Linear) {
    if !mesh.has_quadratic_cells() {
        return (Cow::Borrowed(mesh), Linear::default());
    }
    let mut is_met = vec![false; mesh.cell_count()];
    for index in &patch.all {
        for &(c, _) in &patch.held[index] {
            is_met[c as usize] |= mesh.shapes[c as usize].is_quadratic();
        }
    }
    let mut linear = mesh.clone();
    let mut found = Linear::default();
    for c in (0..is_met.len()).filter(|&c| is_met[c]) {
        found.cells += 1;
        // cells of second order beside it share the sides
        for side in mesh.mid_sides(c) {
            let [p, q] = side.ends.map(|n| mesh.nodes[n as usize]);
            let x = &mut linear.nodes[side.node as usize];
            let middle = (p + q) * 0.5;
            found.moved = found.moved.max((*x - middle).norm());
            *x = middle;
        }
    }
    linear.linearise(|c| is_met[c]);
    (Cow::Owned(linear), found)
}
