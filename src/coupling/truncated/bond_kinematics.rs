//! Kinematics of a part of a bond: a piece, or a whole bond of a point at the seam.

use super::bond_segments::Segments;
use crate::{
    peridynamics::bond_force::{extension, ratio, stretched},
    tensor::Vector,
};

/// A piece of a bond, or a whole bond.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part<const D: usize> {
    pub xi: [f64; D],
    /// `k/s`, of the energy `½ (k/s) (ξ·Δu)²` at rest.
    pub stiffness: f64,
    /// s, as a fraction of the bond.
    pub length: f64,
    pub bond: u32,
}

impl<const D: usize> Part<D> {
    /// Returns the stretched state of the part under a difference of displacement over it.
    pub fn strained<const EXACT: bool>(&self, difference: &Vector<D>) -> Strained<D> {
        let d = difference / self.length;
        let s = stretched::<D, EXACT>(&self.xi, &[0.0; D], d.as_slice());
        let t = s.t();
        let r = ratio::<EXACT>(t);
        Strained {
            direction: s.direction.map(|x| r * x),
            elongation: self.length * s.length * extension::<EXACT>(t),
            excess: s.excess,
            square: s.length,
        }
    }
}

/// A part under a displacement: with `q = s |ξ|² ε`, the derivative of q by the difference of displacement.
pub(super) struct Strained<const D: usize> {
    pub direction: [f64; D],
    /// q.
    pub elongation: f64,
    /// `t |ξ|²` of the stretch, and `|ξ|²`: what is over a limit is found without dividing.
    pub excess: f64,
    pub square: f64,
}

/// The whole bonds of the points at the seam, lower number first unless only the higher one is there.
pub(super) fn whole_bonds<const D: usize>(segments: &Segments<'_, D>) -> Vec<[u32; 2]> {
    let mut whole = Vec::new();
    for i in (0..segments.site.len() as u32).filter(|&i| segments.at_seam[i as usize]) {
        let family = segments.body.families.of(i as usize).iter();
        let own = family
            .filter(|&&j| segments.is_whole(i, j) && (j > i || !segments.at_seam[j as usize]));
        whole.extend(own.map(|&j| [i, j]));
    }
    whole
}
