//! Force terms beside those of the body: `f(u) = F_body(u) + Σ F_k(u)`.

use std::borrow::Cow;

use super::{Interval, SpringRows};

/// Upper bounds of the part that a term, or all forces of a system, may add to the eigenvalues of the motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RateBounds {
    /// Of `M⁻¹ K`, by forces that are not in the tangent at rest \[1/s²\]: contact.
    pub stiffness: f64,
    /// Of `M⁻¹ C` of forces `C v` against the velocities of the interval \[1/s\].
    pub drag: f64,
}

/// One term of the sum: springs to the ground, impactors, dashpots, loads that follow the body. It knows its own places, and neither the body nor other terms.
///
/// Shapes: `u`, `force` and `sums` have the unknowns of all sites, those of the body first and then the term's own. Every method is required: a term that leaves a force, an energy or a bound out
/// says so. A term with a history keeps it behind a lock: the run and its records share it.
pub trait ForceTerm: Send + Sync {
    /// Masses \[kg\] of the sites that the term has beside those of the body; empty for a term on the body alone. At most one term of a system has some.
    fn own_masses(&self) -> Vec<f64>;

    /// Adds its force at the displacement `u` that ends an interval to `force` \[N\], in the sense of an internal force. An interval of length zero is the instant of the last
    /// [`ForceTerm::commit`]: velocities are those of then.
    fn add_force(&self, u: &[f64], force: &mut [f64], interval: Interval);

    /// Its tangent at rest, none if it vanishes there; `at` a displacement what it has beyond that, symmetric and without negative energies, none if that is nothing or has to be differenced.
    fn rows(&self, at: Option<&[f64]>) -> Option<Cow<'_, SpringRows>>;

    /// Adds an upper bound of `Σ_b |K_ab|`, contact included, to the `sums` of the body's unknowns, and appends those of its own.
    fn add_row_sums(&self, sums: &mut Vec<f64>);

    /// The displacement \[m\] over which its force is differenced where its tangent is wanted; none for a force that is linear in the displacement.
    fn difference_length(&self) -> Option<f64>;

    /// Bounds of its part of the eigenvalues of the motion, `mass` being that of the body's sites.
    fn rate_bounds(&self, mass: &[f64]) -> RateBounds;

    /// Norm of the force \[N\] that rounding of places leaves at a displacement.
    fn round_off(&self, u: &[f64]) -> f64;

    /// The energy that it stores \[J\].
    fn energy(&self, u: &[f64]) -> f64;

    /// Ends an interval at the displacement `u`.
    fn commit(&self, u: &[f64], interval: Interval);

    /// The energy that it has dissipated up to the last [`ForceTerm::commit`] \[J\]; none for a term that never does.
    fn dissipated(&self) -> Option<f64>;

    /// Words of its memory for a checkpoint; empty for a term without memory.
    fn state(&self) -> Vec<u64>;

    /// Restores the state that [`ForceTerm::state`] gave; false if it belongs to another term.
    fn restore(&self, state: &[u64]) -> bool;
}

impl ForceTerm for SpringRows {
    fn own_masses(&self) -> Vec<f64> {
        Vec::new()
    }

    fn add_force(&self, u: &[f64], force: &mut [f64], _interval: Interval) {
        self.add_product(u, force);
    }

    fn rows(&self, at: Option<&[f64]>) -> Option<Cow<'_, SpringRows>> {
        at.is_none().then_some(Cow::Borrowed(self))
    }

    fn add_row_sums(&self, sums: &mut Vec<f64>) {
        self.add_sums_to(sums);
    }

    fn difference_length(&self) -> Option<f64> {
        None
    }

    fn rate_bounds(&self, _mass: &[f64]) -> RateBounds {
        RateBounds::default()
    }

    fn round_off(&self, _u: &[f64]) -> f64 {
        0.0
    }

    fn energy(&self, u: &[f64]) -> f64 {
        SpringRows::energy(self, u)
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
