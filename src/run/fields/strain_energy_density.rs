//! Strain energy density of elements and points.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::run::solution::Solved;

/// Strain energy density of elements and points.
pub(super) struct StrainEnergyDensity;

impl<const D: usize> OutputField<D> for StrainEnergyDensity {
    fn about(&self) -> About {
        About {
            name: "strain-energy-density",
            unit: "J/m³",
            on: On::Cells,
            rank: Rank::Scalar,
            wanted: WrittenWhen::By("output.fields"),
            columns: TableColumns::Asked,
            text: "Stored energy per undeformed volume: of elements by their law, of points by their force states.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let of_points = solved.energies_of_points();
        Found::new("strain-energy-density", move |place| {
            Value::Scalar(match place.cell() {
                Some(c) => solved.energy_of_cell(c, place),
                None => of_points(place),
            })
        })
    }
}
