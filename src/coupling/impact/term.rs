//! Impactors as a force term.
//!
//! At rest nothing touches: the tangent is that of the body, and contact enters the stable step by its bound of frequencies.

use std::borrow::Cow;

use super::Impact;
use crate::system::{ForceTerm, Interval, RateBounds, SpringRows};

/// The displacement over which forces are differenced, over the size of the smallest site.
const DIFFERENCED: f64 = 1e-7;

impl<const D: usize> ForceTerm for Impact<D> {
    fn own_masses(&self) -> Vec<f64> {
        self.masses().collect()
    }

    fn add_force(&self, u: &[f64], force: &mut [f64], _interval: Interval) {
        Impact::add_force(self, u, force);
    }

    fn rows(&self, _at: Option<&[f64]>) -> Option<Cow<'_, SpringRows>> {
        None
    }

    fn add_row_sums(&self, sums: &mut Vec<f64>) {
        self.extend_row_sums(sums);
    }

    fn difference_length(&self) -> Option<f64> {
        Some(DIFFERENCED * self.smallest)
    }

    fn rate_bounds(&self, mass: &[f64]) -> RateBounds {
        RateBounds {
            stiffness: self.frequency_bound(mass),
            drag: 0.0,
        }
    }

    fn round_off(&self, u: &[f64]) -> f64 {
        Impact::round_off(self, u)
    }

    fn energy(&self, u: &[f64]) -> f64 {
        Impact::energy(self, u)
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
