//! Rows by which nodes that follow others hand on their masses.
//!
//! A node follows others by weights of either sign, whose transpose would leave little or less than nothing of a mass. Any weights that are exact for affine fields keep mass and first moments. Those of a node of Γ are the shape functions of
//! the element around it. Where Γ ends at the surface of the body, a node of its last face lies outside: its mass is handed on together with that of the node beside it, at the centroid of both, which lies inside. Where
//! some are negative still, since the element has nodes that follow others or the node lies beyond those it follows, they become those of nodes on both sides of Γ, and none is negative.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    cells::{Index, PatchCells, block},
    cuts::Cuts,
    rows::{Place, Row, Rows, mass_row},
};
use crate::{mesh::Mesh, peridynamics::bounded_least_norm::positive_weights, tensor::Vector};

/// Weight below which a row is extrapolated.
const LEAST: f64 = -1e-9;

/// Part of a mass that a corner of an element of second order has beside a node in the middle of an edge, as far as it may be chosen.
const OF_CORNER: f64 = 0.05;

/// Shape functions at a place, and the least of them.
type Found<const D: usize> = (f64, Row<D>);

/// The row of each node of Γ, `cells` being the cells of the mesh beyond the faces around it; none of a node that these give none.
pub(super) fn of_nodes<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    cells: &BTreeMap<Index<D>, BTreeSet<u32>>,
) -> BTreeMap<Index<D>, Found<D>> {
    let each = cells.iter();
    each.filter_map(|(node, around)| Some((*node, row_at(mesh, &patch.node(node), around)?)))
        .collect()
}

/// Rows of nodes of Γ that lie outside of the body and of those beside them, and the place that each acts at: the centroid of their volumes. These rows are exact for affine fields together.
pub(super) fn pooled<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    cells: &BTreeMap<Index<D>, BTreeSet<u32>>,
    own: &BTreeMap<Index<D>, Found<D>>,
    volume_of: impl Fn(&Index<D>) -> f64,
) -> BTreeMap<Index<D>, (Row<D>, Vector<D>)> {
    let mut pooled = BTreeMap::new();
    for members in groups(own).values() {
        let (mut volume, mut moment) = (0.0, Vector::<D>::zeros());
        for node in members {
            let v = volume_of(node);
            volume += v;
            moment += patch.node(node) * v;
        }
        let around = members.iter().flat_map(|node| &cells[node]).copied();
        let at = moment / volume;
        let least = members.iter().map(|node| own[node].0);
        if volume > 0.0
            && let Some((other, row)) = row_at(mesh, &at, &around.collect())
            && other > least.fold(f64::INFINITY, f64::min)
        {
            pooled.extend(members.iter().map(|node| (*node, (row.clone(), at))));
        }
    }
    pooled
}

/// The shape functions at a place of the cell that holds it, or comes nearest to that, and the least of them.
fn row_at<const D: usize>(
    mesh: &Mesh<D>,
    x: &Vector<D>,
    cells: &BTreeSet<u32>,
) -> Option<Found<D>> {
    let each = cells.iter().filter_map(|&c| {
        let c = c as usize;
        let row = mass_row(mesh, c, x)?;
        let least = row.iter().map(|e| e.1).fold(1.0, f64::min);
        Some((least, row))
    });
    // the first of those that are alike
    each.reduce(|best, other| if other.0 > best.0 { other } else { best })
}

