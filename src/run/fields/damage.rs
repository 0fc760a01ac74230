//! Damage.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::run::solution::Solved;

/// Damage.
pub(super) struct Damage;

impl<const D: usize> OutputField<D> for Damage {
    fn about(&self) -> About {
        About {
            name: "damage",
            unit: "1",
            on: On::Points,
            rank: Rank::Scalar,
            wanted: WrittenWhen::Always,
            columns: TableColumns::Never,
            text: "Share of the volume of a family whose bonds are broken, have lost their stiffness, or are cut by a crack or a void of the scene; 0 at nodes.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let damage = solved.moved.damage?;
        let at = |site: usize| damage[site];
        Found::new("damage", move |place| Value::Scalar(place.scalar(at)))
    }
}
