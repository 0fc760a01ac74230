//! Ductile laws along paths of strain, against closed forms and a solver of differential equations that knows no return mapping.

use super::{Hardening, J2, LocalLaw, LogarithmicJ2};
use crate::tensor::Tensor;

const SHEAR: f64 = 8e4;
const LAMBDA: f64 = 1.2e5;
const YIELD: f64 = 250.0;
const MODULUS: f64 = 900.0;
const SATURATION: f64 = 120.0;
const RATE: f64 = 60.0;

const VOCE: Hardening = Hardening::Voce {
    yield_stress: YIELD,
    modulus: MODULUS,
    saturation: SATURATION,
    rate: RATE,
};

fn yield_stress(alpha: f64) -> f64 {
    YIELD + MODULUS * alpha + SATURATION * (1.0 - (-RATE * alpha).exp())
}

fn slope(alpha: f64) -> f64 {
    MODULUS + SATURATION * RATE * (-RATE * alpha).exp()
}

fn deviator(t: &Tensor<3>) -> Tensor<3> {
    t - Tensor::identity() * (t.trace() / 3.0)
}

/// Follows the corners of a path of gradients in `steps` equal steps to each; the last stress and the equivalent plastic strain.
fn follow<const D: usize>(
    law: &dyn LocalLaw<D>,
    corners: &[Tensor<D>],
    steps: usize,
) -> (Tensor<D>, f64) {
    let mut past = vec![0.0; law.history().len()];
    let (mut from, mut stress) = (Tensor::zeros(), Tensor::zeros());
    for to in corners {
        for k in 1..=steps {
            let gradient = from + (to - from) * (k as f64 / steps as f64);
            let mut present = past.clone();
            stress = law.respond(&gradient, 1.0, &past, &mut present).stress;
            past = present;
        }
        from = *to;
    }
    (stress, past[past.len() - 1])
}

/// Extrapolates values at steps of 1, ½ and ¼ of an error of first and then of second order; with the order that was observed.
fn extrapolated(values: [f64; 3]) -> (f64, f64) {
    let [a, b, c] = values;
    let once = [2.0 * b - a, 2.0 * c - b];
    let order = ((b - a) / (c - b)).abs().log2();
    ((4.0 * once[1] - once[0]) / 3.0, order)
}

/// The stress of strains that grow in proportion, `t E`, at the t at which the plastic strain is `alpha`: `K t tr E I + √(2/3) σ_y n` with `n = dev E/|dev E|`; and that t.
fn proportional(unit: &Tensor<3>, alpha: f64) -> (Tensor<3>, f64) {
    let dev = deviator(unit);
    let norm = dev.norm();
    let t = (yield_stress(alpha) + 3.0 * SHEAR * alpha) / (6f64.sqrt() * SHEAR * norm);
    let bulk = LAMBDA + 2.0 / 3.0 * SHEAR;
    let along = dev * ((2.0f64 / 3.0).sqrt() * yield_stress(alpha) / norm);
    (Tensor::identity() * (bulk * t * unit.trace()) + along, t)
}

