//! Linear strain.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::run::solution::Solved;
use crate::tensor::strain;

/// Linear strain.
pub(super) struct Strain;

impl<const D: usize> OutputField<D> for Strain {
    fn about(&self) -> About {
        About {
            name: "strain",
            unit: "1",
            on: On::Cells,
            rank: Rank::Tensor,
            wanted: WrittenWhen::Always,
            columns: TableColumns::Always("e"),
            text: "Symmetric part of the displacement gradient.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let _ = solved;
        Found::new("strain", |place| Value::Tensor(strain(&place.gradient())))
    }
}
