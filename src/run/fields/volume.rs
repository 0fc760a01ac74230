//! Volume of a cell.

use super::place::Spot;
use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::fem;
use crate::run::solution::Solved;

/// Volume of a cell.
pub(super) struct Volume;

impl<const D: usize> OutputField<D> for Volume {
    fn about(&self) -> About {
        About {
            name: "volume",
            unit: "m³",
            on: On::Cells,
            rank: Rank::Scalar,
            wanted: WrittenWhen::Always,
            columns: TableColumns::Never,
            text: "Volume of an element, of a part of one that is cut, or of a point.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let mesh = &solved.model.mesh;
        Found::new("volume", move |place| {
            let of_point = || place.point().map_or(0.0, |(body, p)| body.cloud.volume[p]);
            let of_cell = |c| fem::cell_volume(mesh, c);
            Value::Scalar(match place.spot {
                Spot::Part(_, volume) => volume,
                _ => place.cell().map_or_else(of_point, of_cell),
            })
        })
    }
}
