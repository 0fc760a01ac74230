//! Conditions that a zone with a rim of its own does not bear, and where it would have to end for them.

use std::collections::BTreeMap;

use crate::mesh::{Facet, Mesh, facet_corners};
use crate::model::patch::{PatchLattice, Patched};
use crate::scene::conditions::{Condition, Support};
use crate::scene::draft::Draft;
use crate::tensor::Vector;

/// A condition that a patch does not bear.
pub(super) struct Conflict {
    /// Predicate of a sentence about the condition.
    pub what: String,
    /// Nodes of the mesh that the patch would have to keep off.
    nodes: Vec<u32>,
    /// Facets of the mesh.
    facets: Vec<Facet>,
}

/// The conflict of a condition with a patch that does not bear it, if there is one.
pub(super) fn conflict_with<const D: usize>(
    condition: &Condition<D>,
    draft: &Draft<'_, D>,
    patched: &Patched<D>,
) -> Option<Conflict> {
    let sorted = |facet: &[u32]| {
        let mut corners = facet_corners::<D>(facet).to_vec();
        corners.sort_unstable();
        corners
    };
    let is_covered = |facet: &[u32]| patched.covered.contains(&sorted(facet));
    let mesh = &draft.mesh;
    let at = |facet: &[u32]| mesh.bounds_of(facet).0;
    let of_facets = |what: String, facets: Vec<Facet>| Conflict {
        what,
        nodes: Vec::new(),
        facets,
    };
    if let Some(load) = condition.load() {
        let facets = load.on.facets();
        let set = (patched.torn.iter()).find(|name| {
            let held = mesh.facet_sets.get(*name).into_iter().flatten();
            let held = held.map(Vec::as_slice).filter(|facet| is_covered(facet));
            held.into_iter().any(|facet| facets.contains(&facet))
        })?;
        let what = format!("acts on `{set}`, whose edge divides a face of the zone or its rim");
        return Some(of_facets(what, at_edge::<D>(mesh.facet_sets.get(set)?)));
    }
    if let Some(Support::Set { nodes, facets, .. }) = condition.support() {
        let dropped = || nodes.iter().filter(|n| patched.dropped.contains(n));
        if facets.is_empty() && dropped().next().is_some() {
            return Some(Conflict {
                what: "holds nodes that the zone or its rim covers; name a set of facets"
                    .to_owned(),
                nodes: nodes.to_vec(),
                facets: Vec::new(),
            });
        }
        let first = (facets.iter()).find(|facet| patched.crossed.contains(&sorted(facet)))?;
        let what = format!(
            "holds a surface at {:?} that crosses elements of the rim, none of whose nodes lies on it",
            at(first).as_slice()
        );
        let is_plane = |facet: &[u32]| {
            let places = facet.iter().map(|&n| mesh.nodes[n as usize]);
            patched.mesh.embedded.covered.is_plane(places)
        };
        let off = facets.iter().filter(|facet| !is_plane(facet));
        return Some(of_facets(what, off.cloned().collect()));
    }
    let facets = condition
        .term()
        .map(|term| term.facets())
        .unwrap_or_default();
    let first = facets.iter().find(|facet| is_covered(facet))?;
    let what = format!(
        "acts on a facet at {:?}, of which the zone or its rim covers a part",
        at(first).as_slice()
    );
    Some(of_facets(
        what,
        facets.iter().map(|facet| facet.to_vec()).collect(),
    ))
}

/// The facets at the edge of a set.
fn at_edge<const D: usize>(set: &[Facet]) -> Vec<Facet> {
    let sides = |facet: &Facet| -> Vec<Vec<u32>> {
        let corners = facet_corners::<D>(facet);
        let count = corners.len();
        let side = |k: usize| match D {
            3 => {
                let (a, b) = (corners[k], corners[(k + 1) % count]);
                vec![a.min(b), a.max(b)]
            }
            _ => vec![corners[k]],
        };
        (0..count).map(side).collect()
    };
    let mut times: BTreeMap<Vec<u32>, u32> = BTreeMap::new();
    for side in set.iter().flat_map(sides) {
        *times.entry(side).or_default() += 1;
    }
    let is_at_edge = |facet: &&Facet| sides(facet).iter().any(|side| times[side] == 1);
    set.iter().filter(is_at_edge).cloned().collect()
}

/// Places of a conflict, no farther apart than half a spacing.
pub(super) fn places_of<const D: usize>(
    conflict: &Conflict,
    mesh: &Mesh<D>,
    lattice: &PatchLattice<D>,
) -> Vec<Vector<D>> {
    let mut places: Vec<Vector<D>> = (conflict.nodes.iter())
        .map(|&n| mesh.nodes[n as usize])
        .collect();
    for facet in &conflict.facets {
        let x: Vec<Vector<D>> = (facet_corners::<D>(facet).iter())
            .map(|&n| mesh.nodes[n as usize])
            .collect();
        let (low, high) = mesh.bounds_of(facet);
        let parts = ((high - low).norm() / (0.5 * lattice.spacing))
            .ceil()
            .max(1.0) as usize;
        let along = |k: usize| k as f64 / parts as f64;
        for (i, j) in (0..=parts).flat_map(|i| (0..=parts).map(move |j| (along(i), along(j)))) {
            match x[..] {
                [a] => places.push(a),
                [a, b] => places.push(a + (b - a) * i),
                [a, b, c] if i + j <= 1.0 => places.push(a + (b - a) * i + (c - a) * j),
                [a, b, c, d] => {
                    places.push((a * (1.0 - i) + b * i) * (1.0 - j) + (d * (1.0 - i) + c * i) * j);
                }
                _ => {}
            }
        }
    }
    places
}
