//! Contact between the surfaces of bodies, and of peridynamic points with them.
//!
//! | file | content |
//! |---|---|
//! | `surface.rs` | facets, and the places that are kept out of them |
//! | `of_model.rs` | those of a model: facets of its elements, quadrature points on them, peridynamic points |
//! | `crack_faces.rs` | the faces of its cracks between points |
//! | `crack_bonds.rs` | bonds across cracks that are pressed shut |
//! | `closest.rs` | the nearest place of a facet |
//! | `search.rs` | facets within reach of each place, by cells |
//! | `touch.rs` | a place that touches: its depth, its direction, its force |
//! | `friction.rs` | Coulomb friction of places that touch |
//! | `term.rs` | contact as a force term |
//!
//! A place at the depth `g` \[m\] inside a body is pushed along the shortest way out, with the unit normal `n`, and the facet there the other way:
//!
//! ```text
//! f = k g n ,      k = factor · min(C₁₁/h, C₁₁′/h′) A ,
//! ```
//!
//! with the longitudinal modulus `C₁₁` and the size `h` of the cells on both sides, and the area `A` that the place stands for. The pair stores `½ k g²`. Places are the quadrature points of facets, so that a uniform pressure
//! arrives as its consistent nodal forces whether or not the meshes match, and peridynamic points, whose cells extend beyond them by their clearance. Of two surfaces of elements each keeps out the other, with half the stiffness.
//! Depths and normals are those of the nearest place of all facets that face the place, which makes the force the gradient of the energy but at the rims of faces.
//!
//! **Stable step.** A pair adds `k g gᵀ` with weights of sites that sum to 2 in absolute value where displacements are interpolated, so that `λ ≤ max_i 2 Σ k |w_i| / m_i`. Places that press on a facet
//! at a time have at most 1.25 of its area, were they to lie as on their own. Contact that opens and closes within a step does not keep its energy: in motion the bound counts several times.

mod closest;
mod crack_bonds;
mod crack_faces;
mod friction;
mod of_model;
mod search;
mod surface;
mod term;
mod touch;

#[cfg(test)]
mod tests;

pub use crack_bonds::CrackBonds;
pub(crate) use crack_faces::has_cracks;

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};

use self::friction::Grip;
use self::search::Near;
use self::surface::{NONE, Surface};
use self::touch::Touch;
use crate::assembly::Transfer;
use crate::parallel;
use crate::system::SpringRows;
use crate::tensor::{Tensor, Vector};

/// Distance beyond their reach up to which facets are listed, over the size of the smallest.
const SKIN: f64 = 0.5;

/// Part of the skin by which corners may move before facets are listed anew: two surfaces move, and places between corners by up to twice as much.
const MOVED: f64 = 0.25;

/// Law of contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLaw {
    /// Penalty stiffness over that of the softer of two bodies across a cell.
    pub stiffness_factor: f64,
    /// Coefficient of friction.
    pub friction: f64,
    /// Depth up to which places are pushed out of another body, over the size of cells.
    pub deepest: f64,
    /// Distance up to which surfaces that are apart or overlap at time zero count as touching \[m\].
    pub adjust: f64,
    /// Factor of contact in the bounds of eigenvalues and row sums.
    pub counted: f64,
}

/// Contact of the surfaces of a model.
#[derive(Debug)]
pub struct SurfaceContact<const D: usize> {
    surface: Surface<D>,
    law: ContactLaw,
    /// Skin of the lists \[m\].
    skin: f64,
    /// Size of the smallest cell at a surface \[m\].
    smallest: f64,
    /// Bound of `Σ k |w_i|` at each site \[N/m\].
    bounds: Vec<f64>,
    work: Mutex<Work<D>>,
    grip: RwLock<Grip<D>>,
}

/// Memory of contact between forces, on which no force depends.
#[derive(Debug, Default)]
struct Work<const D: usize> {
    /// Corners of facets and points where they are.
    corners: Vec<Vector<D>>,
    points: Vec<Vector<D>>,
    /// The same where facets were listed; empty before the first time.
    listed: (Vec<Vector<D>>, Vec<Vector<D>>),
    near: Near,
    /// One for each place on the lists.
    touches: Vec<Option<Touch<D>>>,
    /// Forces on corners.
    on_corners: Vec<Vector<D>>,
}

