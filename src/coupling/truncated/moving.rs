//! Bonds at a seam that turn, stretch and break: pieces one by one; whole bonds are left to the pass over the body.
//!
//! A piece of the length s, a fraction of its bond ξ, has the energy `s w(ξ, D/s)`: it is stretched by `|ξ + D/s|/|ξ| − 1`, like the whole bond would be. The pieces of a bond break together, when one of them passes the critical
//! stretch, and take `s w` each. The elements behind the face keep their classical energy: a crack cannot go on into them.

use std::collections::HashSet;

use rayon::prelude::*;

use super::segments::Springs;
use crate::{
    assembly::{Row, Transfer},
    coupling::Model,
    peridynamics::{
        Families, PdBody,
        kernel::{BondPass, Kinematics, extension, pack, shortening, stretched, unpack},
    },
    system::Breakage,
    tensor::{Tensor, Vector},
};

/// Pieces per task.
const CHUNK: usize = 1024;

/// A piece of a bond.
#[derive(Clone, Copy, Debug)]
struct Part<const D: usize> {
    xi: [f64; D],
    /// `k/s`, of the energy `½ (k/s) (ξ·D)²` at rest.
    stiffness: f64,
    /// s.
    length: f64,
    bond: u32,
}

/// The bonds of a seam, apart from the whole ones of the body.
///
/// Source: none; `docs/truncated.md`. Shapes: displacements and forces have `D` numbers per site.
pub struct SeamBonds<const D: usize> {
    /// The families of the body without bonds that are not whole, or that a fit has changed.
    families: Families,
    parts: Vec<Part<D>>,
    /// Difference of displacement over each part.
    difference: Transfer,
    /// The points of each bond, ends or not, and the first of its parts.
    bonds: Vec<[u32; 2]>,
    first: Vec<u32>,
    intact: Vec<u8>,
    breaks: Option<Breaking>,
    kinematics: Kinematics,
    /// Sites at which parts end, and for each the parts with their weights.
    sites: Vec<u32>,
    offsets: Vec<usize>,
    ends: Vec<(u32, f64)>,
    /// Point, bond and volume of the far point: what a point loses with a bond, by point.
    lost: Vec<(u32, u32, f64)>,
    /// Bonds with a part between a face and a point next to it, with that point.
    next_to_face: Vec<(u32, u32)>,
    /// Whole bonds between two points next to a face.
    along_face: Vec<[u32; 2]>,
    pulls: Vec<[f64; D]>,
    /// Of each of `sites`, kept between passes.
    sums: Vec<[f64; D]>,
    over: Vec<bool>,
}

/// When bonds break.
struct Breaking {
    critical: f64,
    limit: f64,
    never: Vec<bool>,
}

