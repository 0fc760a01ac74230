//! Zone, rim, and what is left of the elements of a mesh as one mesh: cells of the patch first, then those that are left; nodes of the mesh that are left first, then those of the patch.

use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::FxHashSet;

use super::{
    NodeRow, Patched,
    cells::{Index, PatchCells, block},
    cuts::Cuts,
    gathered,
};
use crate::{
    fem::Locator,
    mesh::{CellShape, Covered, Facet, Mesh, facet_corners},
    model::simplex::facet_simplices,
};

/// Distance of a facet from its cell's inside at which its cells of the lattice are sought, over the way to the cell's middle.
const INWARDS: f64 = 1e-6;

const NONE: u32 = u32::MAX;

/// A mesh with its patch, but for the nodes that follow others.
pub(super) struct Composite<const D: usize> {
    patched: Patched<D>,
    /// New numbers of the nodes of the mesh; [`NONE`] where none of its cells is left.
    node: Vec<u32>,
    /// Numbers of the nodes of the patch.
    node_of_patch: BTreeMap<Index<D>, u32>,
}

impl<const D: usize> Composite<D> {
    pub fn new(before: &Mesh<D>, patch: &PatchCells<D>, cuts: &Cuts) -> Self {
        let mut mesh = Mesh::<D> {
            notes: before.notes.clone(),
            ..Mesh::default()
        };
        let left: Vec<u32> = (0..before.cell_count() as u32)
            .filter(|&c| !cuts.is_covered(c))
            .collect();
        let mut node = vec![NONE; before.nodes.len()];
        for &n in left.iter().flat_map(|&c| before.cell(c as usize)) {
            node[n as usize] = 0;
        }
        for (number, x) in node.iter_mut().zip(&before.nodes).filter(|n| *n.0 == 0) {
            *number = mesh.nodes.len() as u32;
            mesh.nodes.push(*x);
        }
        mesh.embedded.covered = Covered {
            corner: patch.node(&[0; D]),
            edge: patch.cells.spacing,
            cells: patch.all.iter().copied().collect(),
        };
        let mut node_of_patch = BTreeMap::new();
        for index in &patch.all {
            for corner in block(*index, index.map(|i| i + 1)) {
                node_of_patch.entry(corner).or_insert_with(|| {
                    mesh.nodes.push(patch.node(&corner));
                    mesh.nodes.len() as u32 - 1
                });
            }
        }
        let mut nonlocal = Vec::new();
        let mut origin = Vec::new();
        let locator = Locator::new(before, 0..before.cell_count());
        for index in &patch.all {
            mesh.push_cell(shape::<D>(), &corners(index, &node_of_patch));
            nonlocal.push(patch.zone.contains(index));
            let largest = patch.held[index].iter().max_by(|a, b| a.1.total_cmp(&b.1));
            let middle = locator.locate(before, &patch.cells.centre(index), 1e-9);
            origin.push(middle.map_or_else(
                || largest.map_or(0, |part| part.0),
                |found| found.cell as u32,
            ));
        }
        let of_patch = origin.len();
        let mut cell = vec![NONE; before.cell_count()];
        for &c in &left {
            cell[c as usize] = origin.len() as u32;
            if let Some(rule) = cuts.rule(c) {
                mesh.embedded.cut.insert(origin.len() as u32, rule.clone());
            }
            let nodes: Vec<u32> = (before.cell(c as usize).iter())
                .map(|&n| node[n as usize])
                .collect();
            mesh.push_cell(before.shapes[c as usize], &nodes);
            origin.push(c);
            nonlocal.push(false);
        }
        let mut composite = Self {
            patched: Patched {
                rim: patch.all.len() - patch.zone.len(),
                mesh,
                nonlocal,
                origin,
                covered: FxHashSet::default(),
            },
            node,
            node_of_patch,
        };
        composite.hide_facets(before, patch, cuts, &left);
        composite.carry_sets(before, (&cell, of_patch));
        composite
    }

    /// Takes the faces of the rim, and those that cells have lost the neighbour of, out of the surface.
    fn hide_facets(
        &mut self,
        before: &Mesh<D>,
        patch: &PatchCells<D>,
        cuts: &Cuts,
        left: &[u32],
    ) {
        let embedded = &mut self.patched.mesh.embedded;
        for face in patch.faces() {
            let nodes: Vec<u32> = (face.nodes().iter())
                .map(|n| self.node_of_patch[n])
                .collect();
            embedded.hide(&nodes);
        }
        let renumbered = |facet: &Facet| -> Vec<u32> {
            let corners = facet_corners::<D>(facet).iter();
            corners.map(|&n| self.node[n as usize]).collect()
        };
        let mut lost: BTreeSet<Vec<u32>> = (before
            .boundary_facets(left.iter().copied()))
            .iter()
            .map(|facet| sorted(renumbered(&facet.nodes)))
            .collect();
        for facet in before.outer_facets() {
            lost.remove(&sorted(renumbered(&facet.nodes)));
            let cell = facet.cell;
            if cuts.is_met(cell) && is_met(before, patch, &facet.nodes, cell as usize) {
                let corners = facet_corners::<D>(&facet.nodes).to_vec();
                self.patched.covered.insert(sorted(corners));
            }
        }
        lost.iter().for_each(|corners| embedded.hide(corners));
    }

