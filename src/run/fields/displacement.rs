//! Displacement.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
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
            wanted: WrittenWhen::Always,
            columns: TableColumns::Always("u"),
            text: "Displacement of nodes and points.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let _ = solved;
        Found::new("displacement", |place| Value::Vector(place.displacement()))
    }
}