impl<const D: usize> SeamBonds<D> {
    pub(super) fn new(
        model: &Model<D>,
        body: &PdBody<D>,
        springs: &Springs<D>,
        broken: &HashSet<(u32, u32)>,
    ) -> Self {
        let mut seam = Self {
            families: body.families.clone(),
            parts: Vec::new(),
            difference: Transfer::new(),
            bonds: Vec::new(),
            first: Vec::new(),
            intact: Vec::new(),
            breaks: None,
            kinematics: Kinematics::Linear,
            sites: Vec::new(),
            offsets: vec![0],
            ends: Vec::new(),
            lost: Vec::new(),
            next_to_face: Vec::new(),
            along_face: Vec::new(),
            pulls: Vec::new(),
            sums: Vec::new(),
            over: Vec::new(),
        };
        let mut taken = broken.clone();
        let mut of_site: Vec<(u32, u32, f64)> = Vec::new();
        for spring in springs.own() {
            let (xi, origin) = (spring.direction, spring.origin);
            if seam.bonds.last() != Some(&origin.bond) {
                seam.bonds.push(origin.bond);
                seam.first.push(seam.parts.len() as u32);
            }
            let bond = seam.bonds.len() as u32 - 1;
            let part = seam.parts.len() as u32;
            let row = &spring.difference;
            of_site.extend(row.iter().map(|&(site, w)| (site, part, w)));
            seam.difference.push(row);
            let length = origin.piece.to - origin.piece.from;
            seam.parts.push(Part {
                xi: xi.into(),
                stiffness: spring.stiffness,
                length,
                bond,
            });
            for (end, point) in origin.at.into_iter().enumerate() {
                let Some(point) = point else { continue };
                let far = body.cloud.volume[origin.bond[1 - end] as usize] * origin.piece.share;
                seam.lost.push((point, bond, far));
                let is_near = length * xi.norm() <= model.spacing() * (1.0 + 1e-6);
                if origin.at[1 - end].is_none() && is_near {
                    seam.next_to_face.push((bond, point));
                }
            }
            if let [Some(i), Some(j)] = origin.at {
                taken.insert((i.min(j), i.max(j)));
            }
        }
        seam.first.push(seam.parts.len() as u32);
        let whole = |i: u32, j: u32| !taken.contains(&(i.min(j), i.max(j)));
        let is_site = |p: u32| !body.families.of(p as usize).is_empty();
        seam.families
            .retain(|i, j| is_site(j) && whole(i as u32, j));
        let mut near = vec![false; body.cloud.position.len()];
        for &(_, p) in &seam.next_to_face {
            near[p as usize] = true;
        }
        for i in (0..near.len() as u32).filter(|&i| near[i as usize]) {
            let family = seam.families.of(i as usize).iter();
            let along = family.filter(|&&j| j > i && near[j as usize]);
            seam.along_face.extend(along.map(|&j| [i, j]));
        }
        seam.lost.sort_unstable_by_key(|l| (l.0, l.1));
        of_site.sort_unstable_by_key(|e| (e.0, e.1));
        for of in of_site.chunk_by(|a, b| a.0 == b.0) {
            seam.sites.push(of[0].0);
            seam.ends.extend(of.iter().map(|&(_, part, w)| (part, w)));
            seam.offsets.push(seam.ends.len());
        }
        seam.intact = vec![0xff; seam.bonds.len().div_ceil(8)];
        seam.pulls = vec![[0.0; D]; seam.parts.len()];
        seam.over = vec![false; seam.parts.len()];
        seam
    }

    /// How bonds follow the motion, at which stretch they break if at all, and by the number of a point whether its bonds never do.
    pub(in crate::coupling) fn behave(
        &mut self,
        kinematics: Kinematics,
        critical: Option<f64>,
        never: impl Fn(u32) -> bool,
    ) {
        self.kinematics = kinematics;
        self.breaks = critical.map(|critical| Breaking {
            critical,
            limit: kinematics.limit(critical),
            never: self
                .bonds
                .iter()
                .map(|b| b.iter().any(|&p| never(p)))
                .collect(),
        });
    }

    /// The families over which the body's own pass runs.
    pub(in crate::coupling) fn families(&self) -> &Families {
        &self.families
    }

    /// Whether the body's own pass knows of the bond between two points.
    pub(in crate::coupling) fn is_whole(&self, i: usize, j: usize) -> bool {
        self.families.of(i).binary_search(&(j as u32)).is_ok()
    }

    fn stands(&self, bond: u32) -> bool {
        self.intact[bond as usize / 8] >> (bond % 8) & 1 == 1
    }

    fn stretch<const EXACT: bool>(&mut self, u: &[f64]) {
        let (mut pulls, mut over) = (
            std::mem::take(&mut self.pulls),
            std::mem::take(&mut self.over),
        );
        let limit = self.breaks.as_ref().map_or(f64::INFINITY, |b| b.limit);
        pulls
            .par_chunks_mut(CHUNK)
            .zip(over.par_chunks_mut(CHUNK))
            .enumerate()
            .for_each(|(chunk, (pulls, over))| {
                for (k, (pull, over)) in pulls.iter_mut().zip(over).enumerate() {
                    let p = chunk * CHUNK + k;
                    let part = &self.parts[p];
                    (*pull, *over) = ([0.0; D], false);
                    if self.stands(part.bond) {
                        let d: Vector<D> = self.difference.displacement(p, u) / part.length;
                        let s = stretched::<D, EXACT>(&part.xi, &[0.0; D], d.as_slice());
                        let f =
                            part.stiffness * part.length * s.length * shortening::<EXACT>(s.t());
                        *pull = s.direction.map(|x| f * x);
                        *over = s.excess > limit * s.length;
                    }
                }
            });
        (self.pulls, self.over) = (pulls, over);
    }

