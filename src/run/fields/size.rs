//! Spacing of points.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::run::point_cells::PointCells;
use crate::run::solution::Solved;

/// Spacing of points.
pub(super) struct Size;

impl<const D: usize> OutputField<D> for Size {
    fn about(&self) -> About {
        About {
            name: "size",
            unit: "m",
            on: On::Points,
            rank: Rank::Scalar,
            wanted: WrittenWhen::Always,
            columns: TableColumns::Never,
            text: "Edge of the cell of a point, 0 at nodes.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let cells = PointCells::of(solved.model);
        Found::new("size", move |place| {
            Value::Scalar(place.point().map_or(0.0, |(_, p)| cells.size(p)))
        })
    }
}
