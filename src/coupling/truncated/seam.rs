//! The faces at which the peridynamic zone ends, and the pieces of a bond that lie inside of it.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::coupling::truncated::piece::{
    Course, Piece, add, beyond_edges, crossing, for_box, normal_of,
};
use crate::{
    fem::{self, Locator},
    model::{Model, bins::bin_of},
    tensor::Vector,
};

/// Distance, relative to the size of a bin of faces, within which a position is on a face.
const ON_FACE: f64 = 1e-9;

/// Distance of probes from a bond that touches faces, edges or corners, relative to the size of a bin.
///
/// Far above [`ON_FACE`], far below any distance within a lattice.
const PROBE: f64 = 1e-6;

/// Distance from the edges of a face within which a bond passes through an edge, relative to the size of a bin.
const EDGE: f64 = 1e-6;

/// Places on a bond that are this near to each other, as fractions of it, are one.
const SAME: f64 = 1e-8;

/// A face between the zone and an element.
struct Face<const D: usize> {
    nodes: Vec<u32>,
    /// Its corners, one triangle after another in 3D, with the unit normal of each; none of a degenerate one.
    simplices: Vec<([Vector<D>; D], Option<Vector<D>>)>,
    /// The box around it, a little larger.
    low: Vector<D>,
    high: Vector<D>,
    cell: u32,
}

impl<const D: usize> Face<D> {
    /// Returns true if its box meets another.
    fn may_meet(&self, low: &Vector<D>, high: &Vector<D>) -> bool {
        (0..D).all(|i| low[i] <= self.high[i] && high[i] >= self.low[i])
    }
}

/// Relation of a cell to a lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// It holds points of the lattice.
    Points,
    /// It is an element.
    Element,
    /// It holds points of another lattice.
    Other,
}

/// Returns the relation of each cell of a model to a lattice.
pub(super) fn sides<const D: usize>(model: &Model<D>, lattice: usize) -> Vec<Side> {
    (0..model.mesh.cell_count())
        .map(|c| match model.lattice_of_cell(c) {
            Some(l) if l == lattice => Side::Points,
            Some(_) => Side::Other,
            None if model.is_element(c) => Side::Element,
            None => Side::Other,
        })
        .collect()
}

/// All faces of the zone, in bins.
pub(super) struct Seam<'a, const D: usize> {
    model: &'a Model<D>,
    faces: Vec<Face<D>>,
    bins: FxHashMap<[i64; D], Vec<u32>>,
    /// Bins from which a bond reaches a face.
    around: FxHashSet<[i64; D]>,
    /// Edge of a bin \[m\], about the length of a bond.
    size: f64,
    /// Length of the longest bond \[m\].
    longest: f64,
    zone: Locator<D>,
}

/// End of a piece on faces: the nodes with their weights, and the elements behind.
#[derive(Clone, Debug)]
pub(super) struct Foot {
    /// Sites and weights of the trace of the displacement.
    pub trace: Vec<(u32, f64)>,
    /// The elements behind, which share the end equally.
    pub cells: Vec<u32>,
}

impl Foot {
    /// Adds weights, times `by`, to the trace.
    pub fn shift(&mut self, weights: &[(u32, f64)], by: f64) {
        for &(site, w) in weights {
            match self.trace.iter_mut().find(|t| t.0 == site) {
                Some((_, own)) => *own += by * w,
                None => self.trace.push((site, by * w)),
            }
        }
    }
}

impl<'a, const D: usize> Seam<'a, D> {
    /// Collects the faces of one lattice of a model; `size` is about the length of its bonds, none of which is longer than `longest`.
    pub fn new(model: &'a Model<D>, lattice: usize, size: f64, longest: f64) -> Self {
        let mesh = &model.mesh;
        let side = sides(model, lattice);
        let mut faces = Vec::new();
        let mut bins: FxHashMap<[i64; D], Vec<u32>> = FxHashMap::default();
        let mut around = FxHashSet::default();
        for facet in mesh.interface_facets(&side, &Side::Points, &Side::Element) {
            let n = facet.first.nodes;
            let x = |i: usize| mesh.nodes[n[i.min(n.len() - 1)] as usize];
            let mut simplices: Vec<[Vector<D>; D]> = vec![std::array::from_fn(x)];
            if n.len() == 4 {
                simplices.push(std::array::from_fn(|i| x([0, 2, 3][i.min(2)])));
            }
            let with_normal = |corners| (corners, normal_of(&corners));
            let (low, high) = mesh.bounds_of(&n);
            let margin = Vector::repeat(size * 1e-3);
            for_box(
                &bin_of(&(low - margin), size),
                &bin_of(&(high + margin), size),
                |key| {
                    bins.entry(key).or_default().push(faces.len() as u32);
                },
            );
            let reach = Vector::repeat(longest * (1.0 + 1e-3));
            for_box(
                &bin_of(&(low - reach), size),
                &bin_of(&(high + reach), size),
                |key| {
                    around.insert(key);
                },
            );
            faces.push(Face {
                nodes: n,
                simplices: simplices.into_iter().map(with_normal).collect(),
                low: low.add_scalar(-2.0 * EDGE * size),
                high: high.add_scalar(2.0 * EDGE * size),
                cell: facet.second.cell,
            });
        }
        Self {
            model,
            faces,
            bins,
            around,
            size,
            longest,
            zone: Locator::new(
                mesh,
                (0..mesh.cell_count()).filter(|&c| side[c] == Side::Points),
            ),
        }
    }