    /// Adds the internal force; returns how many bonds broke, each counted once for each direction.
    pub(in crate::coupling) fn add_force(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        breakage: Breakage,
    ) -> u64 {
        match self.kinematics {
            Kinematics::Exact => self.stretch::<true>(u),
            Kinematics::Linear => self.stretch::<false>(u),
        }
        let broken = match breakage {
            Breakage::Allowed => self.break_bonds(),
            Breakage::Held => 0,
        };
        let mut sums = std::mem::take(&mut self.sums);
        self.scatter(&self.pulls, &mut sums, force);
        self.sums = sums;
        broken
    }

    fn break_bonds(&mut self) -> u64 {
        let Some(breaks) = &self.breaks else { return 0 };
        if !self.over.contains(&true) {
            return 0;
        }
        let mut broken = 0;
        for bond in 0..self.bonds.len() {
            let parts = self.first[bond] as usize..self.first[bond + 1] as usize;
            if self.over[parts.clone()].contains(&true) && !breaks.never[bond] {
                self.intact[bond / 8] &= !(1 << (bond % 8));
                self.pulls[parts].fill([0.0; D]);
                broken += 2;
            }
        }
        broken
    }

    fn scatter(&self, pulls: &[[f64; D]], sums: &mut Vec<[f64; D]>, force: &mut [f64]) {
        sums.resize(self.sites.len(), [0.0; D]);
        sums.par_iter_mut()
            .with_min_len(CHUNK / 8)
            .enumerate()
            .for_each(|(s, sum)| {
                *sum = [0.0; D];
                for &(part, w) in &self.ends[self.offsets[s]..self.offsets[s + 1]] {
                    for (sum, pull) in sum.iter_mut().zip(&pulls[part as usize]) {
                        *sum += w * pull;
                    }
                }
            });
        for (&site, sum) in self.sites.iter().zip(&*sums) {
            for (f, sum) in force[site as usize * D..][..D].iter_mut().zip(sum) {
                *f += sum;
            }
        }
    }

    /// Adds the product with the tangent at rest.
    pub(in crate::coupling) fn add_tangent(&self, x: &[f64], y: &mut [f64]) {
        let pulls: Vec<[f64; D]> = self
            .parts
            .par_iter()
            .with_min_len(CHUNK)
            .enumerate()
            .map(|(p, part)| {
                if !self.stands(part.bond) {
                    return [0.0; D];
                }
                let d: Vector<D> = self.difference.displacement(p, x);
                let f = part.stiffness * Vector::from(part.xi).dot(&d);
                part.xi.map(|x| f * x)
            })
            .collect();
        self.scatter(&pulls, &mut Vec::new(), y);
    }

    /// Adds per unknown a bound of the sum of the sizes of its row.
    pub(in crate::coupling) fn add_row_sums(&self, sums: &mut [f64]) {
        for (s, &site) in self.sites.iter().enumerate() {
            for &(p, w) in &self.ends[self.offsets[s]..self.offsets[s + 1]] {
                let part = &self.parts[p as usize];
                if !self.stands(part.bond) {
                    continue;
                }
                let all: f64 = self.difference.row(p as usize).map(|(_, w)| w.abs()).sum();
                let size: f64 = part.xi.iter().map(|x| x.abs()).sum();
                for (sum, x) in sums[site as usize * D..].iter_mut().zip(&part.xi) {
                    *sum += part.stiffness * w.abs() * all * x.abs() * size;
                }
            }
        }
    }

    /// Adds the row of a site in the tangent at rest.
    pub(in crate::coupling) fn add_row(&self, site: usize, row: &mut Row<D>) {
        let Ok(s) = self.sites.binary_search(&(site as u32)) else {
            return;
        };
        for &(p, w) in &self.ends[self.offsets[s]..self.offsets[s + 1]] {
            let part = &self.parts[p as usize];
            if self.stands(part.bond) {
                let xi = Vector::from(part.xi);
                let block: Tensor<D> = xi * xi.transpose() * (part.stiffness * w);
                row.add(&self.difference, p as usize, &block);
            }
        }
    }

