//! Bonds that a crack cuts, where it is pressed shut.
//!
//! Faces alone leave a closed crack softer than the body: points beside it lack the bonds across. A bond-based material has these bonds back as long as they push. The bond `ξ` from a point on one side to a point on the other,
//! cut where the faces have moved apart by `g`, has the vector
//!
//! ```text
//! p = ξ + η − (1 − n nᵀ) g ,      f = k min(|p| − |ξ|, 0) p/|p| ,
//! ```
//!
//! with the normal `n` of the crack at rest and the stiffness `k` of the same bond in a whole lattice. What faces slide along each other drops out, so that they slide freely; what presses them together is borne as by the whole body.
//! `g` is the difference of the displacements of the faces, which follow the points on their sides as in `crack_faces.rs`.

use std::borrow::Cow;
use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::crack_faces::{Face, faces};
use super::{SurfaceContact, closest};
use crate::assembly::Transfer;
use crate::model::{Bins, Model};
use crate::parallel;
use crate::shape::Barriers;
use crate::system::{ForceTerm, Interval, RateBounds, SpringRows};
use crate::tensor::Vector;

/// Offsets of a lattice are told apart by this part of its spacing.
const ALIKE: f64 = 1e-3;

/// The displacement over which forces are differenced, over the spacing.
const DIFFERENCED: f64 = 1e-7;

/// A bond that a crack cuts.
#[derive(Clone, Debug)]
struct CutBond<const D: usize> {
    xi: Vector<D>,
    /// Stiffness \[N/m\].
    stiffness: f64,
    /// Normal of the crack, to the side of the far end.
    normal: Vector<D>,
}

/// A bond that is shorter than at rest.
struct Pressed<const D: usize> {
    /// `k (|p| − |ξ|)` \[N\].
    force: f64,
    way: Vector<D>,
}

/// The bonds that the cracks of a model cut, which push where they are shorter than at rest.
#[derive(Debug)]
pub struct CrackBonds<const D: usize> {
    bonds: Vec<CutBond<D>>,
    /// The relative displacement `η` of the ends of each, and the jump `g` of the faces.
    ends: Transfer,
    jumps: Transfer,
    spacing: f64,
    sites: usize,
}

impl<const D: usize> CrackBonds<D> {
    /// Of a model of points on one lattice whose forces are those of pairs; none of any other, or where no crack cuts a bond.
    pub fn new(model: &Model<D>) -> Option<Self> {
        let (body, p) = (model.body()?, model.peridynamics.as_ref()?);
        let has_one_horizon = body.cloud.horizon.values().len() == 1;
        if !model.is_lattice() || !has_one_horizon || !p.law.linearised().is_pairwise() {
            return None;
        }
        let faces: Vec<Face<D>> = faces(model);
        if faces.is_empty() {
            return None;
        }
        let spacing = model.spacing();
        let key = |xi: &Vector<D>| -> [i64; D] {
            std::array::from_fn(|a| (xi[a] / (ALIKE * spacing)).round() as i64)
        };
        // f = 2 p ξ (ξ·η) V V′ of whole bonds by their offsets
        let mut whole: FxHashMap<[i64; D], f64> = FxHashMap::default();
        for i in 0..body.families.len() {
            let coefficients = body.kernel(i).0;
            for (&j, c) in body.families.of(i).iter().zip(coefficients) {
                let most = whole.entry(key(&body.bond(i, j as usize))).or_default();
                *most = most.max(*c);
            }
        }
        let sites: Vec<(u32, usize)> = (0..model.sites.len())
            .filter_map(|s| Some((s as u32, model.point_of(s)?.1)))
            .collect();
        let positions: Vec<Vector<D>> =
            sites.iter().map(|&(_, p)| body.cloud.position[p]).collect();
        let horizon = body.cloud.horizon.largest();
        let bins = Bins::new(&positions, horizon);
        let barriers = Barriers::new(p.barriers.clone());
        let middles: Vec<Vector<D>> = faces.iter().map(Face::middle).collect();
        let by_face = Bins::new(&middles, spacing);
        let mut found = Self {
            bonds: Vec::new(),
            ends: Transfer::new(model.sites.len()),
            jumps: Transfer::new(model.sites.len()),
            spacing,
            sites: model.sites.len(),
        };
        for (a, &(site, point)) in sites.iter().enumerate() {
            let x = positions[a];
            if !barriers.near(&x, horizon) {
                continue;
            }
            let mut others: Vec<usize> = bins.around(&x, horizon).filter(|&b| b > a).collect();
            others.sort_unstable();
            for b in others {
                let xi = positions[b] - x;
                let Some(c) = whole.get(&key(&xi)) else {
                    continue;
                };
                if !barriers.cuts(&x, &positions[b]) {
                    continue;
                }
                let Some((face, weights)) = crossed(&faces, &by_face, (&x, &xi), spacing) else {
                    continue;
                };
                let (other, far) = sites[b];
                let volumes = body.cloud.volume[point] * body.cloud.volume[far];
                let side = face.normal.dot(&xi).signum();
                found.bonds.push(CutBond {
                    xi,
                    stiffness: 2.0 * c * xi.norm_squared() * volumes,
                    normal: face.normal * side,
                });
                found.ends.push(vec![(site, -1.0), (other, 1.0)]);
                let mut jump = Vec::new();
                for (k, w) in weights.iter().enumerate() {
                    for (rows, sign) in [(&face.above[k], side), (&face.below[k], -side)] {
                        jump.extend(rows.iter().map(|(s, v)| (*s, v * w * sign)));
                    }
                }
                found.jumps.push(jump);
            }
        }
        (!found.bonds.is_empty()).then_some(found)
    }

