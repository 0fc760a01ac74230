//! Force out of balance.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::run::solution::Solved;
use crate::tensor::Vector;

/// Force out of balance.
pub(super) struct Residual;

impl<const D: usize> OutputField<D> for Residual {
    fn about(&self) -> About {
        About {
            name: "residual",
            unit: "N",
            on: On::Points,
            rank: Rank::Vector,
            wanted: WrittenWhen::Always,
            columns: TableColumns::Never,
            text: "Internal less external force, on supports the reaction; of static scenes.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let residual = solved.residual;
        let at = |site: usize| Vector::from_column_slice(&residual[site * D..][..D]);
        let found = Found::new("residual", move |place| {
            Value::Vector(place.site().map_or_else(Vector::zeros, at))
        });
        found.filter(|_| !residual.is_empty())
    }
}
