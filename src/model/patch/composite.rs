//! Zone, rim, and what is left of the elements of a mesh as one mesh: cells of the patch first, then those that are left; nodes of the mesh that are left first, then those of the patch.

use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::FxHashSet;

use super::{
    cells::{Face, Index, PatchCells, block},
    cuts::Cuts,
    moments::PartMoments,
    replaced::Replaced,
    rows::{Place, Rows},
    sides::Sides,
    surface::PatchSurface,
};
use crate::{
    fem,
    mesh::{CellShape, Covered, CutFacet, Facet, Mesh, boundary::BoundaryFacet, facet_corners},
};

/// Part of a face of the patch that may be outside a set of facets which holds it, by rounding.
const HELD: f64 = 1e-6;

const NONE: u32 = u32::MAX;

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
    /// Facets of which a part crosses elements of the rim: their corners in the mesh before, sorted.
    pub crossed: FxHashSet<Vec<u32>>,
    /// Nodes of the mesh before no cell of which is left.
    pub dropped: FxHashSet<u32>,
    /// Named sets of facets that hold a part of a face of the patch.
    pub torn: FxHashSet<String>,
    /// Cells of the rim.
    pub rim: usize,
    /// Cells of the lattice in the zone that are elements, since the surface of the body is near.
    pub skin: usize,
    /// Cells of the lattice in the zone that are elements, since the rim was kept off places near.
    pub kept_off: usize,
    /// Cells that were replaced before the patch cut them.
    pub replaced: Replaced,
}

/// A mesh with its patch, but for the nodes that follow others.
pub(super) struct Composite<'s, const D: usize> {
    pub patched: Patched<D>,
    /// The mesh before with a node for each side of the patch.
    sides: &'s Sides<D>,
    /// New numbers of its nodes; [`NONE`] where none of its cells is left.
    node: Vec<u32>,
    /// Numbers of the nodes of the patch.
    node_of_patch: BTreeMap<Index<D>, u32>,
}

