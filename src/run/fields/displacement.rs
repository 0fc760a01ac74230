//! Displacement.

use super::{About, Columns, Found, On, OutputField, Rank, Value, Wanted};
use crate::run::solution::Solved;

/// Displacement.
pub(super) struct Displacement;

impl<const D: usize> OutputField<D> for Displacement {
    fn about(&self) -> About {
        About {
            name: "displacement",
            unit: "m",
            on: On::Points,
            rank: Rank::Vector,
            wanted: Wanted::Always,
            columns: Columns::Always("u"),
            text: "Displacement of nodes and points.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let _ = solved;
        Found::new("displacement", |place| Value::Vector(place.displacement()))
    }
}
