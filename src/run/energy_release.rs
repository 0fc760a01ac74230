//! Energy release rate and stress intensity factors at the tip of a crack, by integrals over rings around it.
//!
//! A ring between the radii `a` and `b` has the weight function `q`, 1 within, 0 beyond, linear in the radius between. Then `∂q/∂x_j = −n_j/(b − a)` with the outward normal `n`, and the domain integral \[LiShihNeedleman1985\]
//!
//! ```text
//! J = ∫ (σ_ij ∂u_i/∂x₁ − W δ_1j) ∂q/∂x_j dA = 1/(b − a) ∫∫ (W n₁ − σ_ij n_j ∂u_i/∂x₁) r dθ dr
//! ```
//!
//! is the mean of Rice's contour integral over the radii of the ring. The axis x₁ is the direction of the crack, whose straight faces, free of traction, add nothing. The stress intensity factors follow from the same integral of two states \[SternBeckerDunham1976\], the second being Williams' field of a unit factor,
//!
//! ```text
//! K = E′/2 · 1/(b − a) ∫∫ (½ (σᵃ_ij ε_ij + σ_ij εᵃ_ij) n₁ − σ_ij n_j ∂uᵃ_i/∂x₁ − σᵃ_ij n_j ∂u_i/∂x₁) r dθ dr .
//! ```
//!
//! Gradients and stresses are those that outputs show at a place: of the element there, or of the points around that the crack does not cut. A ring may lie across a seam. Points within a horizon of a face have too few bonds and are softer or stiffer than the body: with their own stresses `J` is the energy that the
//! model releases. The mutual energy is the mean of two forms that are equal in a homogeneous body: what such a layer adds to either depends on the radius, and cancels in the mean for fields that fall off as Williams' do.

use crate::observe::tip_summary::{TipRing, TipSummary};
use crate::run::error::RunError;
use crate::run::solution::Solved;
use crate::run::solution_samples::SampledSolution;
use crate::scene::validated::{Output, Tip, TipDomains};
use crate::system::Ranks;
use crate::tensor::{Tensor, Vector, strain};

/// Places of the quadrature per spacing of the points, along a ring and across it: between places that carry strains these are linear.
const PER_SPACING: f64 = 2.0;

/// The fewest places along a ring: Williams' fields by the midpoint rule are exact to 1e-4.
const FEWEST: usize = 120;

/// Energy release rate and stress intensity factors at each tip, in the order in which the scene names them; none of a tip of which it asks for none, and none where a ring leaves the body. A tip is the end of its typed crack, or lies where `grown` tells. Collective where families are spread.
pub(super) fn of_tips<const D: usize>(
    solved: &Solved<'_, D>,
    output: &Output<D>,
    ranks: Option<&dyn Ranks>,
    grown: impl Fn(&Tip<D>) -> Option<Vector<D>>,
) -> Vec<Option<TipSummary>> {
    if output.tips.iter().all(|tip| tip.domains.is_none()) {
        return Vec::new();
    }
    let solution = SampledSolution::new(solved, ranks);
    let of_tip = |tip: &Tip<D>| {
        let domains = tip.domains.as_ref()?;
        let at = match grown(tip) {
            Some(place) => Frame {
                tip: place,
                along: tip.direction,
            },
            None => Frame {
                tip: domains.tip,
                along: domains.along,
            },
        };
        let rings = at.rings(domains, &solution, solved.model.spacing())?;
        let position = at.tip.iter().copied().collect();
        Some(TipSummary::new(tip.name.clone(), position, rings))
    };
    output.tips.iter().map(of_tip).collect()
}

/// Energy release rates and stress intensity factors of a static solution. Collective where families are spread.
///
/// # Errors
/// [`RunError::TipOutside`] for a ring that leaves the body.
pub(super) fn at_rest<const D: usize>(
    solved: &Solved<'_, D>,
    output: &Output<D>,
    ranks: Option<&dyn Ranks>,
) -> Result<Vec<TipSummary>, RunError> {
    let found = of_tips(solved, output, ranks, |_| None);
    let asked = output.tips.iter().zip(found);
    let asked = asked.filter(|(tip, _)| tip.domains.is_some());
    asked
        .map(|(tip, found)| {
            let tip = tip.name.clone();
            found.ok_or(RunError::TipOutside { tip })
        })
        .collect()
}

/// A tip with the axes of its crack: the first along it, the second to its left.
#[derive(Clone, Copy, Debug)]
struct Frame<const D: usize> {
    tip: Vector<D>,
    along: Vector<D>,
}

