//! Thermal expansion of bonds that break or rotate; all other bonds are linear, and expand by their rows.

use super::behaviour::{FreeStretch, SystemError};
use crate::{
    peridynamics::{PdBody, bond_force::BondPass},
    tensor::Vector,
};

/// The free stretch of all points of a body.
pub(super) struct PointHeat<const D: usize> {
    stretch: FreeStretch<D>,
    places: Vec<(Vector<D>, u16)>,
    /// Time of the free stretch that the pass has.
    time: f64,
    /// True while the pass keeps a free stretch that was set for another time.
    pub is_held: bool,
    /// True if the pass has had such a stretch, and needs that of its own time again.
    pub is_stale: bool,
}

impl<const D: usize> PointHeat<D> {
    /// As [`PointHeat::new`], where anything expands.
    ///
    /// # Errors
    /// As [`PointHeat::new`].
    pub fn of(
        stretch: Option<&FreeStretch<D>>,
        body: &PdBody<D>,
        (material, law): (u16, &'static str),
        pass: &mut dyn BondPass<D>,
    ) -> Result<Option<Self>, SystemError> {
        let of = |stretch| Self::new(stretch, body, material, law, pass);
        stretch.map(of).transpose()
    }

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
        let (free, solid) = heat.at(0.0);
        heated.set_free_stretch(&free, &solid);
        Ok(heat)
    }

    /// The free stretch of points, and of the solids that they are made of.
    fn at(&self, t: f64) -> (Vec<f64>, Vec<f64>) {
        let of = |(x, m): &(Vector<D>, u16)| {
            let free = (self.stretch.at)(x, *m, t);
            (free, free * self.stretch.solid[usize::from(*m)])
        };
        self.places.iter().map(of).unzip()
    }

    /// Gives the pass that at a time (none: nothing), and `part` of the change until another; the next force asks anew.
    pub fn set_between(
        &mut self,
        (from, to, part): (Option<f64>, f64, f64),
        pass: &mut dyn BondPass<D>,
    ) {
        let to = self.at(to);
        let nothing = || (vec![0.0; to.0.len()], vec![0.0; to.0.len()]);
        let from = from.map_or_else(nothing, |t| self.at(t));
        let between = |from: &[f64], to: &[f64]| -> Vec<f64> {
            let both = from.iter().zip(to);
            both.map(|(from, to)| from + part * (to - from)).collect()
        };
        if let Some(heated) = pass.heated() {
            heated.set_free_stretch(&between(&from.0, &to.0), &between(&from.1, &to.1));
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
            let (free, solid) = self.at(end);
            heated.set_free_stretch(&free, &solid);
        }
    }
}