/// A place of a surface that touches another.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactPlace<const D: usize> {
    /// Position at rest \[m\].
    pub rest: Vector<D>,
    /// Depth inside the other body \[m\].
    pub depth: f64,
    /// Size of the cells there \[m\].
    pub size: f64,
}

impl<const D: usize> SurfaceContact<D> {
    fn of_surface(surface: Surface<D>, law: ContactLaw, sites: usize) -> Self {
        let sizes = surface.facets.iter().map(|f| f.size);
        let smallest = sizes.fold(f64::INFINITY, f64::min);
        let mut contact = Self {
            skin: SKIN * smallest,
            smallest,
            bounds: Vec::new(),
            work: Mutex::default(),
            grip: RwLock::new(Grip::new(law.friction)),
            surface,
            law,
        };
        contact.bounds = contact.bounds_of_sites(sites);
        contact
    }

    /// Bound of `Σ k |w_i|` over the pairs that may touch at a time: as a place, and as a part of the facets that others press on.
    fn bounds_of_sites(&self, sites: usize) -> Vec<f64> {
        // places press on a facet as densely as they lie on their own, but for where they happen to lie
        const CROWDED: f64 = 1.25;
        let surface = &self.surface;
        let mut bounds = vec![0.0; sites];
        let mut has_points = false;
        // the weights of a place and of a corner in absolute value: 1 where displacements are interpolated
        let size = |rows: &Transfer, k: usize| rows.row(k).map(|(_, w)| w.abs()).sum::<f64>();
        let of_corners = (0..surface.corners.len()).map(|c| size(&surface.corner_rows, c));
        let of_corners = of_corners.fold(1.0, f64::max);
        let of_places = (0..surface.places.len()).map(|p| size(&surface.place_rows, p));
        let of_places = of_places.fold(1.0, f64::max);
        for (p, place) in surface.places.iter().enumerate() {
            let half = if place.facet == NONE { 1.0 } else { 0.5 };
            let half = half * 0.5 * (size(&surface.place_rows, p) + of_corners);
            has_points |= place.facet == NONE;
            for (site, w) in surface.place_rows.row(p) {
                bounds[site as usize] +=
                    half * self.law.stiffness_factor * place.stiffness * place.area * w.abs();
            }
        }
        let half = if has_points { 1.0 } else { 0.5 };
        let half = half * 0.5 * (of_places + of_corners);
        for (f, facet) in surface.facets.iter().enumerate() {
            let corners = surface.corners_of(f as u32, &surface.corners);
            let area = surface::area(&corners);
            let each =
                CROWDED * half * self.law.stiffness_factor * facet.stiffness * area / D as f64;
            for &c in &facet.corners {
                for (site, w) in surface.corner_rows.row(c as usize) {
                    bounds[site as usize] += each * w.abs();
                }
            }
        }
        bounds
    }

    fn work(&self) -> MutexGuard<'_, Work<D>> {
        self.work.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn grip(&self) -> RwLockReadGuard<'_, Grip<D>> {
        self.grip.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Size of the smallest cell at a surface \[m\].
    pub fn smallest(&self) -> f64 {
        self.smallest
    }

    /// Number of facets that places are kept out of.
    pub fn facets(&self) -> usize {
        self.surface.facets.len()
    }

    /// Number of them at the surface of elements, and on the faces of cracks.
    pub fn facets_of(&self) -> [usize; 2] {
        let elements = self.surface.cracks_from as usize;
        [elements, self.facets() - elements]
    }

    /// The law.
    pub fn law(&self) -> ContactLaw {
        self.law
    }

    /// Returns true if there is friction.
    fn is_rough(&self) -> bool {
        self.law.friction > 0.0
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        let surface = &self.surface;
        let entries = |rows: &Transfer| rows.matrix().nnz() * 12;
        surface.facets.len() * size_of::<surface::Facet<D>>()
            + surface.places.len() * (size_of::<surface::Place>() + D * 8)
            + surface.corners.len() * D * 4 * 8
            + entries(&surface.corner_rows)
            + entries(&surface.place_rows)
    }