#[test]
fn proportional_strains_have_their_closed_forms() {
    let flat = Tensor::<2>::new(1.0, 0.4, 0.4, -0.3);
    let mut unit = Tensor::<3>::zeros();
    unit.fixed_view_mut::<2, 2>(0, 0).copy_from(&flat);
    let solid = Tensor::<3>::new(1.0, 0.4, -0.2, 0.4, -0.3, 0.6, -0.2, 0.6, 0.1);
    for alpha in [1e-5, 1e-3, 0.05] {
        for steps in [1, 7] {
            let (expected, t) = proportional(&solid, alpha);
            let law = J2::<3>::with_hardening(LAMBDA, SHEAR, VOCE);
            let (stress, flowed) = follow(&law, &[solid * t], steps);
            assert!((stress - expected).amax() < 1e-8 * YIELD, "{stress}");
            assert!((flowed - alpha).abs() < 1e-8 * alpha.max(1e-3));

            let (expected, t) = proportional(&unit, alpha);
            let law = J2::<2>::with_hardening(LAMBDA, SHEAR, VOCE);
            let (stress, flowed) = follow(&law, &[flat * t], steps);
            let plane = expected.fixed_view::<2, 2>(0, 0).into_owned();
            assert!((stress - plane).amax() < 1e-8 * YIELD, "{stress}");
            assert!((flowed - alpha).abs() < 1e-8 * alpha.max(1e-3));
        }
        // logarithmic strains that grow in proportion without rotation: the same for the Kirchhoff stress
        let (expected, t) = proportional(&solid, alpha);
        let eigen = (solid * t).symmetric_eigen();
        let stretch = eigen.eigenvectors
            * Tensor::from_diagonal(&eigen.eigenvalues.map(f64::exp))
            * eigen.eigenvectors.transpose();
        let law = LogarithmicJ2::new(LAMBDA, SHEAR, VOCE);
        let (stress, flowed) = follow(&law, &[stretch - Tensor::identity()], 1);
        assert!((stress * stretch - expected).amax() < 1e-8 * YIELD);
        assert!((flowed - alpha).abs() < 1e-8 * alpha.max(1e-3));
    }
}

/// Steps of the Runge–Kutta method along each straight piece.
const FINE: usize = 20_000;

/// One step of the classical Runge–Kutta method for a tensor and a number.
fn runge_kutta(
    (x, alpha): (Tensor<3>, f64),
    h: f64,
    rate: impl Fn(&Tensor<3>, f64) -> (Tensor<3>, f64),
) -> (Tensor<3>, f64) {
    let a = rate(&x, alpha);
    let b = rate(&(x + a.0 * (0.5 * h)), alpha + 0.5 * h * a.1);
    let c = rate(&(x + b.0 * (0.5 * h)), alpha + 0.5 * h * b.1);
    let d = rate(&(x + c.0 * h), alpha + h * c.1);
    (
        x + (a.0 + (b.0 + c.0) * 2.0 + d.0) * (h / 6.0),
        alpha + h / 6.0 * (a.1 + 2.0 * (b.1 + c.1) + d.1),
    )
}

/// Stress deviator and plastic strain at the end of a path of straight pieces in small strains, from `ṡ = 2 μ (ė − √(3/2) α̇ n)` and `α̇ = √6 μ n:ė/(3 μ + σ_y′)` while it flows.
fn small_strains(corners: &[Tensor<3>]) -> (Tensor<3>, f64) {
    let (mut s, mut alpha, mut from) = (Tensor::<3>::zeros(), 0.0, Tensor::<3>::zeros());
    for to in corners {
        let rate = deviator(&(to - from));
        from = *to;
        // the elastic part of the piece: |s + 2 μ x ė| = √(2/3) σ_y
        let step = rate * (2.0 * SHEAR);
        let (a, b) = (step.norm_squared(), 2.0 * s.dot(&step));
        let c = s.norm_squared() - 2.0 / 3.0 * yield_stress(alpha).powi(2);
        let elastic = ((-b + (b * b - 4.0 * a * c).max(0.0).sqrt()) / (2.0 * a)).clamp(0.0, 1.0);
        s += step * elastic;
        let h = (1.0 - elastic) / FINE as f64;
        for _ in 0..FINE {
            (s, alpha) = runge_kutta((s, alpha), h, |s, alpha| {
                let n = s / s.norm();
                let flow = 6f64.sqrt() * SHEAR * n.dot(&rate) / (3.0 * SHEAR + slope(alpha));
                ((rate - n * (1.5f64.sqrt() * flow)) * (2.0 * SHEAR), flow)
            });
        }
    }
    (s, alpha)
}

