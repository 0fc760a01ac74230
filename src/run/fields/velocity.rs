//! Velocity of a scene in motion.

use super::{About, Columns, Found, On, OutputField, Rank, Value, Wanted};
use crate::run::solution::Solved;

/// Velocity of a scene in motion.
pub(super) struct Velocity;

impl<const D: usize> OutputField<D> for Velocity {
    fn about(&self) -> About {
        About {
            name: "velocity",
            unit: "m/s",
            on: On::Points,
            rank: Rank::Vector,
            wanted: Wanted::Always,
            columns: Columns::Never,
            text: "Velocity, in scenes in time.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let velocity = solved.velocity?;
        Found::new("velocity", |place| Value::Vector(place.vector(velocity)))
    }
}