    /// Position of a place at a displacement.
    fn place_at(&self, place: u32, u: &[f64]) -> Vector<D> {
        let row = self.surface.place_rows.displacement::<D>(place as usize, u);
        self.surface.rest[place as usize] + row
    }

    /// Finds the places that touch at a displacement.
    fn update(&self, work: &mut Work<D>, u: &[f64]) {
        let surface = &self.surface;
        let first_point = surface.places.partition_point(|p| p.facet != NONE);
        work.corners.resize(surface.corners.len(), Vector::zeros());
        parallel::for_each_mut(&mut work.corners, 1024, |c, x| {
            *x = surface.corners[c] + surface.corner_rows.displacement::<D>(c, u);
        });
        work.points
            .resize(surface.places.len() - first_point, Vector::zeros());
        parallel::for_each_mut(&mut work.points, 1024, |p, x| {
            let place = first_point + p;
            *x = surface.rest[place] + surface.place_rows.displacement::<D>(place, u);
        });
        let moved = (MOVED * self.skin).powi(2);
        let stays = |now: &[Vector<D>], before: &[Vector<D>]| {
            now.len() == before.len()
                && parallel::all(now.len(), 1024, |k| {
                    (now[k] - before[k]).norm_squared() <= moved
                })
        };
        if !stays(&work.corners, &work.listed.0) || !stays(&work.points, &work.listed.1) {
            let at = |place: u32| self.place_at(place, u);
            work.near = search::list(surface, &work.corners, &work.points, &at, self.skin);
            work.listed.0.clone_from(&work.corners);
            work.listed.1.clone_from(&work.points);
        }
        work.touches.resize(work.near.places.len(), None);
        let (near, corners, grip) = (&work.near, &work.corners, &*self.grip());
        parallel::for_each_mut(&mut work.touches, 64, |k, touch| {
            let place = near.places[k];
            let x = self.place_at(place, u);
            let found = touch::touch(
                surface,
                self.law.stiffness_factor,
                corners,
                (place, x),
                near.of(k),
            );
            *touch = found.map(|touch| Touch {
                friction: grip.force((place, &x), &touch, surface, corners),
                ..touch
            });
        });
    }

    /// Adds the contact forces to an internal force (minus the force that acts, as everywhere).
    pub fn add_force(&self, u: &[f64], force: &mut [f64]) {
        if self.surface.facets.is_empty() {
            return;
        }
        // taken out, for a thread that waits for a loop may be asked for another force meanwhile
        let mut work = std::mem::take(&mut *self.work());
        self.update(&mut work, u);
        let Work {
            near,
            touches,
            on_corners,
            ..
        } = &mut work;
        if touches.iter().any(Option::is_some) {
            on_corners.clear();
            on_corners.resize(self.surface.corners.len(), Vector::zeros());
            for (place, touch) in near.places.iter().zip(touches.iter()) {
                let Some(touch) = touch else { continue };
                let f = touch.force();
                for (site, w) in self.surface.place_rows.row(*place as usize) {
                    let to = &mut force[site as usize * D..][..D];
                    (0..D).for_each(|a| to[a] -= w * f[a]);
                }
                let corners = &self.surface.facets[touch.facet as usize].corners;
                for (c, w) in corners.iter().zip(touch.weights) {
                    on_corners[*c as usize] += f * w;
                }
            }
            for (c, f) in on_corners.iter().enumerate() {
                if f.iter().any(|f| *f != 0.0) {
                    for (site, w) in self.surface.corner_rows.row(c) {
                        let to = &mut force[site as usize * D..][..D];
                        (0..D).for_each(|a| to[a] += w * f[a]);
                    }
                }
            }
        }
        *self.work() = work;
    }

