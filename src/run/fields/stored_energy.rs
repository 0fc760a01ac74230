//! Stored energies per volume, of points and of elements.

use super::place::Place;
use crate::run::solution::Solved;
use crate::tensor::Tensor;

impl<const D: usize> Solved<'_, D> {
    /// Stored energy of points per volume \[J/m^D\]; zero elsewhere.
    pub(super) fn energies_of_points(&self) -> impl Fn(&Place<'_, D>) -> f64 + Sync + '_ {
        let u = self.displacement;
        let told = self.state().and_then(|state| state.energy_densities(u));
        move |place| {
            let (Some((body, p)), Some(site)) = (place.point(), place.site()) else {
                return 0.0;
            };
            let stands = |j: usize| place.shared.intact.is_intact(p, j);
            match (&told, self.exact_law()) {
                (Some(told), _) => told[site],
                (None, Some(law)) => body.exact_response(p, law, u, stands, |_| 0.0).1,
                (None, None) => body.energy_density(p, u, stands),
            }
        }
    }

    /// Stored energy of an element per volume \[J/m^D\], at a place in it: that of its law, `½ σ : ε` without thermal strains where that is linear, with what holds the body back across its plane in plane strain.
    pub(super) fn energy_of_cell(&self, c: usize, place: &Place<'_, D>) -> f64 {
        let told = (self.state()).and_then(|state| state.energy_of_cell(c, self.displacement));
        let linear = || {
            let stress = place.stress();
            let (free, held) = match self.thermal() {
                Some((thermal, t)) => (
                    thermal.cell_gradient(self.model, c, t),
                    thermal.held_energy(self.model, c, t),
                ),
                None => (Tensor::zeros(), 0.0),
            };
            0.5 * stress.tensor.dot(&(place.gradient() - free)) + held
        };
        told.unwrap_or_else(linear)
    }
}
