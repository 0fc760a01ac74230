//! Model of a cell.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::model::Zone;
use crate::run::solution::{Solved, label};

/// Label of local elements in a rim of its own around the zone.
const RIM: u8 = 3;

/// Label of elements of the mesh that such a rim cuts.
const CUT: u8 = 4;

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
            text: "0 local, 1 transition, 2 nonlocal; with a rim of its own 3 local in the rim, 4 an element that the rim cuts.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let embedded = &solved.model.mesh.embedded;
        Found::new("model", move |place| {
            let zone = place.zone();
            Value::Label(match place.cell().filter(|_| zone == Zone::Local) {
                Some(c) if embedded.is_of_patch(c) => RIM,
                Some(c) if embedded.cut_cell(c).is_some() => CUT,
                _ => label(zone),
            })
        })
    }
}
