//! Rigid impactors, in contact with the sites of both models.
//!
//! Contact is frictionless, by a penalty. A site at the depth `g` \[m\] inside an impactor is pushed along the shortest way out, with the unit vector `n`, by the force
//!
//! ```text
//! f = k g n ,      k = factor · C₁₁ V / h² ,
//! ```
//!
//! and the impactor with `−f`; the pair stores `½ k g²`. `C₁₁` is the longitudinal modulus of the material, `V` the part of the body that the site stands for and `h` its size: the edge of a point's
//! whole cell, or the shortest edge of the cells around a node. On an even mesh `k` is proportional to the area that a site has of a surface, so that a flat face bears a uniform pressure. All sites count, wherever they lie at
//! rest: debris from inside the body is pushed as well. The body reaches beyond its points: those of the first layer to the surface of the mesh at rest, all others by `h/2`. That is added to the depth,
//! so that contact begins at the surface wherever the lattice lies.
//!
//! An impactor is one more site of the system that moves, with the mass of the impactor: one set of steps, energies, supports and checkpoints serves body and impactors
//! ([`crate::system::WithTerms`]).
//!
//! **Stable step.** `k/m = factor (c/h)²` with the speed `c = √(C₁₁/ρ)` of longitudinal waves. Of sites that touch a free impactor of mass `M`, contact adds to the eigenvalues at most
//! `max k/m + Σ k / M`. The sum is bounded by the largest area that can touch: `factor · max(C₁₁/h)` times [`ImpactorShape::largest_area`]. A site between two impactors feels both: the two largest bounds are added.
//! Contact that opens and closes within a step does not keep its energy, however stable the step: a bar of points that strikes at `(ω Δt)² = 1.3` gains several times its energy, at 0.5 a thousandth. In motion
//! the bound therefore counts [`RESOLVED`] times, so that `(ω Δt)² ≤ 1`. The sum over the sites that touch counts as often once more: a light impactor carries all of its energy through one contact of a few steps.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::tensor::{Tensor4, Vector};
use crate::{
    model::{Model, clearance},
    parallel,
};

mod shape;
mod term;

pub use shape::ImpactorShape;

/// Sites per task; a constant, so that no result depends on the number of threads.
const CHUNK: usize = 1024;

/// Factor of contact in the bounds of a motion: at least six steps then pass in a period of a site on its penalty spring.
pub const RESOLVED: f64 = 4.0;

/// Round-off of the depth of a site, over the places that it is a difference of.
const ROUND_OFF: f64 = 4.0 * f64::EPSILON;

/// The mass of an impactor whose motion is prescribed \[kg\]: it takes a number that can be divided by, and has no energy of its own.
const MASSLESS: f64 = 1e-150;

/// A rigid impactor.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidImpactor<const D: usize> {
    /// Its shape, where it is at time zero.
    pub shape: ImpactorShape<D>,
    /// Its mass \[kg\] (per thickness in 2D, per section in 1D); none if its motion is prescribed.
    pub mass: Option<f64>,
    /// Factor of its penalty stiffness.
    pub stiffness_factor: f64,
}

/// Contact of the sites of a model with rigid impactors.
#[derive(Debug)]
pub struct Impact<const D: usize> {
    impactors: Vec<RigidImpactor<D>>,
    /// Positions of the sites at rest.
    position: Vec<Vector<D>>,
    /// Distance by which the body extends beyond each site \[m\].
    clearance: Vec<f64>,
    /// Sizes of the sites \[m\].
    size: Vec<f64>,
    /// `C₁₁ V / h²` of each site \[N/m\].
    stiffness: Vec<f64>,
    /// The largest `C₁₁/h` \[N/m^D\].
    stiffest_face: f64,
    /// Corners of the body at rest.
    bounds: (Vector<D>, Vector<D>),
    /// The size of the smallest site \[m\].
    smallest: f64,
    /// Factor of contact in the bounds of eigenvalues and row sums.
    counted: f64,
    /// Memory for the forces on impactors.
    pushes: Mutex<Vec<f64>>,
}

/// The sites that touch an impactor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactPatch {
    /// Number of these sites.
    pub sites: u64,
    /// Number of sites side by side across the contact.
    pub across: f64,
}

impl<const D: usize> Impact<D> {
    /// Contact of the sites of `model`, which counts `counted` times in the bounds of eigenvalues and row sums: [`RESOLVED`] in motion, 1 in load steps.
    pub fn new(model: &Model<D>, impactors: Vec<RigidImpactor<D>>, counted: f64) -> Self {
        let modulus =
            |material: u16| model.elastic.tensors[usize::from(material)].longitudinal_modulus();
        let by_volume = model
            .tributary()
            .masses(model.peridynamic_material(), modulus);
        let sizes = clearance::sizes(model);
        let stiffness = by_volume.iter().zip(&sizes).map(|(cv, h)| cv / (h * h));
        let largest = model
            .elastic
            .tensors
            .iter()
            .map(Tensor4::longitudinal_modulus)
            .fold(0.0, f64::max);
        let smallest = sizes.iter().copied().fold(f64::INFINITY, f64::min);
        Self {
            impactors,
            position: model.sites.iter().map(|s| s.position).collect(),
            clearance: clearance::clearances(model, &sizes),
            stiffness: stiffness.collect(),
            stiffest_face: largest / smallest,
            bounds: model.mesh.bounds(),
            smallest,
            size: sizes,
            counted,
            pushes: Mutex::default(),
        }
    }