    /// Whether a bond of the seam ends at a site.
    pub(in crate::coupling) fn touches(&self, site: usize) -> bool {
        self.sites.binary_search(&(site as u32)).is_ok()
    }

    /// Energy of the parts that stand \[J\].
    pub(in crate::coupling) fn energy(&self, u: &[f64]) -> f64 {
        let of = |p: usize| {
            let part = &self.parts[p];
            if !self.stands(part.bond) {
                return 0.0;
            }
            let d: Vector<D> = self.difference.displacement(p, u) / part.length;
            let (t, r2) = match self.kinematics {
                Kinematics::Exact => {
                    let s = stretched::<D, true>(&part.xi, &[0.0; D], d.as_slice());
                    (extension::<true>(s.t()), s.length)
                }
                Kinematics::Linear => {
                    let s = stretched::<D, false>(&part.xi, &[0.0; D], d.as_slice());
                    (extension::<false>(s.t()), s.length)
                }
            };
            0.5 * part.stiffness * (part.length * t * r2).powi(2)
        };
        let parts: Vec<f64> = (0..self.parts.len())
            .into_par_iter()
            .with_min_len(CHUNK)
            .map(of)
            .collect();
        parts.iter().sum()
    }

    /// What the broken parts took, each `s w` at the critical stretch \[J\].
    pub(in crate::coupling) fn dissipated(&self) -> f64 {
        let critical = self.breaks.as_ref().map_or(0.0, |b| b.critical);
        let broken = self.parts.iter().filter(|p| !self.stands(p.bond));
        broken
            .map(|p| {
                let r2 = Vector::from(p.xi).norm_squared();
                0.5 * p.stiffness * (p.length * critical * r2).powi(2)
            })
            .sum()
    }

    /// Adds to the damage of points, so far that of the bonds that the body's pass knows of, what they lost here; `of_bonds` is the volume that a point's whole bonds reach.
    pub(in crate::coupling) fn add_damage(
        &self,
        damage: &mut [f64],
        of_bonds: impl Fn(u32) -> f64,
    ) {
        for of in self.lost.chunk_by(|a, b| a.0 == b.0) {
            let point = of[0].0;
            let sum = |all: bool| -> f64 {
                let counted = of.iter().filter(|l| all || !self.stands(l.1));
                counted.map(|l| l.2).sum()
            };
            let (whole, lost) = (of_bonds(point), sum(false));
            let damage = &mut damage[point as usize];
            if lost > 0.0 || *damage > 0.0 {
                *damage = (*damage * whole + lost) / (whole + sum(true));
            }
        }
    }

    /// A point next to a face up to which damage has come: a bond that ends on the face within a spacing of it, or one along the face between points next to it, is broken.
    pub(in crate::coupling) fn damaged_at_face(&self, pass: &dyn BondPass<D>) -> Option<u32> {
        let ends = self.next_to_face.iter();
        let mut ends = ends.filter(|(bond, _)| !self.stands(*bond));
        if let Some(&(_, point)) = ends.next() {
            return Some(point);
        }
        let mut along = self.along_face.iter();
        along
            .find(|[i, j]| pass.is_damaged(*i as usize) && !pass.bonded(*i as usize, *j as usize))
            .map(|[i, _]| *i)
    }

    /// Bits of the bonds that stand.
    pub(in crate::coupling) fn damage_state(&self) -> Vec<u64> {
        pack(&self.intact, self.bonds.len() as u64)
    }

    /// Puts back what [`SeamBonds::damage_state`] gave; false if it belongs to another seam.
    pub(in crate::coupling) fn restore_damage(&mut self, state: &[u64]) -> bool {
        unpack(state, self.bonds.len() as u64, &mut self.intact)
    }

    /// Bytes held.
    pub(in crate::coupling) fn memory_bytes(&self) -> usize {
        self.parts.len() * (size_of::<Part<D>>() + D * 8 + 1)
            + self.difference.weight_count() * 28
            + self.families.neighbours.len() * 4
    }
}
