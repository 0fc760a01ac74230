//! The drag of [`ZeroEnergyControl::Drag`](crate::peridynamics::ZeroEnergyControl): a force against velocities that are not uniform over a family.
//!
//! Velocities are those of the interval, `(u − u₀)/Δt` from the displacement committed last; a force at once has those of the interval before.
//! Of a rigid or uniform motion over a step this is a field that is linear in the deformed positions, so that it is not resisted, however far it goes.

use rayon::prelude::*;

use super::{Kinematics, generic::Generic, point_state::PointForces};
use crate::{
    system::Interval,
    tensor::{Tensor, Vector, inverse},
};

impl<const D: usize> Generic<D> {
    /// Adds the drag to the forces of points with rows, and what it dissipates to what they did.
    pub(super) fn add_drag(
        &mut self,
        points: &mut PointForces<D>,
        u: &[f64],
        interval: Interval,
        force: &mut [f64],
    ) {
        let Some(mut drag) = points.drag.take() else {
            return;
        };
        drag.present.copy_from_slice(u);
        match interval.length > 0.0 {
            true => {
                let moved = u.iter().zip(&drag.before);
                for (v, (now, before)) in drag.present_velocity.iter_mut().zip(moved) {
                    *v = (now - before) / interval.length;
                }
            }
            false => drag.present_velocity.clone_from(&drag.velocity),
        }
        let v = &drag.present_velocity;
        let of_point = |i: usize| self.velocity_gradient(points, i, u, v);
        let rates = drag.rate.par_iter_mut().with_min_len(64).enumerate();
        rates.for_each(|(i, rate)| *rate = of_point(i));
        let mut outcome = std::mem::take(&mut self.outcome);
        let rows = force.par_chunks_exact_mut(D).zip(&mut outcome);
        rows.with_min_len(64)
            .enumerate()
            .for_each(|(i, (force, outcome))| {
                let (sum, power) = self.drag_of(points, &drag.rate, i, u, v);
                outcome.dissipated += power * interval.length;
                if self.row[i] {
                    for (force, sum) in force.iter_mut().zip(sum.iter()) {
                        *force -= self.volume[i] * sum;
                    }
                }
            });
        self.outcome = outcome;
        points.drag = Some(drag);
    }

    /// Y of a bond.
    fn deformed(&self, xi: &[f64; D], eta: &[f64; D]) -> Vector<D> {
        match self.kinematics {
            Kinematics::Exact => Vector::from(*xi) + Vector::from(*eta),
            Kinematics::Linear => Vector::from(*xi),
        }
    }

    /// `L = Σ w Ẏ ⊗ Y (Σ w Y ⊗ Y)⁻¹` and the strength of the drag of a family.
    fn velocity_gradient(
        &self,
        points: &PointForces<D>,
        i: usize,
        u: &[f64],
        v: &[f64],
    ) -> (Tensor<D>, f64) {
        let (mut rate, mut shape) = (Tensor::<D>::zeros(), Tensor::<D>::zeros());
        self.each_bond(i, &points.weight, u, |j, w, xi, eta| {
            let y = self.deformed(xi, eta);
            let along = y.transpose() * w;
            rate += difference(v, i, j) * along;
            shape += y * along;
        });
        match inverse(&shape) {
            Some((inverse, _)) => (rate * inverse, points.strength(i)),
            None => (Tensor::zeros(), 0.0),
        }
    }

    /// `Σ V_j (T_i⟨ξ⟩ − T_j⟨−ξ⟩)` of the drag, and the power that its own family takes \[W\].
    fn drag_of(
        &self,
        points: &PointForces<D>,
        rates: &[(Tensor<D>, f64)],
        i: usize,
        u: &[f64],
        v: &[f64],
    ) -> (Vector<D>, f64) {
        let (mut sum, mut power) = (Vector::zeros(), 0.0);
        let (own, strength) = &rates[i];
        let back = points.back();
        let mut bond = self.range(i).start;
        self.each_bond(i, &points.weight, u, |j, w, xi, eta| {
            let (y, rate) = (self.deformed(xi, eta), difference(v, i, j));
            let beyond = rate - own * y;
            sum += beyond * (w * strength);
            power += w * strength * beyond.norm_squared();
            let (far, strength) = &rates[j];
            sum += (rate - far * y) * (back[bond] * strength);
            bond += 1;
        });
        (sum, power * self.volume[i])
    }

    /// An upper bound on the eigenvalues of `M⁻¹ C` of the drag `C v` \[1/s\], with the mass of each point.
    ///
    /// `Σ c ω |Ẏ − L Y|² V` is no more than with L = 0, and `|a − b|² ≤ 2 |a|² + 2 |b|²`.
    pub(super) fn rate_of_drag(&self, mass: &dyn Fn(usize) -> f64) -> f64 {
        let Some(points) = self.points.as_ref().filter(|p| p.drag.is_some()) else {
            return 0.0;
        };
        let strength = |i: usize| self.state[i].as_ref().map_or(0.0, |s| s.control);
        let of_point = |i: usize| {
            let start = self.range(i).start;
            let family = self.families.of(i).iter().enumerate();
            let sum = family.map(|(k, &j)| {
                points.weight[start + k] * strength(i)
                    + points.back()[start + k] * strength(j as usize)
            });
            2.0 * self.volume[i] * sum.sum::<f64>() / mass(i)
        };
        let rows = (0..self.position.len()).filter(|&i| self.row[i]);
        rows.map(of_point).fold(0.0, f64::max)
    }
}

/// The difference of two points' velocities.
fn difference<const D: usize>(v: &[f64], i: usize, j: usize) -> Vector<D> {
    Vector::from_fn(|a, _| v[j * D + a] - v[i * D + a])
}
