//! Strain and stress of peridynamic points as files show them.

use rayon::prelude::*;

use super::solution::Solved;
use super::solution_samples::Intact;
use super::stresses::KnownStresses;
use crate::system::Spread;
use crate::tensor::{Tensor, strain};

/// Strain and stress of a point.
pub(super) type PointTensors<const D: usize> = [Tensor<D>; 2];

impl<const D: usize> Solved<'_, D> {
    /// Strain and stress at a site that is a point.
    pub(super) fn tensors_at(
        &self,
        site: usize,
        intact: &Intact,
        known: &KnownStresses,
    ) -> PointTensors<D> {
        let stress = self.point_stress(site, |p, j| intact.is_intact(p, j), known);
        [strain(&self.point_gradient(site, intact)), stress]
    }

    /// Collective: strain and stress of all sites, of a body that is all points; each process computes its own ones. Empty unless `wanted` by this process.
    pub(super) fn gathered_tensors(
        &self,
        spread: &Spread<'_>,
        wanted: bool,
    ) -> Vec<PointTensors<D>> {
        let (intact, known) = (Intact::of(self), KnownStresses::of(self));
        let own = spread.own().par_iter();
        let own: Vec<PointTensors<D>> = own
            .map(|&site| self.tensors_at(site as usize, &intact, &known))
            .collect();
        let sites = self.model.sites.len();
        let none = [Tensor::zeros(); 2];
        let mut all = vec![none; if wanted { sites } else { 0 }];
        // one component after another: no process but the first has room for all of them
        let mut numbers = vec![0.0; sites];
        for which in 0..2 {
            for k in 0..D * D {
                let mine: Vec<f64> = own.iter().map(|tensors| tensors[which][k]).collect();
                spread.gather_sites(&mine, &mut numbers);
                let places = all.iter_mut().zip(&numbers);
                places.for_each(|(tensors, x)| tensors[which][k] = *x);
            }
        }
        all
    }
}
