//! Velocity of a scene in motion.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
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
            wanted: WrittenWhen::Always,
            columns: TableColumns::Never,
            text: "Velocity, in scenes in time.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let velocity = solved.moved.velocity?;
        Found::new("velocity", |place| Value::Vector(place.vector(velocity)))
    }
}
