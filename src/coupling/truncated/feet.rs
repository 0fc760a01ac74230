//! Changes of the traces at which pieces end.
//!
//! A piece that ends at `x` on a face follows `Σ w_a u(x_a)` over sites `a`: any weights with `Σ w_a = 1` and `Σ w_a x_a = x` keep forces and moments in balance and every energy positive. Weights over nodes around the face may therefore be added to its
//! shape functions. They load nodes that few pieces reach, those of an element smaller than the spacing or at a sharp corner of the zone. Points at the seam are included as well as nodes: where elements are large,
//! few nodes are near, and the forces that positive factors cannot balance are at the points.

use rustc_hash::FxHashMap;

use super::bond_segments::{End, Segment, Segments};
use crate::coupling::truncated::fit_parts::points_at_seam;
use crate::tensor::Vector;

/// Nodes around an end, those of its trace included, beyond the D + 1 that an affine field determines.
const MOST_BESIDE: usize = 6;

/// Points around an end, for each dimension.
const MOST_POINTS: usize = 2;

/// Most changes in all: what is factorised grows with them.
const MOST_SHIFTS: usize = 40_000;

/// Part of a direction that has to be new for it to count.
const NEW: f64 = 0.1;

/// A change of the trace at an end of a piece: sites and weights, orthogonal to all affine fields.
pub(super) struct Shift {
    pub piece: usize,
    pub side: usize,
    pub weights: Vec<(u32, f64)>,
}

/// A basis of the changes at the ends on faces of all pieces of at least the length `shortest`, by nodes of `nodes` and points at the seam within a horizon.
pub(super) fn shifts<const D: usize>(
    segments: &Segments<'_, D>,
    nodes: &FxHashMap<u32, Vector<D>>,
    shortest: f64,
) -> Vec<Shift> {
    let cloud = &segments.body.cloud;
    let sites = &segments.model.sites;
    let reach = cloud.horizon.largest();
    let mut order: Vec<u32> = nodes.keys().copied().collect();
    order.sort_unstable();
    let place = |site: u32| sites[site as usize].position;
    let node_bins = Bins::new(&order, place, reach);
    let seam: Vec<u32> = points_at_seam(segments)
        .map(|p| segments.site[p as usize])
        .collect();
    let point_bins = Bins::new(&seam, place, reach);
    let mut near: Vec<(f64, u32)> = Vec::new();
    let of_end = |s: &Segment| s.ends.iter().filter(|e| matches!(e, End::Face(_))).count();
    let ends: usize = segments.cut.iter().map(of_end).sum();
    let most = (MOST_SHIFTS / ends.max(1)).max(1);
    let mut shifts = Vec::new();
    for (piece, s) in segments.cut.iter().enumerate() {
        let xi = segments.body.bond(s.i as usize, s.j as usize);
        if (s.piece.to - s.piece.from) * xi.norm() < shortest {
            continue;
        }
        for (side, end) in s.ends.iter().enumerate() {
            let End::Face(foot) = end else { continue };
            let at = [s.piece.from, s.piece.to][side];
            let x = cloud.position[s.i as usize] + xi * at;
            let trace: Vec<u32> = foot.trace.iter().map(|t| t.0).collect();
            node_bins.near(&x, |site| trace.contains(&site), &mut near);
            let mut around = trace;
            let room = (MOST_BESIDE + D + 1).saturating_sub(around.len());
            around.extend(near.iter().take(room).map(|n| n.1));
            let own = [s.i, s.j].map(|p| segments.site[p as usize]);
            point_bins.near(&x, |site| own.contains(&site), &mut near);
            around.extend(near.iter().take(MOST_POINTS * D).map(|n| n.1));
            let affine = |r: usize| -> Vec<f64> {
                let of = |&site: &u32| match r {
                    0 => 1.0,
                    _ => (sites[site as usize].position[r - 1] - x[r - 1]) / reach,
                };
                around.iter().map(of).collect()
            };
            let mut basis: Vec<Vec<f64>> = Vec::new();
            for r in 0..=D {
                let whole = affine(r);
                let size = norm(&whole);
                if size > 0.0
                    && let Some(row) =
                        beside(whole.iter().map(|v| v / size).collect(), &basis, 1e-9)
                {
                    basis.push(row);
                }
            }
            let affine_rows = basis.len();
            for k in 0..around.len() {
                let unit = (0..around.len()).map(|a| f64::from(a == k)).collect();
                if let Some(new) = beside(unit, &basis, NEW) {
                    basis.push(new);
                }
            }
            shifts.extend(
                basis
                    .split_off(affine_rows)
                    .into_iter()
                    .take(most)
                    .map(|v| Shift {
                        piece,
                        side,
                        weights: around.iter().copied().zip(v).collect(),
                    }),
            );
        }
    }
    shifts
}

/// Sites in bins.
struct Bins<const D: usize> {
    reach: f64,
    sites: FxHashMap<[i64; D], Vec<(u32, Vector<D>)>>,
}

impl<const D: usize> Bins<D> {
    fn new(list: &[u32], place: impl Fn(u32) -> Vector<D>, reach: f64) -> Self {
        let mut bins = Self {
            reach,
            sites: FxHashMap::default(),
        };
        for &site in list {
            let x = place(site);
            let of = bins.sites.entry(bins.key(&x)).or_default();
            of.push((site, x));
        }
        bins
    }

    fn key(&self, x: &Vector<D>) -> [i64; D] {
        std::array::from_fn(|i| (x[i] / self.reach).floor() as i64)
    }

    /// Collects the sites within reach but those that are `left_out`, with their distances, nearest first.
    fn near(&self, x: &Vector<D>, left_out: impl Fn(u32) -> bool, near: &mut Vec<(f64, u32)>) {
        near.clear();
        let middle = self.key(x);
        for number in 0..3usize.pow(D as u32) {
            let mut rest = number;
            let bin = middle.map(|k| {
                let step = (rest % 3) as i64 - 1;
                rest /= 3;
                k + step
            });
            for (site, y) in self.sites.get(&bin).into_iter().flatten() {
                let away = (y - x).norm();
                if away <= self.reach && !left_out(*site) {
                    near.push((away, *site));
                }
            }
        }
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// The part of `v` beside all of `basis`, of the length 1; none if little is left. Twice, for round-off.
fn beside(mut v: Vec<f64>, basis: &[Vec<f64>], least: f64) -> Option<Vec<f64>> {
    for pass in 0..2 {
        for b in basis {
            let along: f64 = b.iter().zip(&v).map(|(b, v)| b * v).sum();
            v.iter_mut().zip(b).for_each(|(v, b)| *v -= along * b);
        }
        let size = norm(&v);
        if pass == 0 && size <= least {
            return None;
        }
        v.iter_mut().for_each(|v| *v /= size);
    }
    Some(v)
}
