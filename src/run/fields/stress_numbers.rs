//! Numbers made of the stress.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::run::solution::Solved;
use crate::run::stresses::von_mises;

/// A number made of the principal stresses.
pub(super) struct StressNumber {
    name: &'static str,
    text: &'static str,
    of: fn(&[f64; 3]) -> f64,
}

/// Von Mises stress.
pub(super) const VON_MISES: StressNumber = StressNumber {
    name: "von-mises",
    text: "Von Mises stress.",
    of: von_mises,
};

/// Largest principal stress.
pub(super) const MAX_PRINCIPAL: StressNumber = StressNumber {
    name: "max-principal",
    text: "Largest principal stress.",
    of: |principal| principal.iter().copied().fold(f64::NEG_INFINITY, f64::max),
};

/// Smallest principal stress.
pub(super) const MIN_PRINCIPAL: StressNumber = StressNumber {
    name: "min-principal",
    text: "Smallest principal stress.",
    of: |principal| principal.iter().copied().fold(f64::INFINITY, f64::min),
};

impl<const D: usize> OutputField<D> for StressNumber {
    fn about(&self) -> About {
        About {
            name: self.name,
            unit: "Pa",
            on: On::Cells,
            rank: Rank::Scalar,
            wanted: WrittenWhen::By("output.stresses"),
            columns: TableColumns::Asked,
            text: self.text,
        }
    }

    fn of<'s>(&self, _solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let of = self.of;
        Found::new(self.name, move |place| {
            Value::Scalar(of(&place.stress().principal()))
        })
    }
}
