//! The faces at which the peridynamic zone ends, and the pieces of a bond that lie inside of it.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::{
    coupling::Model,
    fem::{self, Locator},
    tensor::Vector,
};

/// How near, relative to the size of a bin of faces, a position is on a face.
const ON_FACE: f64 = 1e-9;

/// Distance of probes from a bond that touches faces, edges or corners, relative to the size of a bin.
///
/// Far above [`ON_FACE`], far below any distance within a lattice.
const PROBE: f64 = 1e-6;

/// A piece of a bond inside of the peridynamic zone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    /// Where it starts, as a fraction of the bond.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// How much of the bond runs there: less than 1 for a bond within a face or an edge of the zone, or through an edge.
    pub share: f64,
}

/// A face between the zone and an element.
struct Face<const D: usize> {
    nodes: Vec<u32>,
    /// Its corners, one triangle after another in 3D.
    simplices: Vec<[Vector<D>; D]>,
    cell: u32,
}

/// What a cell is to a lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// It holds points of the lattice.
    Points,
    /// It is an element.
    Element,
    /// It holds points of another lattice.
    Other,
}

/// What each cell of a model is to a lattice.
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
    size: f64,
    zone: Locator<D>,
}

/// Where a bond ends on faces: the nodes with their weights, and the elements behind.
#[derive(Clone, Debug)]
pub(super) struct Foot {
    /// Sites and weights of the trace of the displacement.
    pub trace: Vec<(u32, f64)>,
    /// The elements behind, which share the end equally.
    pub cells: Vec<u32>,
}

impl<'a, const D: usize> Seam<'a, D> {
    /// Collects the faces of one lattice of a model; `size` is about the length of its bonds.
    pub fn new(model: &'a Model<D>, lattice: usize, size: f64) -> Self {
        let mesh = &model.mesh;
        let side = sides(model, lattice);
        let mut faces = Vec::new();
        let mut bins: FxHashMap<[i64; D], Vec<u32>> = FxHashMap::default();
        let mut around = FxHashSet::default();
        for facet in mesh.interface_facets(&side, &Side::Points, &Side::Element) {
            let n = facet.first.nodes;
            let x = |i: usize| mesh.nodes[n[i.min(n.len() - 1)] as usize];
            let mut simplices = vec![std::array::from_fn(x)];
            if n.len() == 4 {
                simplices.push(std::array::from_fn(|i| x([0, 2, 3][i.min(2)])));
            }
            let (low, high) = mesh.bounds_of(&n);
            let margin = Vector::repeat(size * 1e-3);
            for_box(
                &bin(&(low - margin), size),
                &bin(&(high + margin), size),
                |key| {
                    bins.entry(key).or_default().push(faces.len() as u32);
                },
            );
            let reach = Vector::repeat(size * (1.0 + 1e-3));
            for_box(
                &bin(&(low - reach), size),
                &bin(&(high + reach), size),
                |key| {
                    around.insert(key);
                },
            );
            faces.push(Face {
                nodes: n,
                simplices,
                cell: facet.second.cell,
            });
        }
        Self {
            model,
            faces,
            bins,
            around,
            size,
            zone: Locator::new(
                mesh,
                (0..mesh.cell_count()).filter(|&c| side[c] == Side::Points),
            ),
        }
    }

    /// The faces that a bond may meet, each once.
    fn faces_near(&self, a: &Vector<D>, b: &Vector<D>) -> Vec<u32> {
        let mut near = Vec::new();
        for_box(
            &bin(&a.inf(b), self.size),
            &bin(&a.sup(b), self.size),
            |key| near.extend(self.bins.get(&key).into_iter().flatten().copied()),
        );
        near.sort_unstable();
        near.dedup();
        near
    }

    /// Whether `x` lies on one of the faces.
    fn touches(&self, x: &Vector<D>, faces: &[u32]) -> bool {
        faces.iter().any(|&f| {
            let nodes = &self.faces[f as usize].nodes;
            self.model.mesh.distance_to_facet(x, nodes) <= ON_FACE * self.size
        })
    }

    fn in_zone(&self, x: &Vector<D>) -> bool {
        self.zone.locate(&self.model.mesh, x, ON_FACE).is_some()
    }