/// Nodes whose rows are extrapolated, each with the nodes beside it that lead to one whose row is not, by that one.
fn groups<const D: usize>(
    own: &BTreeMap<Index<D>, Found<D>>,
) -> BTreeMap<Index<D>, BTreeSet<Index<D>>> {
    let mut groups: BTreeMap<Index<D>, BTreeSet<Index<D>>> = BTreeMap::new();
    for (node, (least, _)) in own.iter().filter(|(_, row)| row.0 < LEAST) {
        let (mut at, mut least, mut way) = (*node, *least, vec![*node]);
        while least < LEAST {
            let beside = (0..2 * D).map(|k| {
                let mut other = at;
                other[k / 2] += if k % 2 == 0 { 1 } else { -1 };
                other
            });
            let known = beside.filter_map(|other| Some((own.get(&other)?.0, other)));
            let Some((more, next)) = known.max_by(|a, b| a.0.total_cmp(&b.0)) else {
                break;
            };
            if more <= least {
                break;
            }
            (at, least) = (next, more);
            way.push(at);
        }
        groups.entry(at).or_default().extend(way);
    }
    groups
}

/// Gives each row with a negative weight, of those that are resolved, the weights of nodes around that follow none, as far as the node lies among these; `pooled` has the places of nodes whose mass acts elsewhere.
pub(super) fn make_positive<const D: usize>(
    mesh: &Mesh<D>,
    (patch, cuts): (&PatchCells<D>, &Cuts),
    pooled: &BTreeMap<Index<D>, (Row<D>, Vector<D>)>,
    rows: &mut Rows<D>,
) {
    let (offsets, cells) = mesh.node_cells();
    let position = |place: &Place<D>| match place {
        Place::Mesh(n) => mesh.nodes[*n as usize],
        Place::Patch(node) => patch.node(node),
    };
    let around = |x: &Vector<D>, row: &Row<D>| -> BTreeSet<Place<D>> {
        let mut found = BTreeSet::new();
        for (place, _) in row {
            let Place::Mesh(n) = place else { continue };
            let own = offsets[*n as usize] as usize..offsets[*n as usize + 1] as usize;
            for &c in cells[own].iter().filter(|&&c| !cuts.is_covered(c)) {
                found.extend(mesh.cell(c as usize).iter().map(|&n| Place::Mesh(n)));
            }
        }
        let at = patch.cells.index(x);
        let near = block(at.map(|i| i - 1), at.map(|i| i + 2)).filter(|node| {
            let mut own = block(node.map(|i| i - 1), *node);
            own.any(|cell| patch.is_rim(&cell))
        });
        found.extend(near.map(Place::Patch));
        found.retain(|place| !rows.contains_key(place));
        found
    };
    // a uniform force on second-order cells leaves the corners free
    let mut prior = vec![1.0; mesh.nodes.len()];
    for c in (0..mesh.cell_count()).filter(|&c| mesh.shapes[c].is_quadratic()) {
        (mesh.corners(c).iter()).for_each(|&n| prior[n as usize] = OF_CORNER);
    }
    let prior = |place: &Place<D>| match place {
        Place::Mesh(n) => prior[*n as usize],
        Place::Patch(_) => 1.0,
    };
    let mut changed = Rows::new();
    for (place, row) in rows.iter() {
        if row.iter().all(|(_, w)| *w >= LEAST) {
            continue;
        }
        let x = match place {
            Place::Patch(node) => pooled.get(node).map_or(patch.node(node), |own| own.1),
            Place::Mesh(n) => mesh.nodes[*n as usize],
        };
        let places: Vec<Place<D>> = around(&x, row).into_iter().collect();
        let arms: Vec<Vector<D>> = places.iter().map(|place| position(place) - x).collect();
        let reach = arms.iter().map(|arm| arm.norm()).fold(0.0, f64::max);
        let arms: Vec<Vector<D>> = arms.iter().map(|arm| arm / reach).collect();
        let near = |arm: &Vector<D>| 1.01 - arm.norm_squared();
        let near: Vec<f64> = (arms.iter().zip(&places))
            .map(|(arm, place)| near(arm) * prior(place))
            .collect();
        if let Some(weights) = positive_weights(&arms, &near) {
            let row = places.into_iter().zip(weights).filter(|(_, w)| *w > 0.0);
            changed.insert(*place, row.collect());
        }
    }
    rows.extend(changed);
}