    /// Tangent of the places that touch at a displacement: of each pair `k n nᵀ`, and `k (1 − n nᵀ)` where friction grips. None where nothing touches.
    fn tangent(&self, u: &[f64]) -> Option<SpringRows> {
        let mut blocks: BTreeMap<(u32, u32), Vec<f64>> = BTreeMap::new();
        self.sum(u, |place, touch| {
            let rows = self.surface.place_rows.row(place as usize);
            let mut pair: Vec<(u32, f64)> = rows.collect();
            let corners = &self.surface.facets[touch.facet as usize].corners;
            for (&c, w) in corners.iter().zip(touch.weights) {
                let row = self.surface.corner_rows.row(c as usize);
                pair.extend(row.map(|(site, v)| (site, -v * w)));
            }
            let along = if touch.grips(self.law.friction) {
                1.0
            } else {
                0.0
            };
            let stiffness = Tensor::<D>::from_fn(|a, b| {
                let n = touch.normal[a] * touch.normal[b];
                let one = if a == b { 1.0 } else { 0.0 };
                touch.stiffness * (n + along * (one - n))
            });
            for &(i, v) in &pair {
                for &(j, w) in &pair {
                    let sum = blocks.entry((i, j)).or_insert_with(|| vec![0.0; D * D]);
                    for a in 0..D {
                        for b in 0..D {
                            sum[a * D + b] += v * w * stiffness[(a, b)];
                        }
                    }
                }
            }
            0.0
        });
        (!blocks.is_empty()).then(|| SpringRows::from_blocks(D, &blocks))
    }

    /// The sum over the places that touch at a displacement of a number of each.
    fn sum(&self, u: &[f64], mut of: impl FnMut(u32, &Touch<D>) -> f64) -> f64 {
        if self.surface.facets.is_empty() {
            return 0.0;
        }
        let mut work = std::mem::take(&mut *self.work());
        self.update(&mut work, u);
        let touches = work.near.places.iter().zip(&work.touches);
        let touches = touches.filter_map(|(place, touch)| Some((*place, touch.as_ref()?)));
        let sum: f64 = touches.map(|(place, touch)| of(place, touch)).sum();
        *self.work() = work;
        // no number −0
        sum + 0.0
    }

    /// Energy stored in the contact \[J\].
    pub fn energy(&self, u: &[f64]) -> f64 {
        self.sum(u, |_, touch| touch.energy())
    }

    /// Work of friction up to the end of the last step \[J\], if there is friction.
    pub fn work_of_friction(&self) -> Option<f64> {
        self.is_rough().then(|| self.grip().work)
    }

    /// The largest distance by which the faces of cracks have moved apart, or along each other \[m\].
    pub fn largest_jump(&self, u: &[f64]) -> f64 {
        let surface = &self.surface;
        let cracks = &surface.facets[surface.cracks_from as usize..];
        let first = |facet: &surface::Facet<D>| facet.corners.iter().min().copied().unwrap_or(0);
        let at = |c: u32| surface.corner_rows.displacement::<D>(c as usize, u);
        // the two faces of a piece follow each other, with their corners in one order
        let jumps = cracks.chunks_exact(2).flat_map(|pair| {
            let (above, below) = (first(&pair[0]), first(&pair[1]));
            (0..D as u32).map(move |k| (at(above + k) - at(below + k)).norm())
        });
        jumps.fold(0.0, f64::max)
    }

    /// Number of places that touch.
    pub fn touching(&self, u: &[f64]) -> usize {
        self.sum(u, |_, _| 1.0) as usize
    }

    /// The place that lies deepest inside another body, over the size of its cell.
    pub fn deepest(&self, u: &[f64]) -> Option<ContactPlace<D>> {
        let mut deepest: Option<(u32, f64, f64)> = None;
        self.sum(u, |place, touch| {
            let size = self.surface.places[place as usize].size;
            let is_deeper = |(_, depth, other): (u32, f64, f64)| touch.depth / size > depth / other;
            if deepest.is_none_or(is_deeper) {
                deepest = Some((place, touch.depth, size));
            }
            0.0
        });
        deepest.map(|(place, depth, size)| ContactPlace {
            rest: self.surface.rest[place as usize],
            depth,
            size,
        })
    }
}