    /// The pieces of the bond from `a` to `b` that lie in the zone, in order.
    ///
    /// A bond that runs within a face or an edge, or through an edge or a corner, is the mean of the bonds beside it: only so
    /// does the sum of a shape function over the ends on a face equal its integral.
    pub fn pieces(&self, a: &Vector<D>, b: &Vector<D>, pieces: &mut Vec<Piece>) {
        pieces.clear();
        let near = self.faces_near(a, b);
        let mut cuts = vec![0.0, 1.0];
        for &f in &near {
            for simplex in &self.faces[f as usize].simplices {
                cuts.extend(crossing(a, b, simplex, ON_FACE * self.size));
            }
        }
        cuts.sort_unstable_by(f64::total_cmp);
        cuts.dedup_by(|t, s| *t - *s <= 1e-8);
        // the last may have swallowed 1
        if let Some(last) = cuts.last_mut()
            && 1.0 - *last <= 1e-8
        {
            *last = 1.0;
        }
        let at = |t: f64| a + (b - a) * t;
        // a tie is decided by the bonds beside this one
        let tied = cuts
            .windows(2)
            .any(|w| self.touches(&at(0.5 * (w[0] + w[1])), &near));
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

    /// Whether a bond of a point can meet a face at all.
    pub fn is_around(&self, x: &Vector<D>) -> bool {
        self.around.contains(&bin(x, self.size))
    }

    /// Whether a bond can meet a face at all.
    pub fn near(&self, a: &Vector<D>, b: &Vector<D>) -> bool {
        let mut found = false;
        for_box(
            &bin(&a.inf(b), self.size),
            &bin(&a.sup(b), self.size),
            |key| found |= self.bins.contains_key(&key),
        );
        found
    }

    /// The end of a bond at `x`, on the faces; `None` if no face is there.
    pub fn foot(&self, x: &Vector<D>) -> Option<Foot> {
        let mesh = &self.model.mesh;
        let mut near = self.faces_near(x, x);
        near.retain(|&f| {
            mesh.distance_to_facet(x, &self.faces[f as usize].nodes) <= 1e-7 * self.size
        });
        let cell = self.faces[*near.first()? as usize].cell as usize;
        let reference = fem::reference_of(mesh, cell, x)?;
        let (shape, count) = fem::shape_values(mesh, cell, &reference);
        let mut trace: Vec<(u32, f64)> = Vec::with_capacity(count);
        for (&n, &w) in mesh.cell(cell).iter().zip(&shape[..count]) {
            if w.abs() > 1e-9 {
                trace.extend(
                    self.model
                        .node_transfer
                        .row(n as usize)
                        .map(|(site, share)| (site, share * w)),
                );
            }
        }
        // what rounding leaves on the nodes behind the face goes to those on it
        let sum: f64 = trace.iter().map(|t| t.1).sum();
        trace.iter_mut().for_each(|t| t.1 /= sum);
        Some(Foot {
            trace,
            cells: near.iter().map(|&f| self.faces[f as usize].cell).collect(),
        })
    }
}

fn add(pieces: &mut Vec<Piece>, from: f64, to: f64, share: f64) {
    match pieces.iter_mut().find(|p| p.from == from && p.to == to) {
        Some(piece) => piece.share += share,
        None => pieces.push(Piece { from, to, share }),
    }
}

/// Where the bond from `a` to `b` passes a point (1D), an edge (2D) or a triangle (3D), as a fraction; none if it runs in its plane.
fn crossing<const D: usize>(
    a: &Vector<D>,
    b: &Vector<D>,
    corners: &[Vector<D>; D],
    tolerance: f64,
) -> Option<f64> {
    let normal = normal_of(corners)?;
    let (p, q) = ((a - corners[0]).dot(&normal), (b - corners[0]).dot(&normal));
    if (p > tolerance && q > tolerance)
        || (p < -tolerance && q < -tolerance)
        || (p - q).abs() <= 2.0 * tolerance
    {
        return None;
    }
    let t = (p / (p - q)).clamp(0.0, 1.0);
    let x = a + (b - a) * t;
    let outside = match D {
        1 => 0.0,
        2 => {
            let e = corners[1] - corners[0];
            let s = (x - corners[0]).dot(&e) / e.norm_squared();
            (-s).max(s - 1.0) * e.norm()
        }
        _ => (0..D)
            .map(|i| {
                // distance beyond the edge, within the plane
                let (c, d) = (corners[i], corners[(i + 1) % D]);
                let e = d - c;
                let v = x - c;
                let mut across = 0.0;
                for k in 0..3 {
                    let (l, m) = ((k + 1) % 3, (k + 2) % 3);
                    across += normal[k] * (e[l] * v[m] - e[m] * v[l]);
                }
                -across / e.norm()
            })
            .fold(f64::NEG_INFINITY, f64::max),
    };
    (outside <= tolerance).then_some(t)
}

/// Unit normal; none of a degenerate face.
fn normal_of<const D: usize>(x: &[Vector<D>; D]) -> Option<Vector<D>> {
    let mut n = Vector::<D>::zeros();
    match D {
        1 => n[0] = 1.0,
        2 => {
            let e = x[1] - x[0];
            (n[0], n[1]) = (e[1], -e[0]);
        }
        _ => {
            let (p, q) = (x[1] - x[0], x[2] - x[0]);
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                n[k] = p[i] * q[j] - p[j] * q[i];
            }
        }
    }
    let size = n.norm();
    (size > 0.0).then(|| n / size)
}

fn bin<const D: usize>(x: &Vector<D>, size: f64) -> [i64; D] {
    std::array::from_fn(|i| (x[i] / size).floor() as i64)
}

fn for_box<const D: usize>(first: &[i64; D], last: &[i64; D], mut visit: impl FnMut([i64; D])) {
    let mut at = *first;
    loop {
        visit(at);
        let mut axis = 0;
        while axis < D {
            if at[axis] < last[axis] {
                at[axis] += 1;
                break;
            }
            at[axis] = first[axis];
            axis += 1;
        }
        if axis == D {
            return;
        }
    }
}
