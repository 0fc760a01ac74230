//! Linear strain.

use super::{About, Columns, Found, On, OutputField, Rank, Value, Wanted};
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
            wanted: Wanted::Always,
            columns: Columns::Always("e"),
            text: "Symmetric part of the displacement gradient.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let _ = solved;
        Found::new("strain", |place| Value::Tensor(strain(&place.gradient())))
    }
}
