//! Control of zero-energy modes at a point that has a stress ([`ZeroEnergyControl`](crate::peridynamics::ZeroEnergyControl)), by the sums over its family.
//!
//! A drag is a force against velocities that are not uniform over a family. They are those of the interval, `(u − u₀)/Δt` from the displacement committed last; a force at once has those of the interval before.
//! Of a rigid or uniform motion over a step this is a field that is linear in the deformed positions, so that it is not resisted, however far it goes.

use super::{
    BondKinematics,
    generic::Generic,
    point_loops::{Moments, RateMoments, give},
};
use crate::tensor::{Tensor, Vector, inverse};

/// The control of a family, in `T⟨ξ⟩ = ω (B ξ + A ξ + C η + …)`, with B of the stress.
pub(super) struct FamilyControl<const D: usize> {
    /// That of a bond force, of bond lengths or of a drag; zero where there is none.
    pub(super) strength: f64,
    /// A.
    of_bond: Tensor<D>,
    /// C of a drag.
    of_difference: Option<Tensor<D>>,
    /// Factor of η, or with a drag of Ẏ.
    factor: f64,
    /// `Σ T V`.
    pub(super) own: Vector<D>,
    /// Power taken by a drag per volume \[W/m^D\].
    pub(super) power: f64,
}

impl<const D: usize> FamilyControl<D> {
    /// A control that is no sum over families, but one of pairs of points.
    pub(super) fn by_pairs(strength: f64) -> Self {
        Self {
            strength,
            of_bond: Tensor::zeros(),
            of_difference: None,
            factor: 0.0,
            own: Vector::zeros(),
            power: 0.0,
        }
    }

    /// `T⟨ξ⟩ = ω q (η − G ξ)`; `bonds` is `Σ w ξ`.
    pub(super) fn bond_force(
        moments: &Moments<D>,
        bonds: &Vector<D>,
        gradient: &Tensor<D>,
        strength: f64,
    ) -> Self {
        Self {
            of_bond: gradient * -strength,
            factor: strength,
            own: (moments.first - gradient * bonds) * strength,
            ..Self::by_pairs(strength)
        }
    }

    /// `T⟨ξ⟩ = ω s (Ẏ − L Y)` with `L = Σ w Ẏ ⊗ Y (Σ w Y ⊗ Y)⁻¹`; `bonds` is `Σ w ξ`. Without strength where deformed bonds do not span the space.
    ///
    /// L is a least-squares fit, so that the power `s Σ w |Ẏ − L Y|²` is `s (Σ w |Ẏ|² − L : Σ w Ẏ ⊗ Y)`, which is zero at least.
    pub(super) fn drag(
        moments: &Moments<D>,
        bonds: &Vector<D>,
        kinematics: BondKinematics,
        strength: f64,
    ) -> Self {
        let RateMoments {
            rate,
            shape,
            first,
            squares,
        } = &moments.rates;
        let none = Tensor::zeros();
        let Some((inverse, _)) = inverse(shape) else {
            return Self {
                of_difference: Some(none),
                ..Self::by_pairs(0.0)
            };
        };
        let gradient = rate * inverse;
        let of_bond = gradient * -strength;
        let (of_difference, deformed) = match kinematics {
            BondKinematics::Exact => (of_bond, bonds + moments.first),
            BondKinematics::Linear => (none, *bonds),
        };
        Self {
            strength,
            of_bond,
            of_difference: Some(of_difference),
            factor: strength,
            own: (first - gradient * deformed) * strength,
            power: strength * (squares - gradient.dot(rate)).max(0.0),
        }
    }

    /// Hands what bonds take from this point to its place, `through` for the stress.
    pub(super) fn give(&self, through: &Tensor<D>, place: &mut [f64]) {
        let of_bond = through + self.of_bond;
        give(place, &of_bond, self.of_difference.as_ref(), self.factor);
    }
}

impl<const D: usize> Generic<D> {
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
