//! Plane parts of the outer face of a rim, in an order in which rows of nodes resolve.
//!
//! A node of Γ at the edge of several plane parts belongs to one of them. The rows of a part take of its nodes that belong to others, so that rows resolve if the parts have an order, a node belonging to the first one. Each face needs a node of
//! its own: the last of the parts is one each face of which has a node at no other part, the one before it is such a part among those that are left, and so on. Of a staircase with steps of one cell each part then has one of its two edges.

use std::collections::{BTreeMap, BTreeSet};

/// A face: its axis, and its nodes by their numbers along each axis of the lattice.
pub(super) type PlaneFace<const D: usize> = (usize, Vec<[i32; D]>);

/// The axis of the plane part of Γ that each node belongs to; where no order is found, the lowest of those that are left.
pub(super) fn axes<const D: usize>(
    faces: &[PlaneFace<D>],
    may_follow: impl Fn(&[i32; D]) -> bool,
) -> BTreeMap<[i32; D], usize> {
    let part = parts(faces);
    let mut of_part: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    let mut at: BTreeMap<[i32; D], BTreeSet<usize>> = BTreeMap::new();
    for (f, &part) in part.iter().enumerate() {
        of_part.entry(part).or_default().push(f);
        for node in &faces[f].1 {
            at.entry(*node).or_default().insert(part);
        }
    }
    let mut axes = BTreeMap::new();
    loop {
        let is_own = |node: &[i32; D]| at[node].len() == 1 && may_follow(node);
        let has_own = |f: &usize| faces[*f].1.iter().any(is_own);
        let last = of_part.iter().find(|(_, own)| own.iter().all(has_own));
        let Some((&last, own)) = last else {
            break;
        };
        for node in own.iter().flat_map(|&f| &faces[f].1) {
            let parts = at.entry(*node).or_default();
            if parts.remove(&last) && parts.is_empty() {
                axes.insert(*node, faces[own[0]].0);
            }
        }
        of_part.remove(&last);
    }
    for &f in of_part.values().flatten() {
        for node in &faces[f].1 {
            let axis = axes.entry(*node).or_insert(faces[f].0);
            *axis = faces[f].0.min(*axis);
        }
    }
    axes
}

/// The part of each face, by the number of one of its faces: faces of one plane with nodes in common.
fn parts<const D: usize>(faces: &[PlaneFace<D>]) -> Vec<usize> {
    let mut above: Vec<usize> = (0..faces.len()).collect();
    fn first(above: &mut [usize], mut f: usize) -> usize {
        while above[f] != f {
            above[f] = above[above[f]];
            f = above[f];
        }
        f
    }
    let mut seen: BTreeMap<([i32; D], usize), usize> = BTreeMap::new();
    for (f, (axis, nodes)) in faces.iter().enumerate() {
        for node in nodes {
            let other = *seen.entry((*node, *axis)).or_insert(f);
            let (a, b) = (first(&mut above, f), first(&mut above, other));
            above[a.max(b)] = a.min(b);
        }
    }
    (0..faces.len()).map(|f| first(&mut above, f)).collect()
}
