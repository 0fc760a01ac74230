//! Algorithmic tangents of every law along paths that load, flow, unload and turn, beside central differences of its stress.

use super::tests::laws;
use super::{Banded, Hardening, JohnsonCook, Kinematics, LocalLaw, LogarithmicJ2, Reduced};
use crate::tensor::{Tensor, Tensor4};
use std::sync::Arc;

/// A path of gradients: out to where all laws of the table flow, partly back, out in another direction, and far back.
fn path<const D: usize>() -> Vec<Tensor<D>> {
    let direction = |turn: f64| {
        Tensor::<D>::from_fn(|i, j| {
            let diagonal = if i == j { 0.6 - 0.5 * i as f64 } else { 0.0 };
            diagonal + 0.35 * ((3 * i + 5 * j + 1) as f64 + turn).cos()
        })
    };
    let (a, b) = (direction(0.0), direction(1.7));
    let mut corners = vec![Tensor::zeros(), a * 0.35, a * 0.29, a * 0.2 + b * 0.25];
    corners.push(b * -0.2);
    let mut path = Vec::new();
    for pair in corners.windows(2) {
        path.extend((1..=5).map(|k| pair[0] + (pair[1] - pair[0]) * (f64::from(k) / 5.0)));
    }
    path
}

/// Largest difference between a tangent and central differences of the stress, over the tangent at rest.
fn off<const D: usize>(
    law: &dyn LocalLaw<D>,
    gradient: &Tensor<D>,
    step: f64,
    past: &[f64],
) -> f64 {
    let stress = |g: &Tensor<D>| law.respond(g, step, past, &mut past.to_vec()).stress;
    let tangent = law.algorithmic_tangent(gradient, step, past);
    let by = 1e-6;
    let mut largest = 0.0f64;
    for (k, l) in (0..D).flat_map(|k| (0..D).map(move |l| (k, l))) {
        let mut e = Tensor::<D>::zeros();
        e[(k, l)] = by;
        let slope = (stress(&(gradient + e)) - stress(&(gradient - e))) / (2.0 * by);
        for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
            let found = tangent.get(i, j, k, l);
            largest = largest.max((found - slope[(i, j)]).abs());
            assert!(found.is_finite());
        }
    }
    largest / law.tangent().amax()
}

fn asymmetry<const D: usize>(tangent: &Tensor4<D>) -> f64 {
    let mut largest = 0.0f64;
    for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
        for (k, l) in (0..D).flat_map(|k| (0..D).map(move |l| (k, l))) {
            largest = largest.max((tangent.get(i, j, k, l) - tangent.get(k, l, i, j)).abs());
        }
    }
    largest / tangent.amax()
}

/// Follows the path and compares at each of its points; says how many of the points flowed, and how many did not after the first that did.
fn follow<const D: usize>(name: &str, law: &dyn LocalLaw<D>, step: f64) -> [usize; 2] {
    let mut past = vec![0.0; law.history().len()];
    let mut counts = [0; 2];
    // beside it only what has no name is remembered
    let plastic = law
        .history()
        .names
        .iter()
        .rposition(|name| !name.is_empty());
    for (number, gradient) in path::<D>().iter().enumerate() {
        let distance = off(law, gradient, step, &past);
        assert!(distance < 1e-6, "{name}, point {number}: {distance:e}");
        let skew = asymmetry(&law.algorithmic_tangent(gradient, step, &past));
        assert!(
            skew < 1e-9 || !law.has_symmetric_tangent(),
            "{name}, point {number}: not symmetric, {skew:e}"
        );
        let mut present = past.clone();
        law.respond(gradient, step, &past, &mut present);
        if let Some((is, was)) = plastic.map(|k| (present[k], past[k])) {
            match is > was {
                true => counts[0] += 1,
                false if was > 0.0 => counts[1] += 1,
                false => {}
            }
        }
        past = present;
    }
    counts
}

fn every_law<const D: usize>(kinematics: &[Kinematics]) {
    for (name, law) in laws::<D>(kinematics) {
        let [flowed, unloaded] = follow(&name, law.as_ref(), 1.0);
        let remembers = law.history().names.contains(&"equivalent plastic strain");
        assert!(
            !remembers || (flowed > 2 && unloaded > 0),
            "{name}: {flowed} points flow, {unloaded} unload"
        );
    }
}

#[test]
fn every_law_has_its_algorithmic_tangent() {
    every_law::<1>(&[Kinematics::Bar]);
    every_law::<2>(&[Kinematics::PlaneStress, Kinematics::PlaneStrain]);
    every_law::<3>(&[Kinematics::Solid]);
}

#[test]
fn hardening_that_saturates_or_depends_on_the_rate_has_its_slope() {
    let (lambda, shear) = (4e10, 3e10);
    let voce = Hardening::Voce {
        yield_stress: 5e9,
        modulus: 1e9,
        saturation: 2e9,
        rate: 8.0,
    };
    let johnson_cook = Hardening::JohnsonCook(JohnsonCook {
        yield_stress: 4e9,
        modulus: 5e9,
        exponent: 0.4,
        rate_coefficient: 0.05,
        reference_rate: 1.0,
        softening: 0.9,
    });
    for (name, hardening) in [("Voce", voce), ("Johnson–Cook", johnson_cook)] {
        let solid: Arc<dyn LocalLaw<3>> = Arc::new(LogarithmicJ2::new(lambda, shear, hardening));
        let small: Arc<dyn LocalLaw<3>> =
            Arc::new(super::J2::<3>::with_hardening(lambda, shear, hardening));
        for law in [solid, small] {
            // faster and slower than the reference rate
            for step in [1e-3, 1e3] {
                assert!(follow::<3>(name, law.as_ref(), step)[0] > 5, "{name}");
                let plate = Reduced::<2>::new(Arc::clone(&law), Kinematics::PlaneStress);
                assert!(follow::<2>(name, &plate, step)[0] > 5, "{name}");
                let bar = Reduced::<1>::new(Arc::clone(&law), Kinematics::Bar);
                assert!(follow::<1>(name, &bar, step)[0] > 5, "{name}");
            }
        }
    }
}

#[test]
fn differences_serve_a_law_without_a_closed_form() {
    /// Neo-Hooke without its tangent.
    #[derive(Debug)]
    struct Plain(super::NeoHooke);
    impl LocalLaw<3> for Plain {
        fn tangent(&self) -> &Tensor4<3> {
            self.0.tangent()
        }
        fn is_linear(&self) -> bool {
            false
        }
        fn is_objective(&self) -> bool {
            true
        }
        fn history(&self) -> super::LocalHistory {
            super::LocalHistory::NONE
        }
        fn flows_at_constant_volume(&self) -> bool {
            false
        }
        fn in_band(&self, _width: f64) -> Option<Banded<3>> {
            None
        }

        fn respond(
            &self,
            gradient: &Tensor<3>,
            step: f64,
            past: &[f64],
            present: &mut [f64],
        ) -> super::LocalResponse<3> {
            self.0.respond(gradient, step, past, present)
        }
    }
    let exact = super::NeoHooke::new(2.0, 1.0);
    let plain = Plain(exact.clone());
    for gradient in path::<3>() {
        let mut difference = exact.algorithmic_tangent(&gradient, 0.0, &[]);
        difference.add_scaled(-1.0, &plain.algorithmic_tangent(&gradient, 0.0, &[]));
        assert!(difference.amax() < 1e-7, "{}", difference.amax());
    }
}
