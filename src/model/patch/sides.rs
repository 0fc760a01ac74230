//! Nodes inside a patch that elements on different sides of it share: each side gets a node of its own.
//!
//! The parts that are left of two elements around such a node hang together if a part of a facet with the node is left between them. Otherwise the shared node would carry displacements through the zone: past a crack, that is a bridge.

use super::{
    cells::{Index, PatchCells, block},
    cuts::Cuts,
    error::PatchError,
};
use crate::{
    mesh::Mesh,
    model::simplex::{facet_simplices, simplices_of},
    parallel,
    tensor::Vector,
};

/// Part of a facet below which nothing is left of it.
const NOTHING: f64 = 1e-9;

/// Distance from a face, in edges of a cell, within which a node lies on it.
const ON_FACE: f64 = 1e-6;

/// A mesh whose elements share no node from one side of a patch to another; its cells are those of the mesh before.
pub(super) struct Sides<const D: usize> {
    /// The mesh; nodes of its own follow those of the mesh before. Its sets are those before.
    pub mesh: Mesh<D>,
    /// Number of nodes of the mesh before.
    before: usize,
    /// The node of the mesh before that each further one is a copy of.
    of_copy: Vec<u32>,
}

impl<const D: usize> Sides<D> {
    pub fn new(mesh: &Mesh<D>, patch: &PatchCells<D>, cuts: &Cuts) -> Self {
        let (offsets, around) = mesh.node_cells();
        let mut nodes: Vec<u32> = (cuts.cut())
            .flat_map(|(c, _)| mesh.cell(c as usize))
            .copied()
            .filter(|&n| is_in(patch, &mesh.nodes[n as usize]))
            .collect();
        nodes.sort_unstable();
        nodes.dedup();
        let groups = parallel::map(nodes.len(), 16, |k| {
            let n = nodes[k] as usize;
            let cells = &around[offsets[n] as usize..offsets[n + 1] as usize];
            let left = cells.iter().copied().filter(|&c| !cuts.is_covered(c));
            groups(mesh, patch, left.collect())
        });
        let mut sides = Self {
            mesh: mesh.clone(),
            before: mesh.nodes.len(),
            of_copy: Vec::new(),
        };
        for (&n, groups) in nodes.iter().zip(&groups) {
            for cells in groups.iter().skip(1) {
                let copy = sides.mesh.nodes.len() as u32;
                sides.mesh.nodes.push(mesh.nodes[n as usize]);
                sides.of_copy.push(n);
                for &c in cells {
                    let own = sides.mesh.offsets[c as usize] as usize
                        ..sides.mesh.offsets[c as usize + 1] as usize;
                    let own = sides.mesh.connectivity[own].iter_mut();
                    own.filter(|m| **m == n).for_each(|m| *m = copy);
                }
            }
        }
        sides
    }

    /// The node of the mesh before.
    pub fn origin(&self, node: u32) -> u32 {
        match (node as usize).checked_sub(self.before) {
            Some(copy) => self.of_copy[copy],
            None => node,
        }
    }

    /// The node of the mesh before with its copies.
    pub fn copies(&self, node: u32) -> impl Iterator<Item = u32> {
        let first = self.before as u32;
        let copies = (first..).zip(&self.of_copy).filter(move |c| *c.1 == node);
        std::iter::once(node).chain(copies.map(|c| c.0))
    }

    /// The nodes that a cell has for those of the mesh before.
    pub fn of_cell(&self, before: &Mesh<D>, cell: u32, nodes: &[u32]) -> Vec<u32> {
        let (old, new) = (before.cell(cell as usize), self.mesh.cell(cell as usize));
        let own = |n: &u32| old.iter().position(|m| m == n).map_or(*n, |k| new[k]);
        nodes.iter().map(own).collect()
    }
}

/// Returns true if a place lies in the patch or on a face of it.
fn is_in<const D: usize>(patch: &PatchCells<D>, x: &Vector<D>) -> bool {
    let mut around = block([0; D], [1; D]);
    around.any(|corner| {
        let off = Vector::from_fn(|i, _| ON_FACE * f64::from(2 * corner[i] - 1));
        let index = patch.cells.index(&(x + off * patch.cells.spacing));
        patch.all.contains(&index)
    })
}

/// Cells around a node in groups that hang together beside the patch.
fn groups<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    mut rest: Vec<u32>,
) -> Vec<Vec<u32>> {
    let mut groups = Vec::new();
    while !rest.is_empty() {
        let mut group = vec![rest.remove(0)];
        let mut k = 0;
        while k < group.len() {
            let own = mesh.corners(group[k] as usize);
            rest.retain(|&c| {
                let shared = mesh.corners(c as usize).iter().copied();
                let shared: Vec<u32> = shared.filter(|n| own.contains(n)).collect();
                let is_beside = shared.len() >= D && is_left(mesh, patch, &shared);
                if is_beside {
                    group.push(c);
                }
                !is_beside
            });
            k += 1;
        }
        groups.push(group);
    }
    groups
}

