//! The history of a system that moves: what laws remember, which bonds are broken, and what that has cost.

use super::{BodyState, Dissipation, Halfway};

/// Memory, damage and dissipation of a system.
///
/// Every method is required: a system without a history says so, and one that wraps another one hands the history on.
pub trait BodyHistory {
    /// Ends the interval at the displacement of the last call of [`SemiDiscrete::internal_force_into`](super::SemiDiscrete::internal_force_into): what laws remember is from now on what they remembered there. A trial that is not committed leaves no trace.
    fn commit(&mut self);

    /// Returns the cost of the bonds broken so far; none if nothing can break.
    fn dissipation(&self) -> Option<Dissipation>;

    /// Puts an earlier account of [`BodyHistory::dissipation`] in the place of this one: that of another layout of the same body.
    fn set_dissipation(&mut self, dissipation: Dissipation);

    /// Adds to the account the cost of the bonds that the last call of [`SemiDiscrete::internal_force_into`](super::SemiDiscrete::internal_force_into) broke, with the energies of the displacement `at`.
    /// A driver that lets bonds break calls this before anything else.
    fn account_for_breaks(&mut self, at: &Halfway<'_>);

    /// Returns the state of damage (one bit per bond, and what cannot be recomputed from it), for a checkpoint; empty without damage.
    fn damage_state(&self) -> Vec<u64>;

    /// Restores the state that [`BodyHistory::damage_state`] gave; false if it belongs to another model.
    fn restore_damage(&mut self, state: &[u64]) -> bool;

    /// The state of the body, as results show it; none of a linear system in which nothing breaks.
    fn body_state(&self) -> Option<&dyn BodyState>;
}
