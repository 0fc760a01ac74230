//! The drag of [`ZeroEnergyControl::Drag`](crate::peridynamics::ZeroEnergyControl): a force against velocities that are not uniform over a family.
//!
//! Velocities are those of the interval, `(u − u₀)/Δt` from the displacement committed last; a force at once has those of the interval before.
//! Of a rigid or uniform motion over a step this is a field that is linear in the deformed positions, so that it is not resisted, however far it goes.

use super::{
    Kinematics,
    generic::Generic,
    point_loops::{Moments, RateMoments},
};
use crate::tensor::{Tensor, Vector, inverse};

/// The drag of a family: `T⟨ξ⟩ = ω s (Ẏ − L Y)` of its bonds.
pub(super) struct FamilyDrag<const D: usize> {
    /// s; zero where the bonds do not span the space.
    pub(super) strength: f64,
    /// What T has beside `s Ẏ`: a tensor of ξ, and one of η.
    pub(super) of_bond: Tensor<D>,
    pub(super) of_difference: Tensor<D>,
    /// `Σ T V`.
    pub(super) own: Vector<D>,
    /// What it takes per volume \[W/m^D\].
    pub(super) power: f64,
}

impl<const D: usize> Generic<D> {
    /// The drag of this strength, with `L = Σ w Ẏ ⊗ Y (Σ w Y ⊗ Y)⁻¹`; `bonds` is `Σ w ξ`.
    ///
    /// L is a least-squares fit, so that the power `s Σ w |Ẏ − L Y|²` is `s (Σ w |Ẏ|² − L : Σ w Ẏ ⊗ Y)`, which is zero at least.
    pub(super) fn drag_of(
        &self,
        moments: &Moments<D>,
        bonds: &Vector<D>,
        strength: f64,
    ) -> FamilyDrag<D> {
        let RateMoments {
            rate,
            shape,
            first,
            squares,
        } = &moments.rates;
        let mut drag = FamilyDrag {
            strength: 0.0,
            of_bond: Tensor::zeros(),
            of_difference: Tensor::zeros(),
            own: Vector::zeros(),
            power: 0.0,
        };
        let Some((inverse, _)) = inverse(shape) else {
            return drag;
        };
        let gradient = rate * inverse;
        drag.strength = strength;
        drag.of_bond = gradient * -strength;
        let deformed = match self.kinematics {
            Kinematics::Exact => {
                drag.of_difference = drag.of_bond;
                bonds + moments.first
            }
            Kinematics::Linear => *bonds,
        };
        drag.own = (first - gradient * deformed) * strength;
        drag.power = strength * (squares - gradient.dot(rate)).max(0.0);
        drag
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
