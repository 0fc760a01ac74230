//! Temperature in the generic pass. A local law that expands ([`LocalHistory::free_stretch`](crate::material::LocalHistory::free_stretch)) is given the free stretch of its point, and sums the work of heating itself. Of all others, what is left of the stretch of a bond beyond the free expansion of its ends is what its law and its criterion see, and a change of temperature does work.
//!
//! A bond expands freely by the mean `s̄ = (α_i τ_i + α_j τ_j)/2` of its ends, which is exact along it where the temperature is linear. Its law has the extension `e − s̄ |ξ|`, and it breaks where `s − s̄` is beyond the critical stretch.
//! The energy W of the bonds then changes with the temperature too, `∂W/∂s̄ = −Σ T⟨ξ⟩·M |ξ| V V′`: summed by the trapezoidal rule as loads are, this is the work of heating, without which the energy would not balance.

use super::{HeatedBonds, bond_heat::Heat, generic::Generic};
use crate::material::{begin_heating, heat_work};

impl<const D: usize> Generic<D> {
    /// Free stretch of a bond, if anything expands.
    pub(super) fn free_stretch(&self, i: usize, j: usize) -> Option<f64> {
        self.heat.as_ref().map(|heat| heat.between(i, j))
    }

    /// The same where a law sees what is left of it.
    pub(super) fn taken_stretch(&self, i: usize, j: usize) -> Option<f64> {
        self.free_stretch(i, j)
            .filter(|_| self.stretch_place().is_none())
    }

    /// Place of the free stretch of the local law among the numbers of a point.
    fn stretch_place(&self) -> Option<usize> {
        let law = self.law.force_state()?.correspondence(None)?.law;
        law.history().free_stretch
    }

    /// Ends a force: the first of all is where the sum of the work begins.
    pub(super) fn begin_heat(&mut self) {
        let place = self.stretch_place();
        let Some(heat) = self.heat.as_mut().filter(|heat| heat.begins) else {
            return;
        };
        heat.begins = false;
        heat.before.clone_from(&heat.free);
        heat.past.clone_from(&heat.present);
        if let Some(place) = place {
            let each = self.layout.point.len();
            let past = self.past.point.chunks_exact_mut(each);
            for (past, present) in past.zip(self.present.point.chunks_exact(each)) {
                begin_heating(past, present, place);
            }
        }
    }

    /// Takes up the work of heating that the local laws of points have found in the interval that ends.
    pub(super) fn sum_heat_of_points(&mut self) {
        let Some(place) = self.stretch_place() else {
            return;
        };
        let each = self.layout.point.len();
        let past = self.past.point.chunks_exact(each);
        let all = past.zip(self.present.point.chunks_exact(each)).enumerate();
        let work: f64 = all
            .filter(|(i, _)| self.row[*i])
            .map(|(i, (past, present))| {
                let left = match &self.points {
                    Some(points) => 1.0 - points.intact[i].damage,
                    None => 1.0,
                };
                left * self.volume[i] * (heat_work(present, place) - heat_work(past, place))
            })
            .sum();
        if let Some(heat) = &mut self.heat {
            heat.work += work;
        }
    }

    /// Sums the work of heating up to the last force.
    pub(super) fn sum_heat(&mut self) {
        let Some(mut heat) = self.heat.take() else {
            return;
        };
        if heat.before != heat.free && self.stretch_place().is_none() {
            let rise = |i: usize| heat.free[i] - heat.before[i];
            for i in (0..self.position.len()).filter(|&i| self.row[i]) {
                for bond in self.range(i) {
                    let mean = 0.5 * (rise(i) + rise(self.neighbour(bond)));
                    heat.work -= 0.5 * (heat.past[bond] + heat.present[bond]) * mean;
                }
            }
            heat.before.clone_from(&heat.free);
        }
        heat.past.clone_from(&heat.present);
        self.heat = Some(heat);
    }
}

impl<const D: usize> HeatedBonds for Generic<D> {
    fn set_free_stretch(&mut self, free: &[f64], solid: &[f64]) {
        if let Some(place) = self.stretch_place() {
            let points = self.past.point.chunks_exact_mut(self.layout.point.len());
            points.zip(solid).for_each(|(point, s)| point[place] = *s);
        }
        // points that have a stress have no force per bond
        let bonds = self.force_state.len();
        match &mut self.heat {
            Some(heat) => heat.free.copy_from_slice(free),
            None => self.heat = Some(Heat::new(free, bonds)),
        }
    }

    fn take_heat_work(&mut self) -> f64 {
        let heat = self.heat.as_mut();
        heat.map_or(0.0, |heat| std::mem::take(&mut heat.work))
    }
}
