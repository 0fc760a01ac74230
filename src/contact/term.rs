//! Contact of surfaces as a force term.
//!
//! At rest nothing touches: the tangent is that of the bodies, and contact enters the stable step by its bounds.

use std::borrow::Cow;
use std::sync::PoisonError;

use super::SurfaceContact;
use crate::system::{ForceTerm, Interval, RateBounds, SpringRows};

/// The displacement over which forces are differenced, over the size of the smallest cell.
const DIFFERENCED: f64 = 1e-7;

/// Round-off of a depth, over the places that it is a difference of.
const ROUND_OFF: f64 = 4.0 * f64::EPSILON;

impl<const D: usize> ForceTerm for SurfaceContact<D> {
    fn own_masses(&self) -> Vec<f64> {
        Vec::new()
    }

    fn add_force(&self, u: &[f64], force: &mut [f64], _interval: Interval) {
        SurfaceContact::add_force(self, u, force);
    }

    fn rows(&self, at: Option<&[f64]>) -> Option<Cow<'_, SpringRows>> {
        at.and_then(|u| self.tangent(u)).map(Cow::Owned)
    }

    fn add_row_sums(&self, sums: &mut Vec<f64>) {
        // Σ_b |n_a n_b| ≤ √D, once for the site and once for the others
        let spread = self.law.counted * 2.0 * (D as f64).sqrt();
        for (sums, bound) in sums.chunks_exact_mut(D).zip(&self.bounds) {
            sums.iter_mut().for_each(|s| *s += spread * bound);
        }
    }

    fn difference_length(&self) -> Option<f64> {
        Some(DIFFERENCED * self.smallest)
    }

    fn rate_bounds(&self, mass: &[f64]) -> RateBounds {
        let each = self
            .bounds
            .iter()
            .zip(mass)
            .filter(|(bound, _)| **bound > 0.0);
        let largest = each.map(|(bound, mass)| bound / mass).fold(0.0, f64::max);
        RateBounds {
            stiffness: 2.0 * self.law.counted * largest,
            drag: 0.0,
        }
    }

    fn round_off(&self, u: &[f64]) -> f64 {
        let of_place = |place: u32, stiffness: f64| {
            let size: f64 = self.surface.rest[place as usize].norm();
            (stiffness * ROUND_OFF * size).powi(2)
        };
        self.sum(u, |place, touch| of_place(place, touch.stiffness))
            .sqrt()
    }

    fn energy(&self, u: &[f64]) -> f64 {
        SurfaceContact::energy(self, u)
    }

    fn commit(&self, u: &[f64], _interval: Interval) {
        if !self.is_rough() || self.surface.facets.is_empty() {
            return;
        }
        let mut work = std::mem::take(&mut *self.work());
        self.update(&mut work, u);
        let surface = &self.surface;
        let near = work.near.places.iter().zip(&work.touches);
        let places = near.map(|(&place, touch)| (place, self.place_at(place, u), touch.as_ref()));
        let mut grip = self.grip.write().unwrap_or_else(PoisonError::into_inner);
        grip.commit(places, surface, &work.corners);
        drop(grip);
        *self.work() = work;
    }

    fn dissipated(&self) -> Option<f64> {
        self.work_of_friction()
    }

    fn state(&self) -> Vec<u64> {
        self.grip().state()
    }

    fn restore(&self, state: &[u64]) -> bool {
        (self.grip.write().unwrap_or_else(PoisonError::into_inner)).restore(state, &self.surface)
    }
}
