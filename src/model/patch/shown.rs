//! Cells of which too little is left for a strain of their own: that of the nearest cell with enough left is shown in its place.
//!
//! Nodes of such a cell follow elements on different sides, so that its strain has no meaning, and its energy hardly any weight.

use rustc_hash::FxHashMap;

use super::{
    cells::{GOOD, Index, block},
    composite::Patched,
};
use crate::{fem, mesh::Mesh, tensor::Vector};

/// Cells of the lattice around a place in which one of the rim is sought.
const RINGS: i32 = 2;

/// Each such cell of the elements, with the one that is shown; `material` is that of a cell.
pub(super) fn shown<const D: usize>(
    patched: &Patched<D>,
    material: impl Fn(u32) -> u16,
) -> FxHashMap<u32, u32> {
    let mesh = &patched.mesh;
    let cut = &mesh.embedded.cut;
    let is_poor = |c: &u32| cut.get(c).is_some_and(|rule| rule.fraction < GOOD);
    let is_good = |c: &u32| !patched.nonlocal[*c as usize] && !is_poor(c);
    let mut poor: Vec<u32> = cut.keys().copied().filter(is_poor).collect();
    poor.retain(|&c| !patched.nonlocal[c as usize]);
    if poor.is_empty() {
        return FxHashMap::default();
    }
    let covered = &mesh.embedded.covered;
    let index = |x: &Vector<D>| -> Index<D> {
        std::array::from_fn(|i| ((x - covered.corner)[i] / covered.edge).floor() as i32)
    };
    let of_patch = 0..covered.cells.len() as u32;
    let cells: FxHashMap<Index<D>, u32> = of_patch
        .map(|c| (index(&mesh.centroid(c as usize)), c))
        .collect();
    let (offsets, around) = mesh.node_cells();
    let nearest = |&c: &u32| {
        let x = centre(mesh, c);
        let beside = mesh
            .cell(c as usize)
            .iter()
            .flat_map(|&n| &around[offsets[n as usize] as usize..offsets[n as usize + 1] as usize]);
        let at = index(&x);
        let rim = block(at.map(|i| i - RINGS), at.map(|i| i + RINGS + 1));
        let rim = rim.filter_map(|index| cells.get(&index));
        let alike = |other: &&u32| is_good(other) && material(**other) == material(c);
        let distance = |other: &u32| (centre(mesh, *other) - x).norm();
        let found = beside.chain(rim).filter(alike).copied();
        found.min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)))
    };
    let all = poor.iter();
    all.filter_map(|c| Some((*c, nearest(c)?))).collect()
}

/// The centroid of what is left of a cell.
fn centre<const D: usize>(mesh: &Mesh<D>, c: u32) -> Vector<D> {
    let (mut size, mut moment) = (0.0, Vector::zeros());
    fem::for_each_point(mesh, c as usize, fem::Rule::Mass, |p| {
        size += p.weight;
        moment += p.position * p.weight;
    });
    moment / size
}
