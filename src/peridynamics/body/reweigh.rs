//! Weights of single families that are not those of the law.

use super::{Family, LinearForceState, PdBody, PointError};
use crate::tensor::Vector;

impl<const D: usize> PdBody<D> {
    /// Gives the bonds of point `i` the plain weights of the law times `factors`, and its state the shape that follows.
    ///
    /// # Errors
    /// [`PointError`] for a family whose shape cannot be inverted.
    pub(crate) fn reweigh(
        &mut self,
        law: &dyn LinearForceState<D>,
        i: usize,
        factors: &[f64],
    ) -> Result<(), PointError<D>> {
        let family = self.families.of(i).iter().map(|&j| j as usize);
        let bonds: Vec<Vector<D>> = family.clone().map(|j| self.bond(i, j)).collect();
        let volumes = family.zip(factors).map(|(j, f)| self.cloud.volume[j] * f);
        let volumes: Vec<f64> = volumes.collect();
        let own = self.families.offsets[i]..self.families.offsets[i + 1];
        let (pair, omega) = (&mut self.pair[own.clone()], &mut self.omega[own]);
        let family = Family {
            bonds: &bonds,
            volumes: &volumes,
            factors: &[],
            horizon: self.cloud.horizon.of(i),
            bond_horizons: &[],
            materials: None,
        };
        let state = law.coefficients(&family, pair, omega);
        self.state[i] = state.map_err(|source| PointError {
            point: i,
            position: self.cloud.position[i],
            bonds: bonds.len(),
            source,
        })?;
        omega.iter_mut().zip(factors).for_each(|(w, f)| *w *= f);
        Ok(())
    }
}
