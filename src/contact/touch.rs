//! A place that touches a facet.

use super::closest;
use super::surface::{FACING, NONE, Surface, area};
use crate::tensor::Vector;

/// Cosine between the way to the nearest place and the normals there, below which a place beneath the rim of a face lies beside the body.
const BENEATH: f64 = 0.9;

/// Distances over the size of a cell by which facets are as near, and within which a place lies on a facet.
const ALIKE: f64 = 1e-9;

/// A place that touches a facet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touch<const D: usize> {
    pub facet: u32,
    /// Barycentric coordinates of the place of the facet that it touches.
    pub weights: [f64; D],
    /// The way out of the facet's body.
    pub normal: Vector<D>,
    /// Depth \[m\].
    pub depth: f64,
    /// Stiffness of the pair \[N/m\].
    pub stiffness: f64,
    /// Force of friction on the place \[N\].
    pub friction: Vector<D>,
}

impl<const D: usize> Touch<D> {
    /// Force on the place \[N\]; that on the facet is its opposite.
    pub fn force(&self) -> Vector<D> {
        self.normal * (self.stiffness * self.depth) + self.friction
    }

    /// Returns true if friction with this coefficient holds the place where it is.
    pub fn grips(&self, friction: f64) -> bool {
        let most = friction * self.stiffness * self.depth;
        friction > 0.0 && self.friction.norm() < most * (1.0 - 1e-9)
    }

    /// Energy that the pair stores \[J\]: of the depth, and of the grip before it slips.
    pub fn energy(&self) -> f64 {
        0.5 * self.stiffness * self.depth * self.depth
            + 0.5 * self.friction.norm_squared() / self.stiffness
    }
}

/// The distance of a place at `x` from the nearest of some facets that face it, positive outside of their body, with the facet, the coordinates there and the way out.
fn nearest<const D: usize>(
    surface: &Surface<D>,
    corners: &[Vector<D>],
    (place, x): (u32, Vector<D>),
    facets: &[u32],
) -> Option<(f64, u32, [f64; D], Vector<D>)> {
    let own = &surface.places[place as usize];
    let outward = (own.facet != NONE).then(|| surface.normal(own.facet, corners));
    let tie = ALIKE * own.size;
    let mut found: Option<(f64, u32, [f64; D], Vector<D>)> = None;
    // the normals of facets that meet where the place is nearest
    let mut normals = Vector::zeros();
    for &facet in facets {
        let normal = surface.normal(facet, corners);
        if outward.is_some_and(|own| own.dot(&normal) > FACING) {
            continue;
        }
        let at = surface.corners_of(facet, corners);
        let weights = closest::nearest(&at, &x);
        let nearest: Vector<D> = at.iter().zip(weights).map(|(c, w)| c * w).sum();
        let way = x - nearest;
        let distance = way.norm();
        match &found {
            Some((least, ..)) if distance > least + tie => continue,
            Some((least, ..)) if distance >= least - tie => {
                normals += normal;
                continue;
            }
            _ => normals = normal,
        }
        found = Some((distance, facet, weights, way));
    }
    let (distance, facet, weights, way) = found?;
    let side = way.dot(&normals);
    let is_beside = -side < BENEATH * distance * normals.norm();
    if side < 0.0 && weights.contains(&0.0) && is_beside {
        return None;
    }
    let out = match distance > tie {
        true if side < 0.0 => way / -distance,
        true => way / distance,
        false => normals.normalize(),
    };
    let signed = if side < 0.0 { -distance } else { distance };
    Some((signed, facet, weights, out))
}

/// Way of a place at `x` to the surface of another body, its clearance left; none where no facet is near.
pub(super) fn way_to_surface<const D: usize>(
    surface: &Surface<D>,
    corners: &[Vector<D>],
    (place, x): (u32, Vector<D>),
    facets: &[u32],
) -> Option<Vector<D>> {
    let (distance, facet, _, out) = nearest(surface, corners, (place, x), facets)?;
    let is_above = out.dot(&surface.normal(facet, corners)) > BENEATH;
    is_above.then(|| out * (surface.places[place as usize].clearance - distance))
}

/// A place at `x` that may touch some facets, if it does.
pub(super) fn touch<const D: usize>(
    surface: &Surface<D>,
    factor: f64,
    corners: &[Vector<D>],
    (place, x): (u32, Vector<D>),
    facets: &[u32],
) -> Option<Touch<D>> {
    let own = &surface.places[place as usize];
    let (distance, facet, weights, normal) = nearest(surface, corners, (place, x), facets)?;
    let other = &surface.facets[facet as usize];
    let depth = own.clearance - distance;
    let deepest = surface.reach_in(own, facet);
    if !(depth > ALIKE * ALIKE * own.size && -distance <= deepest) {
        return None;
    }
    let half = if own.facet == NONE { 1.0 } else { 0.5 };
    // a place on a coarse face presses on no more than it meets
    let area = own
        .area
        .min(area(&surface.corners_of(facet, &surface.corners)));
    Some(Touch {
        facet,
        weights,
        normal,
        depth,
        stiffness: half * factor * own.stiffness.min(other.stiffness) * area,
        friction: Vector::zeros(),
    })
}
