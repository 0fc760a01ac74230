//! Damage.

use super::{About, Columns, Found, On, OutputField, Rank, Value, Wanted};
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
            wanted: Wanted::Always,
            columns: Columns::Never,
            text: "Share of the volume of a family whose bonds are broken, or have lost their stiffness; 0 at nodes.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let damage = solved.damage?;
        let at = |site: usize| damage[site];
        Found::new("damage", move |place| {
            Value::Scalar(place.site().map_or(0.0, at))
        })
    }
}
