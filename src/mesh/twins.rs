//! Nodes of a body at one place: along the faces of a crack that a mesher made, or by mistake.

use rustc_hash::FxHashMap;

use super::error::position;
use super::{Mesh, facet_corners};
use crate::tensor::Vector;

/// Nodes closer than this fraction of the mesh's largest extent lie at one place.
const COINCIDENT: f64 = 1e-12;

/// The nodes at the place of each node.
pub(super) struct Twins {
    /// For each node the least of those of its body at its place.
    pub first: Vec<u32>,
    /// Two nodes at one place, if there are any, and the number of nodes that are not the least at theirs.
    pub pair: Option<([u32; 2], usize)>,
}

impl Twins {
    /// Those of a mesh, by sorting along a skew line so that grids do not pile up on it; nodes of different `bodies` are no twins.
    pub fn of<const D: usize>(mesh: &Mesh<D>, bodies: &[u32]) -> Self {
        let (lo, hi) = mesh.bounds();
        let tolerance = COINCIDENT * (hi - lo).amax();
        let line: Vector<D> = Vector::from_fn(|k, _| [1.0, 0.618_033_988_7, 0.324_717_957_2][k]);
        let mut order: Vec<(f64, u32)> = (mesh.nodes.iter().enumerate())
            .map(|(i, x)| (x.dot(&line), i as u32))
            .collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let reach = tolerance * line.norm();
        let mut first: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
        for (k, &(s, i)) in order.iter().enumerate() {
            for &(_, j) in order[k + 1..].iter().take_while(|(t, _)| t - s <= reach) {
                let distance = (mesh.nodes[i as usize] - mesh.nodes[j as usize]).norm();
                if distance <= tolerance && bodies[i as usize] == bodies[j as usize] {
                    let least = first[i as usize].min(first[j as usize]);
                    first[i as usize] = least;
                    first[j as usize] = least;
                }
            }
        }
        let mut pairs = (first.iter().zip(0..)).filter(|(of, n)| **of != *n);
        let pair = pairs.next().map(|(&of, n)| ([of, n], pairs.count() + 1));
        Self { first, pair }
    }

    /// Returns true if every node with a twin belongs to a facet that another one of its body meets face to face: they are the faces of cracks.
    pub fn lie_along_cracks<const D: usize>(&self, mesh: &Mesh<D>) -> bool {
        let bodies = mesh.bodies();
        let mut has_twin = vec![false; self.first.len()];
        for (n, &of) in self
            .first
            .iter()
            .enumerate()
            .filter(|(n, of)| *n != **of as usize)
        {
            if bodies[n] != bodies[of as usize] {
                return false;
            }
            (has_twin[n], has_twin[of as usize]) = (true, true);
        }
        let mut met: FxHashMap<Vec<u32>, u32> = FxHashMap::default();
        let outer = mesh.outer_facets();
        let key = |nodes: &[u32]| {
            let corners = facet_corners::<D>(nodes).iter();
            let mut key: Vec<u32> = corners.map(|&n| self.first[n as usize]).collect();
            key.sort_unstable();
            key
        };
        outer
            .iter()
            .for_each(|f| *met.entry(key(&f.nodes)).or_default() += 1);
        for facet in outer.iter().filter(|f| met[&key(&f.nodes)] == 2) {
            facet
                .nodes
                .iter()
                .for_each(|&n| has_twin[n as usize] = false);
        }
        !has_twin.contains(&true)
    }
}

impl<const D: usize> Mesh<D> {
    /// A note on cracks along which nodes lie in pairs; none of a mesh without.
    pub fn note_on_cracks(&self) -> Option<String> {
        let twins = Twins::of(self, &self.bodies());
        let (_, count) = twins.pair?;
        let nodes = (0..self.nodes.len() as u32).filter(|&n| twins.first[n as usize] != n);
        let (lo, hi) = self.bounds_of(&nodes.collect::<Vec<_>>());
        Some(format!(
            "{count} pairs of nodes lie at one place each, from {} to {}: the mesh has a crack there, whose faces are free (mesh.file.merge = 1e-9 would merge them)",
            position(lo.as_slice()),
            position(hi.as_slice())
        ))
    }
}
