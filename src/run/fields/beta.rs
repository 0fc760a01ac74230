//! Blending function.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::run::solution::Solved;

/// Blending function.
pub(super) struct Beta;

impl<const D: usize> OutputField<D> for Beta {
    fn about(&self) -> About {
        About {
            name: "beta",
            unit: "1",
            on: On::Points,
            rank: Rank::Scalar,
            wanted: WrittenWhen::Always,
            columns: TableColumns::Never,
            text: "Blending function: 1 where a site is peridynamic, 0 where it is local.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let beta = |site| (solved.operator.beta)(site);
        Found::new("beta", move |place| Value::Scalar(place.scalar(beta)))
    }
}
