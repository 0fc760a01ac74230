//! Nodes of the mesh and of the rim with no element of which enough is left: they follow the nearest one that has.

use std::collections::BTreeSet;

use super::{
    cells::{GOOD, Index, PatchCells, block},
    cuts::Cuts,
    error::PatchError,
    rows::{Place, Row, Rows, gathered},
};
use crate::{mesh::Mesh, tensor::Vector};

/// Rings of cells around a node in which an element is sought.
const RINGS: usize = 12;

/// Substitutions of rows into one another before those of the rim count as a circle.
const PASSES: usize = 200;

/// The nodes of the mesh that follow, with those of the element that each follows: the one of the least sum of weights in the first ring of cells that has any, and in the next. It is of the `material` of what is left of their own, whose
/// strain another one has not. The weights in a cell are those of `row_at`.
pub(super) fn of_mesh<const D: usize>(
    mesh: &Mesh<D>,
    cuts: &Cuts,
    (is_held, material): (&dyn Fn(u32) -> bool, &dyn Fn(u32) -> u16),
    row_at: fn(&Mesh<D>, usize, &Vector<D>) -> Option<Row<D>>,
) -> Result<Rows<D>, PatchError> {
    let (offsets, around) = mesh.node_cells();
    let cells = |n: u32| &around[offsets[n as usize] as usize..offsets[n as usize + 1] as usize];
    let mut followers = Rows::new();
    let candidates = cuts.cut().flat_map(|(c, _)| mesh.cell(c as usize));
    for &n in candidates {
        if followers.contains_key(&Place::Mesh(n))
            || is_held(n)
            || cells(n).iter().any(|&c| cuts.is_good(c))
        {
            continue;
        }
        let x = mesh.nodes[n as usize];
        let left = cells(n).iter().filter(|&&c| !cuts.is_covered(c));
        let own: Vec<u16> = left.map(|&c| material(c)).collect();
        let may_lead = |c: u32| cuts.is_good(c) && own.contains(&material(c));
        let mut best: Option<(f64, Row<D>)> = None;
        let (mut seen, mut reached) = (vec![n], vec![n]);
        for _ in 0..RINGS {
            let had = best.is_some();
            let ring = reached.iter().flat_map(|&n| cells(n)).copied();
            // through the material, not through the patch
            let mut ring: Vec<u32> = ring.filter(|&c| !cuts.is_covered(c)).collect();
            ring.sort_unstable();
            ring.dedup();
            for &c in ring.iter().filter(|&&c| may_lead(c)) {
                let Some(row) = row_at(mesh, c as usize, &x) else {
                    continue;
                };
                let sum: f64 = row.iter().map(|e| e.1.abs()).sum();
                if best.as_ref().is_none_or(|b| sum < b.0) {
                    best = Some((sum, row));
                }
            }
            if had {
                break;
            }
            reached = ring
                .iter()
                .flat_map(|&c| mesh.cell(c as usize))
                .copied()
                .collect();
            reached.sort_unstable();
            reached.dedup();
            reached.retain(|n| seen.binary_search(n).is_err());
            seen.extend(&reached);
            seen.sort_unstable();
        }
        let Some((_, row)) = best else {
            return Err(PatchError::Alone {
                position: x.iter().copied().collect(),
            });
        };
        followers.insert(Place::Mesh(n), row);
    }
    Ok(followers)
}

/// The nodes of the rim that follow, with those of the element of the rim that each follows: of the nearest with enough of their volume in the body the one of the least sum of weights.
pub(super) fn of_rim<const D: usize>(patch: &PatchCells<D>) -> Result<Rows<D>, PatchError> {
    let mut bad: BTreeSet<Index<D>> = BTreeSet::new();
    for cell in patch.all.iter().filter(|cell| patch.is_rim(cell)) {
        let nodes = block(*cell, cell.map(|i| i + 1));
        bad.extend(nodes.filter(|node| patch.is_bad(node)));
    }
    let mut followers = Rows::new();
    for node in bad {
        let rings = 1..=RINGS as i32;
        let best = rings.map(|ring| best_of_ring(patch, &node, ring));
        let row = best.flatten().next().ok_or_else(|| PatchError::Alone {
            position: patch.node(&node).iter().copied().collect(),
        })?;
        followers.insert(Place::Patch(node), row);
    }
    Ok(followers)
}

/// The row of a node in the good element of the rim of the least sum of weights, among those up to so many cells away.
fn best_of_ring<const D: usize>(
    patch: &PatchCells<D>,
    node: &Index<D>,
    ring: i32,
) -> Option<Row<D>> {
    let cells = block(node.map(|i| i - ring - 1), node.map(|i| i + ring));
    let good = cells.filter(|cell| patch.is_rim(cell) && patch.part(cell) >= GOOD);
    let row = |cell: Index<D>| -> (f64, Row<D>) {
        let s = Vector::<D>::from_fn(|i, _| f64::from(node[i] - cell[i]));
        let corners = block([0; D], [1; D]);
        let weights = corners.map(|corner| {
            let factors = (0..D).map(|i| if corner[i] == 1 { s[i] } else { 1.0 - s[i] });
            let place = Place::Patch(std::array::from_fn(|i| cell[i] + corner[i]));
            (place, factors.product::<f64>())
        });
        let row: Row<D> = weights.filter(|e| e.1 != 0.0).collect();
        (row.iter().map(|e| e.1.abs()).sum(), row)
    };
    let least = good.map(row).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(least.1)
}

/// A row with the nodes that follow others in the place of these.
pub(super) fn substituted<const D: usize>(row: &Row<D>, rows: &Rows<D>) -> Row<D> {
    gathered(row.iter().flat_map(|&(place, w)| match rows.get(&place) {
        Some(others) => others.iter().map(|&(other, v)| (other, v * w)).collect(),
        None => vec![(place, w)],
    }))
}

/// The rows with nodes alone that follow none.
///
/// # Errors
/// [`PatchError::Circle`] where substitution does not end.
pub(super) fn resolved<const D: usize>(
    rows: &Rows<D>,
    patch: &PatchCells<D>,
) -> Result<Rows<D>, PatchError> {
    let resolve = |row: &Row<D>| {
        let mut row = row.clone();
        for _ in 0..PASSES {
            if row.iter().all(|(place, _)| !rows.contains_key(place)) {
                return Some(row);
            }
            row = substituted(&row, rows);
        }
        None
    };
    let mut resolved = Rows::new();
    for (place, row) in rows {
        let row = resolve(row).ok_or_else(|| PatchError::Circle {
            position: match place {
                Place::Mesh(_) => Vec::new(),
                Place::Patch(node) => patch.node(node).iter().copied().collect(),
            },
        })?;
        resolved.insert(*place, row);
    }
    Ok(resolved)
}
