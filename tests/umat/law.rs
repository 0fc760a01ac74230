//! The law itself: increments one after another.

use std::path::Path;

use bondline::material::{
    J2, LocalLaw, LocalResponse, RoutineError, UmatEnergies, UmatSettings, differenced_tangent,
};
use bondline::tensor::{Tensor, Tensor4, inverse};
use bondline_umat::{Routine, Umat};

use crate::{in_c, j2};

const YOUNG: f64 = 1000.0;
const POISSON: f64 = 0.3;
const YIELD: f64 = 5.0;
const MODULUS: f64 = 250.0;

fn lame() -> (f64, f64) {
    let shear = YOUNG / (2.0 * (1.0 + POISSON));
    (2.0 * shear * POISSON / (1.0 - 2.0 * POISSON), shear)
}

fn settings(is_large: bool, yield_stress: f64) -> UmatSettings {
    UmatSettings {
        name: "steel".to_owned(),
        constants: vec![YOUNG, POISSON, yield_stress, MODULUS],
        states: 1,
        lame: lame(),
        is_large,
        is_thread_safe: false,
        temperature: 293.0,
        length: f64::NAN,
        energies: UmatEnergies::Stress,
        has_tangent: false,
        flows_at_constant_volume: true,
    }
}

fn umat(library: &Path, is_large: bool, yield_stress: f64) -> Umat {
    let routine = Routine::load(library, None).unwrap();
    Umat::new(routine, settings(is_large, yield_stress))
}

/// Responses along a path of gradients, each step with what the last remembered, and that of the end.
fn along(
    law: &dyn LocalLaw<3>,
    path: impl Iterator<Item = Tensor<3>>,
) -> (Vec<LocalResponse<3>>, Vec<f64>) {
    let mut past = vec![0.0; law.history().len()];
    let mut present = past.clone();
    let responses = path.map(|g| {
        let found = law.respond(&g, 0.1, &past, &mut present);
        past.copy_from_slice(&present);
        found
    });
    (responses.collect(), past.clone())
}

/// A path that turns in the space of strains, beyond yield and back.
fn winding(steps: usize) -> impl Iterator<Item = Tensor<3>> {
    (1..=steps).map(|k| {
        let t = k as f64 * 0.05;
        Tensor::from_fn(|i, j| {
            0.01 * (t * (1.0 + i as f64 * 0.7 + j as f64 * 0.3) + (i * j) as f64).sin()
        })
    })
}

#[test]
fn small_strains_are_those_of_our_own_law() {
    let folder = tempfile::tempdir().unwrap();
    let own = J2::<3>::new(lame().0, lame().1, YIELD, MODULUS);
    let (expected, remembered) = along(&own, winding(200));
    assert!(remembered[6] > 0.05, "it flows: {}", remembered[6]);
    for library in j2(folder.path()) {
        let (found, history) = along(&umat(&library, false, YIELD), winding(200));
        for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let off = (found.stress - expected.stress).amax() / expected.stress.amax();
            assert!(off < 1e-10, "{} {k}: {off:e}", library.display());
        }
        assert!((history[27] - remembered[6]).abs() < 1e-12);
        assert_eq!(history[26], 200.0);
        assert!((history[25] - 20.0).abs() < 1e-12);
    }
}

#[test]
fn ddsdde_is_the_tangent_where_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let own = J2::<3>::new(lame().0, lame().1, YIELD, MODULUS);
    let scale = own.tangent().amax();
    let distance = |a: &Tensor4<3>, b: &Tensor4<3>| {
        let mut off = *a;
        off.add_scaled(-1.0, b);
        off.amax() / scale
    };
    for library in j2(folder.path()) {
        let law = |is_large: bool| {
            let settings = UmatSettings {
                has_tangent: true,
                ..settings(is_large, YIELD)
            };
            Umat::new(Routine::load(&library, None).unwrap(), settings)
        };
        // small strains: that of our own law, which has a closed form
        let small = law(false);
        let (mut past, mut ours) = (vec![0.0; small.history().len()], vec![0.0; 7]);
        let (mut next, mut our_next) = (past.clone(), ours.clone());
        for gradient in winding(200) {
            let found = small.algorithmic_tangent(&gradient, 0.1, &past);
            let off = distance(&found, &own.algorithmic_tangent(&gradient, 0.1, &ours));
            assert!(off < 1e-10, "{}: {off:e}", library.display());
            small.respond(&gradient, 0.1, &past, &mut next);
            own.respond(&gradient, 0.1, &ours, &mut our_next);
            past.copy_from_slice(&next);
            ours.copy_from_slice(&our_next);
        }
        assert!(ours[6] > 0.05, "it flows: {}", ours[6]);
        // large ones: differences but for what the length of the step leaves
        let large = law(true);
        let stretched = |t: f64| {
            let pulled =
                Tensor::<3>::from_row_slice(&[1.0 + t, t, 0.0, 0.0, 1.0, 0.3 * t, 0.0, 0.0, 1.0]);
            turn(2.0 * t) * pulled - Tensor::identity()
        };
        let worst = |steps: usize| {
            let mut past = vec![0.0; large.history().len()];
            let mut next = past.clone();
            let mut worst: f64 = 0.0;
            for k in 1..=steps {
                let gradient = stretched(0.3 * k as f64 / steps as f64);
                let found = large.algorithmic_tangent(&gradient, 0.1, &past);
                let differenced = differenced_tangent(&large, &gradient, 0.1, &past);
                let stress = large.respond(&gradient, 0.1, &past, &mut next).stress;
                // the routine's is the slope of σ; that of the convention, of J σ over J, has σ ⊗ I more
                let (reverse, _) = inverse(&(Tensor::identity() + gradient)).unwrap();
                let whole = Tensor4::from_fn(|i, j, k, l| {
                    found.get(i, j, k, l) + stress[(i, j)] * reverse[(l, k)]
                });
                worst = worst.max(distance(&whole, &differenced));
                past.copy_from_slice(&next);
            }
            worst
        };
        let (coarse, fine) = (worst(100), worst(200));
        assert!(
            fine < 0.02 && (1.7..2.3).contains(&(coarse / fine)),
            "{coarse:e} {fine:e}"
        );
    }
}

