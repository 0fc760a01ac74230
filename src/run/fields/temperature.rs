//! Temperature.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::run::solution::Solved;

/// Temperature of a place.
pub(super) struct Temperature;

impl<const D: usize> OutputField<D> for Temperature {
    fn about(&self) -> About {
        About {
            name: "temperature",
            unit: "K",
            on: On::Points,
            rank: Rank::Scalar,
            wanted: WrittenWhen::By("output.fields"),
            columns: TableColumns::Asked,
            text: "Temperature, typed or from heat conduction, in the unit of the scene.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let (thermal, t) = solved.thermal()?;
        Found::new("temperature", move |place| {
            Value::Scalar(thermal.temperature.at(&place.position(), t))
        })
    }
}