    /// The impactors.
    pub fn impactors(&self) -> &[RigidImpactor<D>] {
        &self.impactors
    }

    /// The number of sites of the body; those of the impactors follow.
    pub fn sites(&self) -> usize {
        self.position.len()
    }

    /// The largest penalty stiffness of a site and an impactor \[N/m\].
    pub fn stiffest(&self) -> f64 {
        let factors = self.impactors.iter().map(|i| i.stiffness_factor);
        let of_sites = self.stiffness.iter().copied().fold(0.0, f64::max);
        of_sites * factors.fold(0.0, f64::max)
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.position.len() * (D + 3) * size_of::<f64>()
    }

    /// Masses of the impactors, as sites that follow those of the body \[kg\].
    fn masses(&self) -> impl Iterator<Item = f64> + '_ {
        self.impactors.iter().map(|i| i.mass.unwrap_or(MASSLESS))
    }

    /// Hands each pair that touches in a chunk of sites to `f`: the site's number in the chunk, the impactor, the stiffness of the pair, the depth and the way out.
    #[inline]
    fn each(
        &self,
        chunk: usize,
        u: &[f64],
        moved: &[f64],
        mut f: impl FnMut(usize, usize, f64, f64, Vector<D>),
    ) {
        let first = chunk * CHUNK;
        for (i, u) in u.chunks_exact(D).enumerate() {
            let x = self.position[first + i] + Vector::from_column_slice(u);
            let clearance = self.clearance[first + i];
            for (number, impactor) in self.impactors.iter().enumerate() {
                let from = Vector::from_column_slice(&moved[number * D..][..D]);
                // impactors translate: the site is moved back instead
                if let Some((depth, out)) = impactor.shape.penetration(&(x - from), clearance) {
                    let k = impactor.stiffness_factor * self.stiffness[first + i];
                    f(i, number, k, depth, out);
                }
            }
        }
    }

    /// Adds the contact forces to an internal force (minus the force that acts, as everywhere).
    ///
    /// Shapes: `u` \[m\] and `force` \[N\] have `D` numbers per site, those of the impactors last.
    pub fn add_force(&self, u: &[f64], force: &mut [f64]) {
        let dofs = self.sites() * D;
        let (u, moved) = u.split_at(dofs);
        let (force, on_impactors) = force.split_at_mut(dofs);
        // the force of each chunk of sites on each impactor, in memory that is kept
        let each = self.impactors.len() * D;
        // taken out, for a thread that waits for the loop may be asked for another force meanwhile
        let kept = || self.pushes.lock().unwrap_or_else(PoisonError::into_inner);
        let mut pushes = std::mem::take(&mut *kept());
        pushes.clear();
        pushes.resize(each * dofs.div_ceil(CHUNK * D), 0.0);
        let both = force.par_chunks_mut(CHUNK * D).zip(u.par_chunks(CHUNK * D));
        let all = both.zip(pushes.par_chunks_mut(each)).enumerate();
        parallel::for_each(all, |(chunk, ((force, u), pushes))| {
            self.each(chunk, u, moved, |i, impactor, k, depth, out| {
                let push = out * (k * depth);
                for a in 0..D {
                    force[i * D + a] -= push[a];
                    pushes[impactor * D + a] += push[a];
                }
            });
        });
        for push in pushes.chunks_exact(each) {
            let both = on_impactors.iter_mut().zip(push);
            both.for_each(|(f, p)| *f += p);
        }
        *kept() = pushes;
    }

    /// Norm of the forces \[N\] that rounding of places leaves at sites that touch: a depth is a difference of places. A site that lies on a surface to round-off touches by as much.
    fn round_off(&self, u: &[f64]) -> f64 {
        let (u, moved) = u.split_at(self.sites() * D);
        let parts: Vec<f64> = parallel::map_chunks(u, CHUNK * D, |chunk, own| {
            let mut squares = 0.0;
            self.each(chunk, own, moved, |i, number, k, _, _| {
                let place = self.position[chunk * CHUNK + i].norm();
                let from = Vector::<D>::from_column_slice(&moved[number * D..][..D]).norm();
                let size = place + from + self.impactors[number].shape.extent();
                squares += (k * ROUND_OFF * size).powi(2);
            });
            squares
        });
        parts.iter().sum::<f64>().sqrt()
    }

    /// Energy stored in the contact, `½ k g²` of each pair that touches \[J\].
    pub fn energy(&self, u: &[f64]) -> f64 {
        let (u, moved) = u.split_at(self.sites() * D);
        let parts: Vec<f64> = parallel::map_chunks(u, CHUNK * D, |chunk, u| {
            let mut sum = 0.0;
            self.each(chunk, u, moved, |_, _, k, depth, _| {
                sum += 0.5 * k * depth * depth;
            });
            sum
        });
        parts.iter().sum()
    }

    /// The sites that touch an impactor: how many, and how many across the contact, which is its width over their mean size and one more.
    ///
    /// The width is taken across the way out and, of a cylinder, across its axis.
    pub fn contact(&self, u: &[f64], impactor: usize) -> ContactPatch {
        let (u, moved) = u.split_at(self.sites() * D);
        let touched: Vec<Vec<(usize, Vector<D>)>> =
            parallel::map_chunks(u, CHUNK * D, |chunk, u| {
                let mut found = Vec::new();
                self.each(chunk, u, moved, |i, k, _, _, out| {
                    if k == impactor {
                        found.push((chunk * CHUNK + i, out));
                    }
                });
                found
            });
        let touched = touched.concat();
        if touched.is_empty() {
            return ContactPatch::default();
        }
        let count = touched.len() as f64;
        let out: Vector<D> = touched.iter().map(|(_, out)| out).sum();
        let out = out.try_normalize(0.0).unwrap_or_else(Vector::zeros);
        let axis = self.impactors[impactor].shape.axis();
        let along_face = |site: usize| {
            let x = self.position[site] + Vector::from_column_slice(&u[site * D..][..D]);
            let across = x - out * out.dot(&x);
            match axis {
                Some(axis) => across - axis * axis.dot(&across),
                None => across,
            }
        };
        let middle: Vector<D> = touched
            .iter()
            .map(|&(s, _)| along_face(s))
            .sum::<Vector<D>>()
            / count;
        let half = touched
            .iter()
            .map(|&(s, _)| (along_face(s) - middle).norm())
            .fold(0.0, f64::max);
        let size = touched.iter().map(|&(s, _)| self.size[s]).sum::<f64>() / count;
        ContactPatch {
            sites: touched.len() as u64,
            across: 1.0 + 2.0 * half / size,
        }
    }

    /// The site that lies deepest inside an impactor: its number, that of the impactor and the depth \[m\].
    pub fn deepest(&self, u: &[f64]) -> Option<(usize, usize, f64)> {
        let (u, moved) = u.split_at(self.sites() * D);
        let mut deepest: Option<(usize, usize, f64)> = None;
        for (chunk, u) in u.chunks(CHUNK * D).enumerate() {
            self.each(chunk, u, moved, |i, impactor, _, depth, _| {
                if deepest.is_none_or(|(.., most)| depth > most) {
                    deepest = Some((chunk * CHUNK + i, impactor, depth));
                }
            });
        }
        deepest
    }

    /// Upper bound of `Σ k` over the sites that touch an impactor at a time \[N/m\].
    fn touching(&self, impactor: &RigidImpactor<D>) -> f64 {
        let all: f64 = self.stiffness.iter().sum();
        let area = impactor.shape.largest_area(&self.bounds.0, &self.bounds.1);
        impactor.stiffness_factor * (area * self.stiffest_face).min(all)
    }

    /// Upper bound of what contact adds to the eigenvalues of `M⁻¹ K` \[1/s²\]; `mass` is that of each site of the body.
    fn frequency_bound(&self, mass: &[f64]) -> f64 {
        let of_sites = self.stiffness.iter().zip(mass).map(|(k, m)| k / m);
        let of_sites = of_sites.fold(0.0, f64::max);
        let bound = |i: &RigidImpactor<D>| {
            let of_impactor = i.mass.map_or(0.0, |mass| self.touching(i) / mass);
            i.stiffness_factor * of_sites + self.counted * of_impactor
        };
        let mut bounds: Vec<f64> = self.impactors.iter().map(bound).collect();
        bounds.sort_by(f64::total_cmp);
        self.counted * bounds.iter().rev().take(2).sum::<f64>()
    }

    /// Adds what contact may add to the row sums of the body's sites, and appends those of the impactors; zero of one that is prescribed.
    fn extend_row_sums(&self, sums: &mut Vec<f64>) {
        // Σ_b |n_a n_b| ≤ √D, once for the site and once for the impactor
        let spread = self.counted * 2.0 * (D as f64).sqrt();
        let mut factors: Vec<f64> = self.impactors.iter().map(|i| i.stiffness_factor).collect();
        factors.sort_by(f64::total_cmp);
        let factor: f64 = factors.iter().rev().take(2).sum();
        for (sums, k) in sums.chunks_exact_mut(D).zip(&self.stiffness) {
            sums.iter_mut().for_each(|s| *s += spread * factor * k);
        }
        for impactor in &self.impactors {
            let own = impactor.mass.map_or(0.0, |_| self.touching(impactor));
            sums.extend([spread * self.counted * own; D]);
        }
    }
}

#[cfg(test)]
mod tests;