    /// Carries the named sets over: cells and nodes that are left, the cells of the patch in sets of cells, and facets of cells that are left.
    fn carry_sets(
        &mut self,
        before: &Mesh<D>,
        (cell, of_patch): (&[u32], usize),
    ) {
        let mesh = &mut self.patched.mesh;
        for (name, set) in &before.cell_sets {
            let mut held = vec![false; before.cell_count()];
            set.iter().for_each(|&c| held[c as usize] = true);
            let of_patch = (0..of_patch).filter(|&c| held[self.patched.origin[c] as usize]);
            let own = (set.iter()).filter_map(|&c| (cell[c as usize] != NONE).then_some(cell[c as usize]));
            let all = of_patch.map(|c| c as u32).chain(own).collect();
            mesh.cell_sets.insert(name.clone(), all);
        }
        let kept = |n: &u32| (self.node[*n as usize] != NONE).then_some(self.node[*n as usize]);
        for (name, set) in &before.node_sets {
            mesh.node_sets.insert(name.clone(), set.iter().filter_map(kept).collect());
        }
        let surface: BTreeMap<Vec<u32>, u32> = (before.outer_facets().into_iter())
            .map(|facet| (sorted(facet_corners::<D>(&facet.nodes).to_vec()), facet.cell))
            .collect();
        for (name, set) in &before.facet_sets {
            let own = set.iter().filter_map(|facet| {
                let owner = surface.get(&sorted(facet_corners::<D>(facet).to_vec()));
                let nodes: Option<Facet> = facet.iter().map(kept).collect();
                nodes.filter(|_| owner.is_none_or(|&c| cell[c as usize] != NONE))
            });
            mesh.facet_sets.insert(name.clone(), own.collect());
        }
    }

    /// The mesh with the nodes that follow others: those of elements that are nearly gone by `bad`, in numbers of the mesh before, those of Γ by `rows`.
    pub fn with_followers(
        self,
        bad: &BTreeMap<u32, NodeRow>,
        rows: &BTreeMap<Index<D>, NodeRow>,
    ) -> Patched<D> {
        let mut patched = self.patched;
        let renumbered = |row: &NodeRow| -> NodeRow {
            let followed = row.iter().flat_map(|&(n, w)| match bad.get(&n) {
                Some(others) => others.iter().map(|&(m, v)| (m, v * w)).collect(),
                None => vec![(n, w)],
            });
            gathered(followed.map(|(n, w)| (self.node[n as usize], w)))
        };
        let followers = &mut patched.mesh.embedded.followers;
        for (&n, row) in bad {
            followers.insert(self.node[n as usize], renumbered(row));
        }
        for (node, row) in rows {
            followers.insert(self.node_of_patch[node], renumbered(row));
        }
        patched
    }
}

/// The shape of a cell of the lattice.
fn shape<const D: usize>() -> CellShape {
    [CellShape::Line2, CellShape::Quad4, CellShape::Hex8][D - 1]
}

/// The nodes of a cell of the lattice, in the order of its shape.
fn corners<const D: usize>(index: &Index<D>, node: &BTreeMap<Index<D>, u32>) -> Vec<u32> {
    const ORDER: [[i32; 3]; 8] = [
        [0, 0, 0],
        [1, 0, 0],
        [1, 1, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 0, 1],
        [1, 1, 1],
        [0, 1, 1],
    ];
    (ORDER[..1 << D].iter())
        .map(|corner| node[&std::array::from_fn(|i| index[i] + corner[i])])
        .collect()
}

fn sorted(mut corners: Vec<u32>) -> Vec<u32> {
    corners.sort_unstable();
    corners
}

/// Returns true if the patch covers some of a facet of a cell.
fn is_met<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    facet: &[u32],
    cell: usize,
) -> bool {
    let middle = mesh.centroid(cell);
    let mut is_met = false;
    for simplex in facet_simplices(mesh, facet) {
        let moved = simplex.drawn_to(&middle, INWARDS);
        patch.cells.dice(&moved, &|_, _| true, &mut |index, _| {
            is_met |= patch.all.contains(&index);
        });
    }
    is_met
}
