//! Horizon.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::model::Zone;
use crate::run::solution::Solved;

/// Horizon.
pub(super) struct Horizon;

impl<const D: usize> OutputField<D> for Horizon {
    fn about(&self) -> About {
        About {
            name: "horizon",
            unit: "m",
            on: On::Points,
            rank: Rank::Scalar,
            wanted: WrittenWhen::Always,
            columns: TableColumns::Never,
            text: "Horizon of nonlocal sites, 0 of others.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let model = solved.model;
        let of = move |site: usize| match (&model.peridynamics, solved.zone_of_site[site]) {
            (None, _) | (_, Zone::Local) => 0.0,
            (Some(p), _) => p.horizon.at(&model.sites[site].position),
        };
        Found::new("horizon", move |place| Value::Scalar(place.scalar(of)))
    }
}