impl<const D: usize> Frame<D> {
    /// The integrals over all rings; none if one of them leaves the body. Collective where families are spread.
    fn rings(
        &self,
        domains: &TipDomains<D>,
        solution: &SampledSolution<'_, D>,
        spacing: f64,
    ) -> Option<Vec<TipRing>> {
        let of_ring = |ends: &[f64]| {
            let places = places([ends[0], ends[1]], spacing);
            let positions: Vec<Vector<D>> = places.iter().map(|p| self.position(p)).collect();
            let turned = |(gradient, stress)| State {
                gradient: self.turned(&gradient),
                stress: self.turned(&stress),
            };
            let states = solution.stressed(&positions).into_iter();
            let states: Vec<State> = states.map(|s| s.map(turned)).collect::<Option<_>>()?;
            Some(ring([ends[0], ends[1]], domains.lame, &places, &states))
        };
        // all rings are asked of all processes
        let rings: Vec<_> = domains.radii.windows(2).map(of_ring).collect();
        rings.into_iter().collect()
    }

    /// The axes in the plane, by columns.
    fn axes(&self) -> [[f64; 2]; 2] {
        let along = |k: usize| self.along.get(k).copied().unwrap_or(0.0);
        [[along(0), along(1)], [-along(1), along(0)]]
    }

    fn position(&self, place: &PolarPlace) -> Vector<D> {
        let [first, second] = self.axes();
        let (sin, cos) = place.angle.sin_cos();
        let arm = Vector::<D>::from_fn(|k, _| match k {
            0 | 1 => cos * first[k] + sin * second[k],
            _ => 0.0,
        });
        self.tip + arm * place.radius
    }

    /// A gradient or a stress in the axes of the crack.
    fn turned(&self, tensor: &Tensor<D>) -> Tensor<2> {
        let axes = self.axes();
        let plane = Tensor::<2>::from_fn(|i, j| tensor[(i, j)]);
        let turn = Tensor::<2>::from_fn(|i, k| axes[k][i]);
        turn.transpose() * plane * turn
    }
}

/// Displacement gradient and stress \[Pa\] at a place, in the axes of the crack.
struct State {
    gradient: Tensor<2>,
    stress: Tensor<2>,
}

/// A place of the quadrature over a ring; its weight is one of an area.
struct PolarPlace {
    radius: f64,
    angle: f64,
    weight: f64,
}

/// The midpoint rule over a ring, from the lower face of the crack to the upper one.
fn places([inner, outer]: [f64; 2], spacing: f64) -> Vec<PolarPlace> {
    use std::f64::consts::{PI, TAU};
    let count = |length: f64| (PER_SPACING * length / spacing.max(f64::MIN_POSITIVE)).ceil();
    let across = (count(outer - inner) as usize).clamp(4, 1000);
    let around = (count(PI * (inner + outer)) as usize).clamp(FEWEST, 10_000);
    let [dr, turn] = [(outer - inner) / across as f64, TAU / around as f64];
    let place = |k: usize| {
        let radius = inner + dr * ((k / around) as f64 + 0.5);
        PolarPlace {
            radius,
            angle: turn * ((k % around) as f64 + 0.5) - PI,
            weight: radius * dr * turn,
        }
    };
    (0..across * around).map(place).collect()
}

/// The integrals over a ring of states.
fn ring(
    radii: [f64; 2],
    (lambda, mu): (f64, f64),
    places: &[PolarPlace],
    states: &[State],
) -> TipRing {
    let width = radii[1] - radii[0];
    let (mut rate, mut factors) = (0.0, [0.0; 2]);
    for (place, State { gradient, stress }) in places.iter().zip(states) {
        let normal = Vector::<2>::new(place.angle.cos(), place.angle.sin());
        let (strain, along) = (strain(gradient), gradient.column(0));
        let (traction, weight) = (stress * normal, place.weight / width);
        rate += weight * (0.5 * stress.dot(&strain) * normal[0] - traction.dot(&along));
        for (factor, (of_unit, moved)) in factors.iter_mut().zip(williams(place, (lambda, mu))) {
            let spherical = lambda * of_unit.trace() / (2.0 * (lambda + mu));
            let strain_of_unit = (of_unit - Tensor::identity() * spherical) / (2.0 * mu);
            let mutual = 0.5 * (of_unit.dot(&strain) + stress.dot(&strain_of_unit)) * normal[0];
            *factor += weight * (mutual - traction.dot(&moved) - (of_unit * normal).dot(&along));
        }
    }
    // E′ of plane strain and, with its own λ, of plane stress
    let modulus = 4.0 * mu * (lambda + mu) / (lambda + 2.0 * mu);
    TipRing {
        radii,
        energy_release_rate: rate,
        stress_intensity: factors.map(|factor| 0.5 * modulus * factor),
    }
}

