//! Model of a cell.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::run::solution::{Solved, label};

/// Model of a cell.
pub(super) struct ModelLabel;

impl<const D: usize> OutputField<D> for ModelLabel {
    fn about(&self) -> About {
        About {
            name: "model",
            unit: "1",
            on: On::Cells,
            rank: Rank::Label,
            wanted: WrittenWhen::Always,
            columns: TableColumns::Always("model"),
            text: "0 local, 1 transition, 2 nonlocal.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let _ = solved;
        Found::new("model", |place| Value::Label(label(place.zone())))
    }
}
