//! Temperature in the generic pass: what is left of the stretch of a bond beyond the free expansion of its ends is what its law and its criterion see, and a change of temperature does work.
//!
//! A bond expands freely by the mean `s̄ = (α_i τ_i + α_j τ_j)/2` of its ends, which is exact along it where the temperature is linear. Its law has the extension `e − s̄ |ξ|`, and it breaks where `s − s̄` is beyond the critical stretch.
//! The energy W of the bonds then changes with the temperature too, `∂W/∂s̄ = −Σ T⟨ξ⟩·M |ξ| V V′`: summed by the trapezoidal rule as loads are, this is the work of heating, without which the energy would not balance.

use super::{HeatedBonds, bond_heat::Heat, generic::Generic};

impl<const D: usize> Generic<D> {
    /// Free stretch of a bond, if anything expands.
    pub(super) fn free_stretch(&self, i: usize, j: usize) -> Option<f64> {
        self.heat.as_ref().map(|heat| heat.between(i, j))
    }

    /// Ends a force: the first of all is where the sum of the work begins.
    pub(super) fn begin_heat(&mut self) {
        if let Some(heat) = self.heat.as_mut().filter(|heat| heat.begins) {
            heat.begins = false;
            heat.before.clone_from(&heat.free);
            heat.past.clone_from(&heat.present);
        }
    }

    /// Sums the work of heating up to the last force.
    pub(super) fn sum_heat(&mut self) {
        let Some(mut heat) = self.heat.take() else {
            return;
        };
        if heat.before != heat.free {
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
    fn set_free_stretch(&mut self, free: &[f64]) {
        let bonds = self.families.neighbours.len();
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
