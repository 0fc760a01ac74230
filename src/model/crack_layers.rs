//! Area of cracks from the layers of bonds that they have broken.
//!
//! A crack breaks bonds between next neighbours in one layer where it is slow, and in several where it is fast, rough or about to branch. Each bond stands for the area that a single
//! layer would have (see [`CrackArea`](crate::peridynamics::CrackArea)), divided by the number of layers around it: the area of broken bonds within a horizon of it, projected on the plane of the crack, over the area
//! of the plane, both weighted by a smooth window. The normal of the plane is the direction in which these bonds are spread least.

use nalgebra::Matrix3;

use super::bins::Bins;
use crate::{parallel, tensor::Vector};

/// A broken bond between next neighbours.
#[derive(Clone, Copy, Debug)]
pub struct BrokenBond<const D: usize> {
    /// Middle of the bond \[m\].
    pub middle: Vector<D>,
    /// Area of a single layer that it stands for \[m^(D−1)\].
    pub area: f64,
    /// Horizon there \[m\].
    pub horizon: f64,
}

/// Neighbours whose spread gives the normal, in horizons: layers of a band that wide are seen from its edges, and two branches are told apart where they are further from each other.
const REACH: f64 = 1.1;

/// Layers up to which there is one: planes that are not along the axes of a lattice differ by less.
const ONE_LAYER: f64 = 1.05;

/// Area of the cracks that these bonds have left \[m^(D−1)\]: a length in the plane, a number in a bar. The same bits for any number of threads.
pub fn area<const D: usize>(bonds: &[BrokenBond<D>]) -> f64 {
    let places: Vec<Vector<D>> = bonds.iter().map(|b| b.middle).collect();
    let widest = bonds.iter().map(|b| b.horizon).fold(0.0, f64::max);
    let bins = Bins::new(&places, REACH * widest.max(f64::MIN_POSITIVE));
    let of = parallel::map(bonds.len(), 64, |k| {
        let radius = REACH * bonds[k].horizon;
        let near: Vec<(Vector<D>, f64)> = bins
            .around(&places[k], radius)
            .map(|other| (places[other] - places[k], bonds[other].area))
            .filter(|(x, _)| x.norm() <= radius)
            .collect();
        if D == 1 {
            // each crack of a bar by its first bond
            let is_first = near.iter().all(|(x, _)| x[0] >= 0.0);
            return bonds[k].area * f64::from(u8::from(is_first));
        }
        let layers = layers(&near, bonds[k].horizon);
        bonds[k].area / if layers > ONE_LAYER { layers } else { 1.0 }
    });
    of.into_iter().sum()
}

/// Number of layers of a crack around a place, from the bonds near it with their areas.
fn layers<const D: usize>(near: &[(Vector<D>, f64)], horizon: f64) -> f64 {
    let normal = normal(near, REACH * horizon);
    let along = |(x, area): &(Vector<D>, f64)| {
        let s = (x - normal * normal.dot(x)).norm() / horizon;
        area * window(D, s) / horizon.powi(D as i32 - 1)
    };
    near.iter().map(along).sum()
}

/// A smooth window of unit integral over a crack, a line or a surface, which vanishes at `s` = 1.
fn window(dimension: usize, s: f64) -> f64 {
    use std::f64::consts::PI;
    let bell = if s < 1.0 { 1.0 + (PI * s).cos() } else { 0.0 };
    match dimension {
        2 => 0.5 * bell,
        _ => bell / (PI - 4.0 / PI),
    }
}

/// The direction in which places around the origin are spread least, near ones counting more.
fn normal<const D: usize>(near: &[(Vector<D>, f64)], radius: f64) -> Vector<D> {
    let weight = |(x, area): &(Vector<D>, f64)| area * (1.0 - x.norm_squared() / radius.powi(2));
    let total: f64 = near.iter().map(weight).sum();
    let mean = near.iter().map(|n| n.0 * weight(n)).sum::<Vector<D>>() / total;
    // directions beyond those of space are those of the largest spread
    let mut spread = Matrix3::identity() * radius.powi(2) * total;
    for a in 0..D {
        for b in 0..D {
            let moment = |n: &(Vector<D>, f64)| weight(n) * (n.0[a] - mean[a]) * (n.0[b] - mean[b]);
            spread[(a, b)] = near.iter().map(moment).sum();
        }
    }
    let eigen = spread.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    Vector::<D>::from_fn(|a, _| eigen.eigenvectors[(a, least)])
}

#[cfg(test)]
#[path = "crack_layers_tests.rs"]
mod tests;
