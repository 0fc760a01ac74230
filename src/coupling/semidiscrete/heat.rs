//! Bonds that know their temperature: all but those that break or bend are linear, and expand by their rows.

use std::sync::Arc;

use super::{CoupledSystem, behaviour::SystemError};
use crate::{
    assembly::{self, Row},
    peridynamics::{PdBody, bond_force::BondPass},
    system::{BlockCsr, FailureUpdate, Interval, SemiDiscrete},
    tensor::Vector,
};

/// Part of a change of temperature over which forces are differenced.
const PART: f64 = 1e-3;

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
    /// Whether the pass has it of a time of its own, and keeps it.
    is_held: bool,
    /// Whether it has had one.
    is_stale: bool,
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
            is_held: false,
            is_stale: false,
        };
        let heated = pass.heated().ok_or(SystemError::Expansion { law })?;
        heated.set_free_stretch(&heat.at(0.0));
        Ok(heat)
    }

    fn at(&self, t: f64) -> Vec<f64> {
        let places = self.places.iter();
        places.map(|(x, m)| (self.stretch.at)(x, *m, t)).collect()
    }

    /// Gives the pass that at a time (none: nothing), and `part` of the change until another; the next force asks anew.
    fn set_between(
        &mut self,
        (from, to, part): (Option<f64>, f64, f64),
        pass: &mut dyn BondPass<D>,
    ) {
        let to = self.at(to);
        let from = from.map_or_else(|| vec![0.0; to.len()], |t| self.at(t));
        let free: Vec<f64> = (from.iter().zip(&to))
            .map(|(from, to)| from + part * (to - from))
            .collect();
        if let Some(heated) = pass.heated() {
            heated.set_free_stretch(&free);
        }
        self.is_held = true;
    }

    /// Gives the pass that at the end of an interval.
    pub fn follow(&mut self, end: f64, pass: &mut dyn BondPass<D>) {
        let is_there = !self.stretch.varies_in_time || end == self.time;
        if self.is_held || (is_there && !self.is_stale) {
            return;
        }
        self.is_stale = false;
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

    /// See [`crate::system::SemiDiscrete::force_of_heating_into`].
    pub(super) fn extrapolate_heating(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        from: Option<f64>,
        to: f64,
    ) -> bool {
        if !self.is_heated() {
            return false;
        }
        let at_once = Interval {
            end: to,
            length: 0.0,
        };
        let mut further = vec![0.0; force.len()];
        for (part, force) in [(0.0, &mut *force), (PART, &mut further[..])] {
            if let Some(body) = &mut self.body
                && let Some(heat) = &mut body.heat
            {
                heat.set_between((from, to, part), body.pass.as_mut());
            }
            self.internal_force_into(u, force, at_once, FailureUpdate::Frozen);
        }
        if let Some(heat) = self.body.as_mut().and_then(|body| body.heat.as_mut()) {
            (heat.is_held, heat.is_stale) = (false, true);
        }
        for (force, further) in force.iter_mut().zip(further) {
            *force += (further - *force) / PART;
        }
        true
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