    /// Number of bonds.
    pub fn count(&self) -> usize {
        self.bonds.len()
    }

    /// A bond at a displacement, where it is shorter than at rest.
    fn pressed(&self, k: usize, u: &[f64]) -> Option<Pressed<D>> {
        let bond = &self.bonds[k];
        let jump = self.jumps.displacement::<D>(k, u);
        let slip = jump - bond.normal * bond.normal.dot(&jump);
        let p = bond.xi + self.ends.displacement::<D>(k, u) - slip;
        let (length, rest) = (p.norm(), bond.xi.norm());
        (length < rest && length > 0.0).then(|| Pressed {
            force: bond.stiffness * (length - rest),
            way: p / length,
        })
    }

    /// The sites of a bond with the vector that the way of its force is multiplied by at each: of the ends, less what slip takes.
    fn parts(&self, k: usize, way: &Vector<D>) -> Vec<(u32, Vector<D>)> {
        let normal = self.bonds[k].normal;
        let along = way - normal * normal.dot(way);
        let ends = self.ends.row(k).map(|(site, w)| (site, way * w));
        let jumps = self.jumps.row(k).map(|(site, w)| (site, along * -w));
        ends.chain(jumps).collect()
    }

    /// The bonds that push.
    fn all(&self, u: &[f64]) -> Vec<(usize, Pressed<D>)> {
        parallel::filter_map(self.bonds.len(), 256, |k| Some((k, self.pressed(k, u)?)))
    }
}

/// The face that a bond from `x` crosses, with the barycentric coordinates of its corners there.
fn crossed<'f, const D: usize>(
    faces: &'f [Face<D>],
    by_face: &Bins<D>,
    (x, xi): (&Vector<D>, &Vector<D>),
    spacing: f64,
) -> Option<(&'f Face<D>, [f64; D])> {
    let mut best: Option<(f64, &Face<D>, [f64; D])> = None;
    for f in by_face.in_box(
        x.inf(&(x + xi)).add_scalar(-spacing),
        x.sup(&(x + xi)).add_scalar(spacing),
    ) {
        let face = &faces[f];
        let across = face.normal.dot(xi);
        if across == 0.0 {
            continue;
        }
        let t = face.normal.dot(&(face.corners[0] - x)) / across;
        let at = x + xi * t.clamp(0.0, 1.0);
        let weights = closest::nearest(&face.corners, &at);
        let nearest: Vector<D> = face.corners.iter().zip(weights).map(|(c, w)| c * w).sum();
        let off = (nearest - at).norm();
        if best.as_ref().is_none_or(|(least, ..)| off < *least) {
            best = Some((off, face, weights));
        }
    }
    best.filter(|(off, ..)| *off < 0.5 * spacing)
        .map(|(_, face, weights)| (face, weights))
}

