//! Cells at the cracks and voids that the scene cuts out of the body, and at the mesh's own notches.

use crate::mesh::Mesh;
use crate::scene::draft::Draft;
use crate::scene::error::SceneError;
use crate::scene::region;

/// Distance from a crack, in sizes of a cell, within which centroids of cut cells lie: below half a diagonal a path of cut cells would have gaps.
const CUT_WITHIN: f64 = 0.71;

/// Cells at cracks, voids and notches, without their padding.
pub(super) struct Marked {
    pub cracks: Vec<bool>,
    pub voids: Vec<bool>,
    /// At notches of the mesh.
    pub notches: Vec<bool>,
    /// True if bonds break, so that notches are nonlocal whatever the displacement.
    pub breaks: bool,
    /// Cells that carry next to nothing in the finite-element solution.
    pub cut: Vec<bool>,
}

impl Marked {
    /// Cells that are nonlocal whatever the displacement.
    pub(super) fn shapes(&self) -> Vec<bool> {
        let all = self.cracks.iter().zip(&self.voids).zip(&self.notches);
        all.map(|((c, v), n)| *c || *v || (*n && self.breaks))
            .collect()
    }
}

/// Size of a cell.
fn size<const D: usize>(mesh: &Mesh<D>, c: usize) -> f64 {
    mesh.cell_volume(c).abs().powf(1.0 / D as f64)
}

/// Cells that have one of these nodes.
pub(super) fn touching<const D: usize>(
    mesh: &Mesh<D>,
    nodes: impl IntoIterator<Item = u32>,
) -> Vec<bool> {
    let mut flag = vec![false; mesh.nodes.len()];
    nodes.into_iter().for_each(|n| flag[n as usize] = true);
    (0..mesh.cell_count())
        .map(|c| mesh.cell(c).iter().any(|&n| flag[n as usize]))
        .collect()
}

/// Cells at cracks, voids and notches of the mesh.
pub(super) fn marked<const D: usize>(scene: &Draft<'_, D>) -> Result<Marked, SceneError> {
    let (spec, mesh) = (scene.spec, &scene.mesh);
    let count = mesh.cell_count();
    let mut marked = Marked {
        cracks: vec![false; count],
        voids: vec![false; count],
        notches: touching(mesh, mesh.notches()),
        breaks: scene.materials.iter().any(|m| m.fracture.is_some()),
        cut: vec![false; count],
    };
    for (name, c) in &spec.cracks {
        let shape = region::shape(&format!("cracks.{name}"), c, mesh, &name.span)?;
        for c in 0..count {
            if shape.signed_distance(&mesh.centroid(c)) <= CUT_WITHIN * size(mesh, c) {
                marked.cracks[c] = true;
                marked.cut[c] = true;
            }
        }
    }
    for (name, v) in &spec.voids {
        let place = format!("voids.{name}.inside");
        let shape = region::shape(&place, &v.inside, mesh, &name.span)?;
        for c in 0..count {
            let distance = shape.signed_distance(&mesh.centroid(c));
            marked.voids[c] |= distance <= CUT_WITHIN * size(mesh, c);
            marked.cut[c] |= distance <= 0.0;
        }
    }
    Ok(marked)
}
