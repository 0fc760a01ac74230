//! Model of a cell.

use super::{About, Columns, Found, On, OutputField, Rank, Value, Wanted};
use crate::run::solution::Solved;
use crate::run::solution_samples::label;

/// Model of a cell.
pub(super) struct ModelLabel;

impl<const D: usize> OutputField<D> for ModelLabel {
    fn about(&self) -> About {
        About {
            name: "model",
            unit: "1",
            on: On::Cells,
            rank: Rank::Label,
            wanted: Wanted::Always,
            columns: Columns::Always("model"),
            text: "0 local, 1 transition, 2 nonlocal.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let _ = solved;
        Found::new("model", |place| Value::Label(label(place.zone())))
    }
}