/// Stress and derivative of the displacement along the crack of the fields at a tip with `K_I = 1` and with `K_II = 1` \[Tada2000\].
fn williams(place: &PolarPlace, (lambda, mu): (f64, f64)) -> [(Tensor<2>, Vector<2>); 2] {
    let kappa = (lambda + 3.0 * mu) / (lambda + mu);
    let root = (std::f64::consts::TAU * place.radius).sqrt();
    let (s, c) = (0.5 * place.angle).sin_cos();
    let (s3, c3) = (1.5 * place.angle).sin_cos();
    let (sin, cos) = place.angle.sin_cos();
    let tensor = |xx: f64, yy: f64, xy: f64| Tensor::<2>::new(xx, xy, xy, yy) / root;
    // u = √(r/2π)/(2μ) f(θ), so ∂u/∂x₁ = (½ cos θ f − sin θ f′)/(2μ √(2πr))
    let moved = |f: [f64; 2], slope: [f64; 2]| {
        let of = |k: usize| (0.5 * cos * f[k] - sin * slope[k]) / (2.0 * mu * root);
        Vector::<2>::new(of(0), of(1))
    };
    let opening = (
        tensor(c * (1.0 - s * s3), c * (1.0 + s * s3), c * s * c3),
        moved(
            [c * (kappa - cos), s * (kappa - cos)],
            [
                -0.5 * s * (kappa - cos) + c * sin,
                0.5 * c * (kappa - cos) + s * sin,
            ],
        ),
    );
    let sliding = (
        tensor(-s * (2.0 + c * c3), s * c * c3, c * (1.0 - s * s3)),
        moved(
            [s * (kappa + 2.0 + cos), -c * (kappa - 2.0 + cos)],
            [
                0.5 * c * (kappa + 2.0 + cos) - s * sin,
                0.5 * s * (kappa - 2.0 + cos) + c * sin,
            ],
        ),
    );
    [opening, sliding]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The gradient of a unit field, by central differences of its displacement.
    fn gradient(place: &PolarPlace, (lambda, mu): (f64, f64), factors: [f64; 2]) -> Tensor<2> {
        let kappa = (lambda + 3.0 * mu) / (lambda + mu);
        let displacement = |x: Vector<2>| {
            let (r, angle) = (x.norm(), x[1].atan2(x[0]));
            let (s, c) = (0.5 * angle).sin_cos();
            let root = (r / std::f64::consts::TAU).sqrt() / (2.0 * mu);
            let cos = angle.cos();
            let one = Vector::<2>::new(c * (kappa - cos), s * (kappa - cos));
            let two = Vector::<2>::new(s * (kappa + 2.0 + cos), -c * (kappa - 2.0 + cos));
            (one * factors[0] + two * factors[1]) * root
        };
        let x = Vector::<2>::new(place.angle.cos(), place.angle.sin()) * place.radius;
        let d = 1e-5;
        let column = |k: usize| {
            let step = Vector::<2>::ith(k, d);
            (displacement(x + step) - displacement(x - step)) / (2.0 * d)
        };
        Tensor::from_columns(&[column(0), column(1)])
    }

    fn state(gradient: Tensor<2>, (lambda, mu): (f64, f64)) -> State {
        let strain = strain(&gradient);
        State {
            gradient,
            stress: Tensor::identity() * (lambda * strain.trace()) + strain * (2.0 * mu),
        }
    }

    #[test]
    fn the_fields_of_unit_factors_are_those_of_their_displacements() {
        let lame = (1.3, 0.7);
        for place in places([1.0, 1.5], 0.5) {
            let own = williams(&place, lame);
            for ((stress, moved), factors) in own.iter().zip([[1.0, 0.0], [0.0, 1.0]]) {
                let exact = state(gradient(&place, lame, factors), lame);
                assert!((stress - exact.stress).norm() < 1e-8);
                assert!((moved - exact.gradient.column(0)).norm() < 1e-8);
            }
        }
    }

    #[test]
    fn a_ring_in_the_field_of_a_tip_finds_both_factors_and_the_energy() {
        let lame = (1.3, 0.7);
        let modulus = 4.0 * 0.7 * 2.0 / (1.3 + 1.4);
        let places = places([1.0, 1.5], 0.1);
        let [k1, k2] = [0.8, -0.5];
        let states = places
            .iter()
            .map(|p| state(gradient(p, lame, [k1, k2]), lame));
        let states: Vec<State> = states.collect();
        let found = ring([1.0, 1.5], lame, &places, &states);
        let [one, two] = found.stress_intensity;
        assert!(
            (one - k1).abs() < 3e-4 && (two - k2).abs() < 3e-4,
            "{found:?}"
        );
        let rate = (k1 * k1 + k2 * k2) / modulus;
        assert!(
            (found.energy_release_rate / rate - 1.0).abs() < 3e-4,
            "{found:?}"
        );
    }

    #[test]
    fn a_uniform_strain_has_no_tip() {
        let places = places([1.0, 1.5], 0.1);
        let gradient = Tensor::<2>::new(0.3, -0.2, 0.5, 0.7);
        let states = places.iter().map(|_| state(gradient, (1.3, 0.7)));
        let states: Vec<State> = states.collect();
        let found = ring([1.0, 1.5], (1.3, 0.7), &places, &states);
        assert!(found.energy_release_rate.abs() < 1e-12, "{found:?}");
    }
}
