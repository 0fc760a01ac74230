//! Cells of second order beside peridynamic points: at the seam all cells are linear, farther away they are as the mesh has them.
//!
//! Forces of points on a seam are sampled on a lattice. A mid-side node of a face has two thirds of the face's load and moves alone, so that a force which is right for the whole face overloads it.
//! Cells that hold points, carry a partial stress, or share a node with such cells are therefore made linear. The nodes in the middle of the edges that they share with cells of second order follow the ends of these edges,
//! in displacement and, by the principle of virtual work, in force: the rows of the ends take half of the row of the node each. Nothing parts, and every affine field stays exact.

use rustc_hash::FxHashMap;

use crate::{
    mesh::Mesh,
    model::{CellRole, ModelError},
    tensor::Vector,
};

/// Tolerance on the distance of a mid-side node from the middle of its edge, over the edge's length, where a cell is made linear.
const STRAIGHT: f64 = 1e-6;

/// Makes linear all cells at the seam.
///
/// # Errors
/// [`ModelError::CurvedSeam`] where such a cell has a side that is not straight, or not halved.
pub(crate) fn linear_at_seam<const D: usize>(
    mut mesh: Mesh<D>,
    roles: &[CellRole],
) -> Result<Mesh<D>, ModelError> {
    if roles.iter().all(|&role| role == CellRole::Element) || !mesh.has_quadratic_cells() {
        return Ok(mesh);
    }
    let mut at_seam = vec![false; mesh.nodes.len()];
    for (c, _) in (roles.iter().enumerate()).filter(|(_, role)| **role != CellRole::Element) {
        for &n in mesh.corners(c) {
            at_seam[n as usize] = true;
        }
    }
    let near: Vec<bool> = (0..mesh.cell_count())
        .map(|c| mesh.corners(c).iter().any(|&n| at_seam[n as usize]))
        .collect();
    for c in (0..near.len()).filter(|&c| near[c]) {
        if let Some((x, distance)) = bent_side(&mesh, c) {
            return Err(ModelError::CurvedSeam {
                cell: c,
                shape: mesh.shapes[c],
                position: x.iter().copied().collect(),
                distance,
            });
        }
    }
    mesh.linearise(|c| near[c]);
    Ok(mesh)
}

/// A node of a cell that lies off the middle of its edge, with its distance from there over the length of the edge, if there is one.
fn bent_side<const D: usize>(mesh: &Mesh<D>, c: usize) -> Option<(Vector<D>, f64)> {
    mesh.mid_sides(c).find_map(|side| {
        let [x, p, q] = [side.node, side.ends[0], side.ends[1]].map(|n| mesh.nodes[n as usize]);
        let distance = (x - (p + q) * 0.5).norm() / (q - p).norm();
        // also what is no number
        (distance.is_nan() || distance > STRAIGHT).then_some((x, distance))
    })
}

/// Nodes that follow others: in the middle of an edge the ends of this, around an embedded patch the nodes beyond its edge.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ties {
    followed: FxHashMap<u32, Vec<(u32, f64)>>,
    followers: FxHashMap<u32, Vec<(u32, f64)>>,
}

impl Ties {
    pub fn new<const D: usize>(mesh: &Mesh<D>) -> Self {
        let mut ties = Self::default();
        let followed = &mesh.embedded.followers;
        let tied = mesh.ties();
        let middles: FxHashMap<u32, [u32; 2]> =
            tied.iter().map(|tie| (tie.node, tie.ends)).collect();
        let halves = |n: u32| middles[&n].map(|end| (end, 0.5));
        let through = |(n, w): (u32, f64)| match followed.get(&n) {
            Some(others) => others.iter().map(|&(other, v)| (other, v * w)).collect(),
            None => vec![(n, w)],
        };
        for (&node, followed) in followed {
            // an element of second order that a node follows may have such a middle itself
            let row = followed
                .iter()
                .flat_map(|&(n, w)| match middles.contains_key(&n) {
                    true => halves(n).map(|(end, v)| (end, v * w)).to_vec(),
                    false => vec![(n, w)],
                });
            ties.add(node, row.collect());
        }
        for tie in &tied {
            ties.add(
                tie.node,
                halves(tie.node).into_iter().flat_map(through).collect(),
            );
        }
        ties
    }

    fn add(&mut self, node: u32, followed: Vec<(u32, f64)>) {
        for &(other, weight) in &followed {
            self.followers
                .entry(other)
                .or_default()
                .push((node, weight));
        }
        self.followed.insert(node, followed);
    }

    /// The nodes that a node follows, with their weights; none if it is free.
    pub fn followed(&self, node: u32) -> Option<&[(u32, f64)]> {
        match self.followed.is_empty() {
            true => None,
            false => self.followed.get(&node).map(Vec::as_slice),
        }
    }

    /// The nodes that follow a node, with its weight in each.
    pub fn followers(&self, node: u32) -> &[(u32, f64)] {
        if self.followers.is_empty() {
            return &[];
        }
        self.followers.get(&node).map_or(&[], Vec::as_slice)
    }

    /// The row of a node that follows sites, from the site of each node (`u32::MAX` for none); `None` if it is free, or follows a node that is no site.
    pub fn row(&self, node: u32, node_site: &[u32]) -> Option<Vec<(u32, f64)>> {
        let followed = self.followed(node)?.iter();
        let row = followed.map(|&(n, w)| (node_site[n as usize], w));
        row.map(|(site, w)| (site != u32::MAX).then_some((site, w)))
            .collect()
    }
}