#[test]
fn energies_follow_from_the_stress() {
    let folder = tempfile::tempdir().unwrap();
    let law = umat(&in_c(folder.path(), "j2.c"), false, YIELD);
    let pulled = |e: f64| Tensor::<3>::from_diagonal(&[e, -0.5 * e, -0.5 * e].into());
    // isochoric: q = 3 G (e − p), f = 0 gives p; stored is q²/(6 G), dissipated is the rest of ∫ q de
    let g = lame().1;
    let (found, _) = along(&law, (1..=100).map(|k| pulled(2e-4 * k as f64)));
    let p = (3.0 * g * 0.02 - YIELD) / (3.0 * g + MODULUS);
    let q = YIELD + MODULUS * p;
    let stored = q * q / (6.0 * g);
    let gone: f64 = found.iter().map(|r| r.dissipated).sum();
    assert!((found[99].stored - stored).abs() < 1e-12 * stored);
    let expected = YIELD * p + 0.5 * MODULUS * p * p;
    // the increment in which flow begins is worked by the trapezoidal rule
    assert!(
        (gone - expected).abs() < 1e-4 * expected,
        "{gone} {expected}"
    );
}

/// Rotation about z.
fn turn(angle: f64) -> Tensor<3> {
    let (s, c) = angle.sin_cos();
    Tensor::from_row_slice(&[c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0])
}

#[test]
fn a_rotation_turns_the_stress() {
    let folder = tempfile::tempdir().unwrap();
    let law = umat(&in_c(folder.path(), "j2.c"), true, YIELD);
    let stretched = Tensor::<3>::from_row_slice(&[1.03, 0.01, 0.0, 0.0, 0.98, 0.0, 0.0, 0.02, 1.0]);
    let identity = Tensor::identity();
    let turned = |k: usize| turn((k as f64).to_radians());
    let path = (0..=90).map(|k| turned(k) * stretched - identity);
    let (found, history) = along(&law, path);
    assert!(history[27] > 1e-3, "it flows: {}", history[27]);
    let (first, last) = (found[0].stress, found[90].stress);
    // P(Q F) = Q P(F)
    let off = (last - turned(90) * first).amax() / first.amax();
    assert!(off < 1e-12, "{off:e}");
    assert!((last - first).amax() > first.amax());
}

/// `(cos, sin)` of `k` times an angle, by powers of a complex number.
fn power((c, s): (f64, f64), k: usize) -> (f64, f64) {
    (0..k).fold((1.0, 0.0), |(x, y), _| (x * c - y * s, x * s + y * c))
}