impl<'s, const D: usize> Composite<'s, D> {
    // One function: cells and nodes are numbered in the order in which they are added.
    pub fn new(
        (before, sides): (&Mesh<D>, &'s Sides<D>),
        patch: &PatchCells<D>,
        cuts: &Cuts,
    ) -> Self {
        let mut mesh = Mesh::<D> {
            notes: before.notes.clone(),
            ..Mesh::default()
        };
        let left: Vec<u32> = (0..before.cell_count() as u32)
            .filter(|&c| !cuts.is_covered(c))
            .collect();
        let mut node = vec![NONE; sides.mesh.nodes.len()];
        for &n in left.iter().flat_map(|&c| sides.mesh.cell(c as usize)) {
            node[n as usize] = 0;
        }
        let all = node.iter_mut().zip(&sides.mesh.nodes);
        for (number, x) in all.filter(|n| *n.0 == 0) {
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
        let (mut nonlocal, mut origin) = (Vec::new(), Vec::new());
        for index in &patch.all {
            mesh.push_cell(shape::<D>(), &corners(index, &node_of_patch));
            nonlocal.push(patch.zone.contains(index));
            let largest = patch.held[index].iter().max_by(|a, b| a.1.total_cmp(&b.1));
            origin.push(largest.map_or(0, |part| part.0));
        }
        cut_patch_cells(before, patch, &mut mesh);
        let of_patch = origin.len();
        let mut cell = vec![NONE; before.cell_count()];
        for &c in &left {
            cell[c as usize] = origin.len() as u32;
            if let Some(rule) = cuts.rule(c) {
                let number = origin.len() as u32;
                mesh.embedded.cut.insert(number, rule.clone());
                if before.embedded.is_divided(c as usize) {
                    mesh.embedded.divided.insert(number);
                }
            }
            let nodes: Vec<u32> = (sides.mesh.cell(c as usize).iter())
                .map(|&n| node[n as usize])
                .collect();
            mesh.push_cell(before.shapes[c as usize], &nodes);
            origin.push(c);
            nonlocal.push(false);
        }
        let mut composite = Self {
            patched: Patched {
                rim: patch.all.len() - patch.zone.len(),
                skin: 0,
                kept_off: 0,
                replaced: Replaced::default(),
                mesh,
                nonlocal,
                origin,
                covered: FxHashSet::default(),
                torn: FxHashSet::default(),
                crossed: FxHashSet::default(),
                dropped: (0..before.nodes.len() as u32)
                    .filter(|&n| node[n as usize] == NONE)
                    .collect(),
            },
            sides,
            node,
            node_of_patch,
        };
        let surface = PatchSurface::new(before, patch, cuts);
        let crossing = surface.parts.iter().filter(|part| patch.is_rim(&part.1));
        composite.patched.crossed = crossing.map(|part| part.0.clone()).collect();
        composite.hide_facets(before, patch, &surface, &left);
        let crossing = composite.add_surface(patch, &surface);
        composite.carry_sets(before, (&cell, of_patch));
        composite.carry_facets(before, patch, (&surface, &crossing), &cell);
        composite
    }

    /// Takes out of the surface the faces of the patch that are none of the body, those that cells have lost the neighbour of, and what the patch covers.
    fn hide_facets(
        &mut self,
        before: &Mesh<D>,
        patch: &PatchCells<D>,
        surface: &PatchSurface<D>,
        left: &[u32],
    ) {
        let embedded = &mut self.patched.mesh.embedded;
        let size = patch.cells.spacing.powi(D as i32 - 1);
        for face in patch.outer_faces() {
            let nodes: Vec<u32> = (face.nodes().iter())
                .map(|n| self.node_of_patch[n])
                .collect();
            match surface.faces.get(&face) {
                None => embedded.hide(&nodes),
                Some(part) if part.size < (1.0 - HELD) * size => {
                    let part = CutFacet {
                        rule: part.rule(),
                        is_divided: false,
                    };
                    embedded.cut_facet_to(&nodes, part);
                }
                Some(_) => {}
            }
        }
        let renumbered = |cell: u32, facet: &Facet| -> Vec<u32> {
            let corners = self.sides.of_cell(before, cell, facet_corners::<D>(facet));
            corners.iter().map(|&n| self.node[n as usize]).collect()
        };
        // also those between sides of the patch, which it covers
        let cut_off = (self.sides.mesh).boundary_facets(left.iter().copied());
        let mut lost: BTreeSet<Vec<u32>> = (cut_off.iter())
            .map(|facet| {
                let corners = facet_corners::<D>(&facet.nodes).iter();
                sorted(corners.map(|&n| self.node[n as usize]).collect())
            })
            .collect();
        for facet in before.outer_facets() {
            lost.remove(&sorted(renumbered(facet.cell, &facet.nodes)));
        }
        for (corners, facet) in &surface.met {
            let own: Facet = renumbered(facet.cell, corners);
            match facet.is_gone {
                true => embedded.hide(&own),
                false => {
                    let part = CutFacet {
                        rule: facet.left.iter().flat_map(PartMoments::rule).collect(),
                        is_divided: before.embedded.is_divided(facet.cell as usize),
                    };
                    embedded.cut_facet_to(&own, part);
                }
            }
            self.patched.covered.insert(corners.clone());
        }
        lost.iter().for_each(|corners| embedded.hide(corners));
    }

    /// Adds the surface that crosses cells of the patch; returns its facets by the corners of those that they are parts of.
    fn add_surface(
        &mut self,
        patch: &PatchCells<D>,
        surface: &PatchSurface<D>,
    ) -> BTreeMap<Vec<u32>, Vec<Facet>> {
        let mut of_facet: BTreeMap<Vec<u32>, Vec<Facet>> = BTreeMap::new();
        let number: BTreeMap<Index<D>, u32> = (patch.all.iter().copied()).zip(0..).collect();
        let mesh = &mut self.patched.mesh;
        for (corners, index, part, normal) in &surface.parts {
            let first = mesh.nodes.len() as u32;
            mesh.nodes.extend_from_slice(&part.corners[..part.count]);
            let mut nodes: Facet = (first..mesh.nodes.len() as u32).collect();
            let facet = BoundaryFacet {
                nodes: nodes.clone(),
                cell: number[index],
                local: 0,
            };
            if D > 1 && mesh.facet_normal_area(&facet).dot(normal) < 0.0 {
                nodes.swap(0, 1);
            }
            let own = of_facet.entry(corners.clone()).or_default();
            own.push(nodes.clone());
            mesh.embedded.add_surface(number[index], nodes);
        }
        of_facet
    }

    /// Carries the named sets over: cells and nodes that are left, the cells of the patch in sets of cells, and facets of cells that are left.
    fn carry_sets(&mut self, before: &Mesh<D>, (cell, of_patch): (&[u32], usize)) {
        let mesh = &mut self.patched.mesh;
        for (name, set) in &before.cell_sets {
            let mut held = vec![false; before.cell_count()];
            set.iter().for_each(|&c| held[c as usize] = true);
            let of_patch = (0..of_patch).filter(|&c| held[self.patched.origin[c] as usize]);
            let own = (set.iter())
                .filter_map(|&c| (cell[c as usize] != NONE).then_some(cell[c as usize]));
            let all = of_patch.map(|c| c as u32).chain(own).collect();
            mesh.cell_sets.insert(name.clone(), all);
        }
        let kept = |n: u32| (self.node[n as usize] != NONE).then_some(self.node[n as usize]);
        for (name, set) in &before.node_sets {
            let all = set.iter().flat_map(|&n| self.sides.copies(n));
            mesh.node_sets
                .insert(name.clone(), all.filter_map(kept).collect());
        }
    }

    /// Carries the named sets of facets over: what is left of them, and the faces of the patch on them.
    fn carry_facets(
        &mut self,
        before: &Mesh<D>,
        patch: &PatchCells<D>,
        (surface, crossing): (&PatchSurface<D>, &BTreeMap<Vec<u32>, Vec<Facet>>),
        cell: &[u32],
    ) {
        let corners = |facet: &[u32]| sorted(facet_corners::<D>(facet).to_vec());
        let owner: BTreeMap<Vec<u32>, u32> = (before.outer_facets().into_iter())
            .map(|facet| (corners(&facet.nodes), facet.cell))
            .collect();
        let kept = |n: &u32| (self.node[*n as usize] != NONE).then_some(self.node[*n as usize]);
        let size = patch.cells.spacing.powi(D as i32 - 1);
        let number: BTreeMap<Index<D>, u32> = (patch.all.iter().copied()).zip(0..).collect();
        for (name, set) in &before.facet_sets {
            let mut own: Vec<Facet> = Vec::new();
            let mut faces: BTreeMap<Face<D>, f64> = BTreeMap::new();
            for facet in set {
                let corners = corners(facet);
                let found = surface.met.get(&corners);
                own.extend(crossing.get(&corners).into_iter().flatten().cloned());
                for (face, part) in found.iter().flat_map(|found| &found.faces) {
                    *faces.entry(*face).or_insert(0.0) += part;
                }
                let is_gone = found.is_some_and(|found| found.is_gone)
                    || (owner.get(&corners)).is_some_and(|&c| cell[c as usize] == NONE);
                let nodes = match owner.get(&corners) {
                    Some(&cell) => self.sides.of_cell(before, cell, facet),
                    None => facet.clone(),
                };
                let nodes: Option<Facet> = nodes.iter().map(kept).collect();
                own.extend(nodes.filter(|_| !is_gone));
            }
            for (face, part) in faces {
                if part < (1.0 - HELD) * size {
                    self.patched.torn.insert(name.clone());
                }
                own.extend(self.facet_of(&face, number[&face.cell]));
            }
            self.patched.mesh.facet_sets.insert(name.clone(), own);
        }
    }

    /// A face of the patch as a facet of its cell.
    fn facet_of(&self, face: &Face<D>, cell: u32) -> Option<Facet> {
        let mesh = &self.patched.mesh;
        let wanted = sorted(face.nodes().iter().map(|n| self.node_of_patch[n]).collect());
        let count = mesh.shapes[cell as usize].facets().len() as u8;
        let facets = (0..count).map(|local| mesh.facet((cell, local)).nodes);
        facets
            .into_iter()
            .find(|facet| sorted(facet.clone()) == wanted)
    }

    /// Rows by the numbers of nodes.
    pub fn numbered(&self, rows: &Rows<D>) -> BTreeMap<u32, Vec<(u32, f64)>> {
        let number = |place: &Place<D>| match place {
            Place::Mesh(n) => self.node[*n as usize],
            Place::Patch(node) => self.node_of_patch[node],
        };
        let rows = rows.iter().map(|(place, row)| {
            let row = row.iter().map(|(followed, w)| (number(followed), *w));
            (number(place), row.collect())
        });
        rows.collect()
    }

    /// The number of a node of the patch.
    pub fn number_of(&self, node: &Index<D>) -> u32 {
        self.node_of_patch[node]
    }
}

/// Gives the cells of the patch that the surface of the body cuts their rules and pieces.
fn cut_patch_cells<const D: usize>(before: &Mesh<D>, patch: &PatchCells<D>, mesh: &mut Mesh<D>) {
    for (c, index) in patch.all.iter().enumerate() {
        if !patch.is_cut(index) {
            continue;
        }
        let pieces = patch.pieces(before, index);
        let mut part = PartMoments::about(patch.cells.centre(index));
        pieces.iter().for_each(|piece| part.add(piece));
        if let Some(rule) = fem::rule_of_parts(mesh, c, &[part.central()]) {
            mesh.embedded.cut.insert(c as u32, rule);
        }
        let pieces = pieces.iter().map(|piece| piece.corners).collect();
        mesh.embedded.pieces.insert(c as u32, pieces);
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
