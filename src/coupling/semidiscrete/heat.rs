//! Bonds that know their temperature: all but those that break or bend are linear, and expand by their rows.

use std::sync::Arc;

use super::{CoupledSystem, behaviour::SystemError};
use crate::{
    assembly::{self, Row},
    peridynamics::{PdBody, bond_force::BondPass},
    system::BlockCsr,
    tensor::Vector,
};

/// The stretch `α ΔT` by which points expand freely.
#[derive(Clone)]
pub struct FreeStretch<const D: usize> {
    /// At a place, of a material's number, at a time.
    pub at: Arc<dyn Fn(&Vector<D>, u16, f64) -> f64 + Send + Sync>,
    /// Whether it changes with time.
    pub varies_in_time: bool,
}

/// The free stretch of all points of a body.
pub(super) struct PointHeat<const D: usize> {
    stretch: FreeStretch<D>,
    places: Vec<(Vector<D>, u16)>,
    /// Of when the pass has it.
    time: f64,
}

impl<const D: usize> PointHeat<D> {
    /// Of the points of `body`, `material` being that of a body of one; the pass has it at time zero.
    ///
    /// # Errors
    /// [`SystemError::Expansion`] for a law whose pass knows no temperature.
    pub fn new(
        stretch: &FreeStretch<D>,
        body: &PdBody<D>,
        material: u16,
        law: &'static str,
        pass: &mut dyn BondPass<D>,
    ) -> Result<Self, SystemError> {
        let cloud = &body.cloud;
        let of = |(i, x): (usize, &Vector<D>)| (*x, *cloud.material.get(i).unwrap_or(&material));
        let heat = Self {
            stretch: stretch.clone(),
            places: cloud.position.iter().enumerate().map(of).collect(),
            time: 0.0,
        };
        let heated = pass.heated().ok_or(SystemError::Expansion { law })?;
        heated.set_free_stretch(&heat.at(0.0));
        Ok(heat)
    }

    fn at(&self, t: f64) -> Vec<f64> {
        let places = self.places.iter();
        places.map(|(x, m)| (self.stretch.at)(x, *m, t)).collect()
    }

    /// Gives the pass that at the end of an interval.
    pub fn follow(&mut self, end: f64, pass: &mut dyn BondPass<D>) {
        if !self.stretch.varies_in_time || end == self.time {
            return;
        }
        self.time = end;
        if let Some(heated) = pass.heated() {
            heated.set_free_stretch(&self.at(end));
        }
    }
}

impl<const D: usize> CoupledSystem<'_, D> {
    /// Whether the bonds that are passed over know their temperature.
    pub fn is_heated(&self) -> bool {
        self.body.as_ref().is_some_and(|body| body.heat.is_some())
    }

    /// Rows of sites without the bonds that are passed over.
    pub(super) fn rows_beside_heated_bonds(&self, sites: &[u32]) -> BlockCsr {
        assembly::assemble_apart(sites.len(), self.mass.len(), |r, row: &mut Row<D>| {
            let site = sites[r] as usize;
            self.linear.add_row(site, row);
            if let Some(scale) = self.model.row_scale() {
                row.scale(scale[site]);
            }
        })
    }
}
