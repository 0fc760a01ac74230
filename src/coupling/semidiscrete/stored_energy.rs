//! Energy that a coupled system stores, as far as its bonds and linear elements go.

use std::sync::PoisonError;

use super::{CoupledSystem, behaviour::CHUNK, body::MovingBody};
use crate::{
    parallel,
    system::{Symmetry, Tangent},
    tensor::Vector,
};

impl<const D: usize> CoupledSystem<'_, D> {
    /// Energy of the bonds of the pass, and of contact \[J\].
    fn bond_energy(&self, u: &[f64]) -> f64 {
        self.body.as_ref().map_or(0.0, |body| {
            let mut points = vec![0.0; body.displacement.len()];
            body.spread(u, &mut points);
            let contact = body.contact.as_ref().map_or(0.0, |contact| {
                contact
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .energy(&points, &|i, j| body.pass.bonded(i, j))
            });
            body.pass.stored_energy(&points) + contact
        })
    }

    /// Energy \[J\] as if all elements were linear.
    pub(super) fn energy_of_linear_elements_and_bonds(&self, u: &[f64]) -> f64 {
        let of_rows = || {
            let rows = |site: usize| self.linear.product::<D>(site, u);
            let elements = parallel::map(self.mass.len(), CHUNK, |s| {
                0.5 * rows(s).dot(&Vector::from_column_slice(&u[s * D..][..D]))
            });
            elements.iter().sum::<f64>()
        };
        if let Some(seam) = &self.seam {
            return of_rows() + self.bond_energy(u) + seam.energy(u);
        }
        let is_body_alone = self
            .body
            .as_ref()
            .is_some_and(|b| b.alone == self.mass.len());
        if self.symmetry == Symmetry::Symmetric && !is_body_alone {
            // a seam that has an energy
            if self.body.as_ref().is_some_and(MovingBody::takes_all_points) {
                // whole bonds are passed over, exact where they turn; rows have what the seam cuts
                return of_rows() + self.bond_energy(u);
            }
            // rows have whole bonds too: the energy of all is known to first order in the stretch of exact bonds
            let mut force = vec![0.0; u.len()];
            self.tangent_into(u, &mut force);
            let products: Vec<f64> = parallel::map_chunks(u, CHUNK, |chunk, u| {
                let force = &force[chunk * CHUNK..];
                u.iter().zip(force).map(|(u, f)| u * f).sum()
            });
            return 0.5 * products.iter().sum::<f64>();
        }
        let elements = self
            .energy
            .of::<D>(&self.linear, &self.model.node_transfer, u);
        elements + self.bond_energy(u)
    }
}