#[test]
fn cyclic_and_broken_paths_are_those_of_the_differential_equation() {
    let shear = |g: f64| Tensor::<3>::new(0.0, 0.5 * g, 0.0, 0.5 * g, 0.0, 0.0, 0.0, 0.0, 0.0);
    let tension = |e: f64| Tensor::<3>::from_diagonal(&[e, -0.3 * e, -0.4 * e].into());
    // tension, then shear beside it; shear to and fro with tension held; back through the start
    let corners = [
        tension(0.006),
        tension(0.006) + shear(0.01),
        tension(0.004) + shear(-0.012),
        tension(-0.008) + shear(0.004),
    ];
    let (expected, alpha) = small_strains(&corners);
    let law = J2::<3>::with_hardening(LAMBDA, SHEAR, VOCE);
    let found = [4000, 8000, 16_000].map(|steps| follow(&law, &corners, steps));
    for (i, j) in [(0, 0), (0, 1), (1, 1)] {
        let (value, order) = extrapolated(found.map(|(stress, _)| deviator(&stress)[(i, j)]));
        let off = (value - expected[(i, j)]).abs() / YIELD;
        assert!(off < 1e-6, "{i}{j}: {off:e}, order {order}");
        assert!((order - 1.0).abs() < 0.1, "{i}{j}: order {order}");
    }
    let (value, order) = extrapolated(found.map(|(_, alpha)| alpha));
    assert!((value / alpha - 1.0).abs() < 1e-6, "{value} {alpha}");
    assert!((order - 1.0).abs() < 0.1, "order {order}");
}

/// Kirchhoff stress and plastic strain in simple shear to γ, from `ḃ_e = l b_e + b_e lᵀ − √6 α̇ n b_e` and `α̇ = √6 μ n:l/(3 μ + σ_y′)`, n the direction of dev ln b_e.
fn simple_shear(gamma: f64) -> (Tensor<3>, f64) {
    let logarithm = |b: &Tensor<3>| {
        let eigen = b.symmetric_eigen();
        let values = Tensor::from_diagonal(&eigen.eigenvalues.map(|x| 0.5 * x.ln()));
        eigen.eigenvectors * values * eigen.eigenvectors.transpose()
    };
    let sheared = |g: f64| {
        let f = Tensor::<3>::new(1.0, g, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        f * f.transpose()
    };
    let limit = YIELD / (6f64.sqrt() * SHEAR);
    let (mut low, mut high) = (0.0, gamma);
    for _ in 0..200 {
        let at = 0.5 * (low + high);
        match deviator(&logarithm(&sheared(at))).norm() > limit {
            true => high = at,
            false => low = at,
        }
    }
    let l = Tensor::<3>::new(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let (mut b, mut alpha) = (sheared(low), 0.0);
    let h = (gamma - low) / FINE as f64;
    for _ in 0..FINE {
        (b, alpha) = runge_kutta((b, alpha), h, |b, alpha| {
            let dev = deviator(&logarithm(b));
            let n = dev / dev.norm();
            let flow = 6f64.sqrt() * SHEAR * n.dot(&l) / (3.0 * SHEAR + slope(alpha));
            (
                l * b + b * l.transpose() - n * b * (6f64.sqrt() * flow),
                flow,
            )
        });
    }
    (deviator(&logarithm(&b)) * (2.0 * SHEAR), alpha)
}

#[test]
fn simple_shear_to_large_strains_is_that_of_the_differential_equation() {
    let gamma = 0.8;
    let (expected, alpha) = simple_shear(gamma);
    let mut gradient = Tensor::<3>::zeros();
    gradient[(0, 1)] = gamma;
    let deformation = Tensor::identity() + gradient;
    let law = LogarithmicJ2::new(LAMBDA, SHEAR, VOCE);
    let found = [1000, 2000, 4000].map(|steps| {
        let (stress, alpha) = follow(&law, &[gradient], steps);
        (deviator(&(stress * deformation.transpose())), alpha)
    });
    for (i, j) in [(0, 0), (0, 1), (1, 1)] {
        let (value, order) = extrapolated(found.map(|(stress, _)| stress[(i, j)]));
        let off = (value - expected[(i, j)]).abs() / YIELD;
        assert!(off < 1e-6, "{i}{j}: {off:e}, order {order}");
    }
    let (value, order) = extrapolated(found.map(|(_, alpha)| alpha));
    let off = (value / alpha - 1.0).abs();
    assert!(off < 1e-6, "{value} {alpha}, order {order}");
}