#[test]
fn simple_shear_is_that_of_the_rate_of_jaumann() {
    let folder = tempfile::tempdir().unwrap();
    let law = umat(&in_c(folder.path(), "j2.c"), true, 1e9);
    let mut errors = Vec::new();
    for steps in [50, 100] {
        let by = 3.0 / steps as f64;
        let sheared = |k: usize| {
            let mut g = Tensor::<3>::zeros();
            g[(0, 1)] = by * (k + 1) as f64;
            g
        };
        let (found, _) = along(&law, (0..steps).map(sheared));
        // each increment turns z = σ_11 + i σ_12 by q and adds i μ Δγ, tan(arg q/4) = −Δγ/4: a geometric series
        let quarter = 1.0 + by * by / 16.0;
        let half = ((1.0 - by * by / 16.0) / quarter, -0.5 * by / quarter);
        let q = power(half, 2);
        let mut worst: f64 = 0.0;
        for (k, found) in found.iter().enumerate() {
            let gradient = sheared(k);
            let cauchy = found.cauchy(&gradient, true) / lame().1;
            let (x, y) = (0..=k)
                .map(|j| power(q, j))
                .fold((0.0, 0.0), |(x, y), (c, s)| (x - by * s, y + by * c));
            let off = (cauchy[(0, 0)] - x).abs().max((cauchy[(0, 1)] - y).abs());
            assert!(off < 1e-12, "{k} of {steps}: {off:e}");
            assert!((cauchy - cauchy.transpose()).amax() < 1e-13);
            // the rate itself: σ_12 = μ sin γ, σ_11 = μ (1 − cos γ)
            let gamma = gradient[(0, 1)];
            worst = worst.max((cauchy[(0, 1)] - gamma.sin()).abs());
            worst = worst.max((cauchy[(0, 0)] - 1.0 + gamma.cos()).abs());
        }
        errors.push(worst);
    }
    eprintln!("simple shear to 3, off by {errors:.4?} of μ in 50 and 100 increments");
    assert!(errors[1] < 0.04);
    assert!((errors[0] / errors[1] - 2.0).abs() < 0.05, "{errors:?}");
}

#[test]
fn at_once_nothing_is_called_and_nothing_changes() {
    let folder = tempfile::tempdir().unwrap();
    for is_large in [false, true] {
        let law = umat(&in_c(folder.path(), "j2.c"), is_large, YIELD);
        let (found, history) = along(&law, winding(20));
        let gradient = winding(20).last().unwrap();
        let mut present = history.clone();
        let again = law.respond(&gradient, 0.0, &history, &mut present);
        assert_eq!(again.stress, found[19].stress);
        assert_eq!((again.stored, again.dissipated), (found[19].stored, 0.0));
        assert_eq!(present, history);
        // at another gradient what is remembered is looked at alone
        let before = history.clone();
        law.respond(&(gradient * 2.0), 0.1, &history, &mut present);
        assert_eq!(before, history);
        assert!(present != history);
    }
}

#[test]
fn utilities_and_arguments_are_those_of_the_convention() {
    let folder = tempfile::tempdir().unwrap();
    let library = in_c(folder.path(), "odd.c");
    // eigenvalues 1, 2, 4 of a matrix whose sums are known: trace 7, Mises √7
    let stress = [3.0, 2.0, 2.0, 1.0, 1.0, 0.0];
    let settings = UmatSettings {
        constants: stress.to_vec(),
        states: 25,
        length: 0.25,
        ..settings(true, YIELD)
    };
    let routine = Routine::load(&library, Some("shown_")).unwrap();
    let law = Umat::new(routine, settings);
    // a quarter turn about z in one step
    let (_, history) = along(
        &law,
        [turn(90f64.to_radians()) - Tensor::identity()].into_iter(),
    );
    let state = &history[27..];
    let is_near = |found: &[f64], expected: &[f64]| {
        let close = found
            .iter()
            .zip(expected)
            .all(|(f, e)| (f - e).abs() < 1e-12);
        assert!(
            close && found.len() == expected.len(),
            "{found:?} {expected:?}"
        );
    };
    is_near(&state[..2], &[7.0 / 3.0, 7f64.sqrt()]);
    is_near(&state[2..5], &[4.0, 2.0, 1.0]);
    // x becomes y, y becomes −x: 11 and 22 change places, 12 its sign, 13 is 23, 23 is −13
    is_near(&state[5..11], &[2.0, 3.0, 2.0, -1.0, 0.0, 1.0]);
    // shears halved: 2 and (5 ± √3)/2
    let root = 3f64.sqrt();
    is_near(
        &state[11..14],
        &[0.5 * (5.0 + root), 2.0, 0.5 * (5.0 - root)],
    );
    is_near(
        &state[14..],
        &[
            3.0,
            3.0,
            6.0,
            1.0,
            0.0,
            0.1,
            293.0,
            0.25,
            0.0,
            f64::from(b'S'),
            f64::from(b' '),
        ],
    );
}

#[test]
fn what_cannot_be_loaded_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let missing = Routine::load(&folder.path().join("none.so"), None).unwrap_err();
    assert!(
        matches!(missing, RoutineError::Library { .. }) && missing.to_string().contains("none.so")
    );
    let library = in_c(folder.path(), "odd.c");
    let unknown = Routine::load(&library, None).unwrap_err().to_string();
    assert!(
        unknown.contains("no routine `umat_`, `umat`, `UMAT`"),
        "{unknown}"
    );
}
