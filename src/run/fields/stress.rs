//! Stress, and which of them turn with the body.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::run::solution::Solved;
use crate::run::stresses;

/// The stress tensor.
pub(super) struct StressTensor;

impl<const D: usize> OutputField<D> for StressTensor {
    fn about(&self) -> About {
        About {
            name: stresses::FIELD,
            unit: "Pa",
            on: On::Cells,
            rank: Rank::Tensor,
            wanted: WrittenWhen::Always,
            columns: TableColumns::WithStresses("s"),
            text: "Stress without its thermal part; called linear_stress in a scene whose stresses are linear throughout.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        Found::new(solved.stress_name(), |place| Value::Stress(place.stress()))
    }
}

/// Measure of each stress.
pub(super) struct StressMeasure;

impl<const D: usize> OutputField<D> for StressMeasure {
    fn about(&self) -> About {
        About {
            name: "stress_measure",
            unit: "1",
            on: On::Cells,
            rank: Rank::Label,
            wanted: WrittenWhen::Always,
            columns: TableColumns::Never,
            text: "1 for a Cauchy stress, 0 for a linear one; where some stresses turn with the body.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let found = Found::new("stress_measure", |place| {
            let of_point = || place.point().map_or(0, |(_, p)| solved.measure_of_point(p));
            let of_cell = |c| solved.measure_of_cell(c);
            Value::Label(place.cell().map_or_else(of_point, of_cell))
        });
        found.filter(|_| solved.has_cauchy_stresses())
    }
}
