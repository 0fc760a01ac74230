//! Energy density of points.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::run::solution::Solved;

/// Energy density of points.
pub(super) struct EnergyDensity;

impl<const D: usize> OutputField<D> for EnergyDensity {
    fn about(&self) -> About {
        About {
            name: "energy-density",
            unit: "J/m³",
            on: On::Points,
            rank: Rank::Scalar,
            wanted: WrittenWhen::By("output.energy-density"),
            columns: TableColumns::Never,
            text: "Stored energy of points per volume, 0 at nodes.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let energies = solved.energies_of_points();
        Found::new("energy-density", move |place| {
            Value::Scalar(place.point().map_or(0.0, |_| energies(place)))
        })
    }
}