    /// Collects the faces that a bond of a point at `x` may meet, each once, ascending.
    pub fn faces_around(&self, x: &Vector<D>, near: &mut Vec<u32>) {
        near.clear();
        let reach = self.longest * (1.0 + 1e-3);
        let (low, high) = (x.add_scalar(-reach), x.add_scalar(reach));
        for_box(&bin_of(&low, self.size), &bin_of(&high, self.size), |key| {
            near.extend(self.bins.get(&key).into_iter().flatten().copied());
        });
        near.sort_unstable();
        near.dedup();
    }

    /// Those of `faces` whose box meets that of a bond.
    fn meeting<'f>(
        &'f self,
        a: &Vector<D>,
        b: &Vector<D>,
        faces: &'f [u32],
    ) -> impl Iterator<Item = &'f Face<D>> {
        let (low, high) = (a.inf(b), a.sup(b));
        let faces = faces.iter().map(|&f| &self.faces[f as usize]);
        faces.filter(move |face| face.may_meet(&low, &high))
    }

    /// Returns true if `x` lies on one of the faces.
    fn touches(&self, x: &Vector<D>, faces: &[u32]) -> bool {
        let distance = |face: &Face<D>| self.model.mesh.distance_to_facet(x, &face.nodes);
        self.meeting(x, x, faces)
            .any(|face| distance(face) <= ON_FACE * self.size)
    }

    /// Returns the course of the bond from `a` to `b`, as far as its ends and the faces determine it; `is_site` is true for an end that is a point of the zone.
    ///
    /// Between two cuts a bond lies inside or outside of the zone as a whole; next to an end off the faces it lies on the side of that end.
    pub fn course(
        &self,
        a: &Vector<D>,
        b: &Vector<D>,
        is_site: [bool; 2],
        faces: &[u32],
    ) -> Course {
        let tolerance = 2.0 * ON_FACE * self.size;
        let edge = EDGE * self.size;
        let mut on_face = [false; 2];
        let (mut hit, mut is_at_edge): (Option<f64>, bool) = (None, true);
        for face in self.meeting(a, b, faces) {
            for (corners, normal) in &face.simplices {
                let Some(normal) = normal else {
                    return Course::Unclear;
                };
                let (p, q) = ((a - corners[0]).dot(normal), (b - corners[0]).dot(normal));
                if (p > tolerance && q > tolerance) || (p < -tolerance && q < -tolerance) {
                    continue;
                }
                let ends = [p.abs() <= tolerance, q.abs() <= tolerance];
                if ends == [true; 2] {
                    return Course::Unclear;
                }
                let t = match ends {
                    [true, _] => 0.0,
                    [_, true] => 1.0,
                    _ => p / (p - q),
                };
                let beyond = beyond_edges(&(a + (b - a) * t), corners, normal);
                if beyond > edge {
                    continue;
                }
                if beyond > tolerance {
                    return Course::Unclear;
                }
                if ends != [false; 2] {
                    on_face[usize::from(ends[1])] = true;
                    continue;
                }
                is_at_edge &= beyond > -edge;
                match hit {
                    _ if !(SAME..1.0 - SAME).contains(&t) => return Course::Unclear,
                    Some(known) if (known - t).abs() > SAME => return Course::Unclear,
                    Some(known) => hit = Some(known.min(t)),
                    None => hit = Some(t),
                }
            }
        }
        let state = |k: usize| match (is_site[k], on_face[k]) {
            (true, true) => None,
            (false, true) => Some(None),
            (is_site, false) => Some(Some(is_site)),
        };
        let (Some(first), Some(last)) = (state(0), state(1)) else {
            return Course::Unclear;
        };
        let all = |inside: bool| match inside {
            true => Course::Inside,
            false => Course::Outside,
        };
        match (hit, first, last) {
            (None, Some(s), None) | (None, None, Some(s)) => all(s),
            (None, Some(s), Some(r)) if s == r => all(s),
            // through an edge of the zone, past it
            (Some(_), Some(s), Some(r)) if s == r && is_at_edge => all(s),
            (Some(t), Some(s), Some(r)) if s != r => Course::Cut(t),
            _ => Course::Unclear,
        }
    }

    fn in_zone(&self, x: &Vector<D>) -> bool {
        self.zone.locate(&self.model.mesh, x, ON_FACE).is_some()
    }

    /// The pieces of the bond from `a` to `b` that lie in the zone, in order.
    ///
    /// A bond within a face or an edge, or through an edge or a corner, counts as the mean of the bonds beside it. Otherwise the sum of a shape function
    /// over the ends on a face would not equal its integral. `near` lists the faces around, as [`Seam::faces_around`] gives them.
    pub fn pieces(&self, a: &Vector<D>, b: &Vector<D>, near: &[u32], pieces: &mut Vec<Piece>) {
        pieces.clear();
        let mut cuts = vec![0.0, 1.0];
        for face in self.meeting(a, b, near) {
            for (corners, normal) in &face.simplices {
                let normal = normal.as_ref();
                cuts.extend(normal.and_then(|n| crossing(a, b, corners, n, ON_FACE * self.size)));
            }
        }
        cuts.sort_unstable_by(f64::total_cmp);
        cuts.dedup_by(|t, s| *t - *s <= SAME);
        // the last may have swallowed 1
        if let Some(last) = cuts.last_mut()
            && 1.0 - *last <= SAME
        {
            *last = 1.0;
        }
        let at = |t: f64| a + (b - a) * t;
        // a tie is decided by the bonds beside this one
        let tied = cuts
            .windows(2)
            .any(|w| self.touches(&at(0.5 * (w[0] + w[1])), near));
        let probes = if tied { 1 << D } else { 1 };
        for probe in 0..probes {
            let offset = Vector::<D>::from_fn(|i, _| {
                let unequal = [1.0, 0.83, 0.61][i];
                let sign = if probe >> i & 1 == 1 { 1.0 } else { -1.0 };
                if tied {
                    sign * unequal * PROBE * self.size
                } else {
                    0.0
                }
            });
            let share = 1.0 / f64::from(probes);
            let mut open: Option<f64> = None;
            for w in cuts.windows(2) {
                let inside = self.in_zone(&(at(0.5 * (w[0] + w[1])) + offset));
                match (inside, open) {
                    (true, None) => open = Some(w[0]),
                    (false, Some(from)) => {
                        add(pieces, from, w[0], share);
                        open = None;
                    }
                    _ => {}
                }
            }
            if let Some(from) = open {
                add(pieces, from, 1.0, share);
            }
        }
        pieces.sort_unstable_by(|p, q| p.from.total_cmp(&q.from).then(p.to.total_cmp(&q.to)));
    }

    /// Returns true if a bond of a point at `x` may meet a face.
    pub fn is_around(&self, x: &Vector<D>) -> bool {
        self.around.contains(&bin_of(x, self.size))
    }

    /// Returns true if the bond from `a` to `b` may meet a face.
    pub fn near(&self, a: &Vector<D>, b: &Vector<D>) -> bool {
        let mut found = false;
        for_box(
            &bin_of(&a.inf(b), self.size),
            &bin_of(&a.sup(b), self.size),
            |key| found |= self.bins.contains_key(&key),
        );
        found
    }

    /// The end of a piece at `x` on the faces that `near` lists; `None` if no face is there.
    pub fn foot(&self, x: &Vector<D>, near: &[u32]) -> Option<Foot> {
        let mesh = &self.model.mesh;
        let distance = |face: &&Face<D>| mesh.distance_to_facet(x, &face.nodes);
        let mut faces = self
            .meeting(x, x, near)
            .filter(|face| distance(face) <= 1e-7 * self.size);
        let first = faces.next()?;
        let mut trace: Vec<(u32, f64)> = Vec::with_capacity(4);
        let mut weigh = |n: u32, w: f64| {
            if w.abs() > 1e-9 {
                let row = self.model.node_transfer.row(n as usize);
                trace.extend(row.map(|(site, share)| (site, share * w)));
            }
        };
        if let [p, q] = first.nodes[..] {
            // linear along an edge
            let from = mesh.nodes[p as usize];
            let along = mesh.nodes[q as usize] - from;
            let t = (x - from).dot(&along) / along.norm_squared();
            weigh(p, 1.0 - t);
            weigh(q, t);
        } else {
            let cell = first.cell as usize;
            let reference = fem::reference_of(mesh, cell, x)?;
            let (shape, count) = fem::shape_values(mesh, cell, &reference);
            (mesh.cell(cell).iter().zip(&shape[..count])).for_each(|(&n, &w)| weigh(n, w));
        }
        let cells = std::iter::once(first).chain(faces).map(|face| face.cell);
        let cells = cells.collect();
        // what rounding leaves on the nodes behind the face goes to those on it
        let sum: f64 = trace.iter().map(|t| t.1).sum();
        trace.iter_mut().for_each(|t| t.1 /= sum);
        Some(Foot { trace, cells })
    }
}

#[cfg(test)]
#[path = "seam_tests.rs"]
mod tests;