/// Returns true if a part of a facet lies outside of the patch.
fn is_left<const D: usize>(mesh: &Mesh<D>, patch: &PatchCells<D>, facet: &[u32]) -> bool {
    let (mut whole, mut left) = (0.0, 0.0);
    for simplex in facet_simplices(mesh, facet) {
        (patch.cells).dice(&simplex, &|_, _| true, &mut |index, part| {
            whole += part.size();
            if !patch.all.contains(&index) {
                left += part.size();
            }
        });
    }
    left > NOTHING * whole
}

/// Refuses elements of which parts are left on different sides of the patch: parts that do not hang together among the elements around, as they do at a corner of it.
pub(super) fn check_elements<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    cuts: &Cuts,
) -> Result<(), PatchError> {
    let around = mesh.node_cells();
    let cells: Vec<u32> = cuts.cut().map(|(c, _)| c).collect();
    let spans = parallel::map(cells.len(), 8, |k| {
        let parts = parts_left(mesh, patch, cells[k]);
        parts.len() > 1 && !hang_together(mesh, patch, cuts, &around, (cells[k], &parts))
    });
    match spans.iter().position(|spans| *spans) {
        None => Ok(()),
        Some(k) => Err(PatchError::Spans {
            position: mesh.centroid(cells[k] as usize).iter().copied().collect(),
        }),
    }
}

/// Cells of the lattice outside of the patch in which parts of an element lie, in groups that touch.
fn parts_left<const D: usize>(mesh: &Mesh<D>, patch: &PatchCells<D>, c: u32) -> Vec<Vec<Index<D>>> {
    let mut rest: Vec<Index<D>> = Vec::new();
    for simplex in simplices_of(mesh, c as usize) {
        (patch.cells).dice(&simplex, &|_, _| true, &mut |index, _| {
            if !patch.all.contains(&index) {
                rest.push(index);
            }
        });
    }
    rest.sort_unstable();
    rest.dedup();
    let mut parts = Vec::new();
    while let Some(first) = rest.pop() {
        let mut part = vec![first];
        let mut k = 0;
        while k < part.len() {
            let at = part[k];
            rest.retain(|other| {
                let is_beside = (0..D).all(|i| (other[i] - at[i]).abs() <= 1);
                if is_beside {
                    part.push(*other);
                }
                !is_beside
            });
            k += 1;
        }
        parts.push(part);
    }
    parts
}

/// Returns true if the parts of an element hang together through what is left of the elements around it.
fn hang_together<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    cuts: &Cuts,
    (offsets, around): &(Vec<u32>, Vec<u32>),
    (c, parts): (u32, &[Vec<Index<D>>]),
) -> bool {
    let corners = mesh.corners(c as usize);
    let of_node =
        |&n: &u32| &around[offsets[n as usize] as usize..offsets[n as usize + 1] as usize];
    let mut ring: Vec<u32> = corners.iter().flat_map(of_node).copied().collect();
    ring.sort_unstable();
    ring.dedup();
    ring.retain(|&other| other != c && !cuts.is_covered(other));
    let facet_with = |own: &[u32], other: u32| -> Option<Vec<u32>> {
        let shared = mesh.corners(other as usize).iter().copied();
        let shared: Vec<u32> = shared.filter(|n| own.contains(n)).collect();
        (shared.len() >= D).then_some(shared)
    };
    // the elements of the ring beside each part
    let beside = |part: &[Index<D>]| -> Vec<u32> {
        let touches = |facet: &[u32]| {
            let mut touches = false;
            for simplex in facet_simplices(mesh, facet) {
                (patch.cells).dice(&simplex, &|_, _| true, &mut |index, _| {
                    touches |= part.contains(&index);
                });
            }
            touches
        };
        let is_beside = |other: &u32| facet_with(corners, *other).is_some_and(|f| touches(&f));
        ring.iter().copied().filter(is_beside).collect()
    };
    let mut reached = beside(&parts[0]);
    let mut k = 0;
    while k < reached.len() {
        let own = mesh.corners(reached[k] as usize);
        for &other in &ring {
            let is_new = !reached.contains(&other);
            if is_new && facet_with(own, other).is_some_and(|f| is_left(mesh, patch, &f)) {
                reached.push(other);
            }
        }
        k += 1;
    }
    let mut others = parts[1..].iter();
    others.all(|part| beside(part).iter().any(|other| reached.contains(other)))
}
