//! Nodes beside a patch with no element of which enough is left: they follow the nearest one that has.

use std::collections::BTreeMap;

use super::{NodeRow, PatchError, cuts::Cuts};
use crate::{fem, mesh::Mesh};

/// Rings of cells around a node in which an element is sought.
const RINGS: usize = 12;

/// The nodes that follow, with those of the element that each follows: the one of the least sum of weights in the first ring of cells that has any, and in the next.
pub(super) fn followers<const D: usize>(
    mesh: &Mesh<D>,
    cuts: &Cuts,
    is_held: &dyn Fn(u32) -> bool,
) -> Result<BTreeMap<u32, NodeRow>, PatchError> {
    let (offsets, around) = mesh.node_cells();
    let cells = |n: u32| &around[offsets[n as usize] as usize..offsets[n as usize + 1] as usize];
    let mut followers = BTreeMap::new();
    let candidates = cuts.cut().flat_map(|(c, _)| mesh.cell(c as usize));
    for &n in candidates {
        if followers.contains_key(&n) || is_held(n) || cells(n).iter().any(|&c| cuts.is_good(c)) {
            continue;
        }
        let x = mesh.nodes[n as usize];
        let mut best: Option<(f64, NodeRow)> = None;
        let (mut seen, mut reached) = (vec![n], vec![n]);
        for _ in 0..RINGS {
            let had = best.is_some();
            let mut ring: Vec<u32> = reached.iter().flat_map(|&n| cells(n)).copied().collect();
            ring.sort_unstable();
            ring.dedup();
            for &c in ring.iter().filter(|&&c| cuts.is_good(c)) {
                let Some(xi) = fem::reference_of(mesh, c as usize, &x) else {
                    continue;
                };
                let (shape, _) = fem::shape_values(mesh, c as usize, &xi);
                let row: NodeRow = mesh.cell(c as usize).iter().copied().zip(shape).collect();
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
                node: n,
                position: x.iter().copied().collect(),
            });
        };
        followers.insert(n, row);
    }
    Ok(followers)
}