impl<const D: usize> ForceTerm for CrackBonds<D> {
    fn own_masses(&self) -> Vec<f64> {
        Vec::new()
    }

    fn add_force(&self, u: &[f64], force: &mut [f64], _interval: Interval) {
        for (k, pressed) in self.all(u) {
            for (site, part) in self.parts(k, &pressed.way) {
                let to = &mut force[site as usize * D..][..D];
                (0..D).for_each(|a| to[a] += pressed.force * part[a]);
            }
        }
    }

    fn rows(&self, at: Option<&[f64]>) -> Option<Cow<'_, SpringRows>> {
        let mut blocks: BTreeMap<(u32, u32), Vec<f64>> = BTreeMap::new();
        for (k, pressed) in self.all(at?) {
            let parts = self.parts(k, &pressed.way);
            for (i, p) in &parts {
                for (j, q) in &parts {
                    let sum = blocks.entry((*i, *j)).or_insert_with(|| vec![0.0; D * D]);
                    for a in 0..D {
                        for b in 0..D {
                            sum[a * D + b] += self.bonds[k].stiffness * p[a] * q[b];
                        }
                    }
                }
            }
        }
        (!blocks.is_empty()).then(|| Cow::Owned(SpringRows::from_blocks(D, &blocks)))
    }

    fn add_row_sums(&self, sums: &mut Vec<f64>) {
        for (site, bound) in self.bounds().into_iter().enumerate() {
            sums[site * D..][..D].iter_mut().for_each(|s| *s += bound);
        }
    }

    fn difference_length(&self) -> Option<f64> {
        Some(DIFFERENCED * self.spacing)
    }

    fn rate_bounds(&self, mass: &[f64]) -> RateBounds {
        let each = self.bounds().into_iter().zip(mass).map(|(b, m)| b / m);
        RateBounds {
            stiffness: each.fold(0.0, f64::max),
            drag: 0.0,
        }
    }

    fn round_off(&self, _u: &[f64]) -> f64 {
        0.0
    }

    fn energy(&self, u: &[f64]) -> f64 {
        let each = self.all(u).into_iter();
        let energy = each.map(|(k, p)| 0.5 * p.force * p.force / self.bonds[k].stiffness);
        energy.sum::<f64>() + 0.0
    }

    fn commit(&self, _u: &[f64], _interval: Interval) {}

    fn dissipated(&self) -> Option<f64> {
        None
    }

    fn state(&self) -> Vec<u64> {
        Vec::new()
    }

    fn restore(&self, state: &[u64]) -> bool {
        state.is_empty()
    }
}

impl<const D: usize> CrackBonds<D> {
    /// Bound of the row sums at each site, all bonds pushing \[N/m\].
    fn bounds(&self) -> Vec<f64> {
        let mut bounds = vec![0.0; self.sites];
        for (k, bond) in self.bonds.iter().enumerate() {
            let row = || self.ends.row(k).chain(self.jumps.row(k));
            let all: f64 = row().map(|(_, w)| w.abs()).sum();
            // Σ_b |n_a n_b| ≤ √D
            let each = bond.stiffness * all * (D as f64).sqrt();
            row().for_each(|(site, w)| bounds[site as usize] += each * w.abs());
        }
        bounds
    }
}

impl<const D: usize> SurfaceContact<D> {
    /// Bonds across the closed cracks of a model, where nothing but the pressure of their faces acts.
    pub fn crack_bonds(&self, model: &Model<D>) -> Option<CrackBonds<D>> {
        match self.law.friction > 0.0 {
            true => None,
            false => CrackBonds::new(model),
        }
    }
}
