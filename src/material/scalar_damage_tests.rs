//! Tests of [`super`].

use super::*;
use crate::material::{Kinematics, Reduced};

const YOUNG: f64 = 1000.0;
const POISSON: f64 = 0.2;
const STRENGTH: f64 = 2.0;
const ENERGY: f64 = 0.05;
/// Of the bands of these tests; 2 E G/f² is 25.
const BAND: f64 = 4.0;

fn settings(curve: SofteningCurve, measure: EquivalentStrain) -> ScalarDamageSettings {
    let shear = YOUNG / (2.0 * (1.0 + POISSON));
    ScalarDamageSettings {
        lambda: YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON)),
        shear,
        strength: STRENGTH,
        energy: ENERGY,
        measure,
        curve,
    }
}

fn law(curve: SofteningCurve, measure: EquivalentStrain) -> Arc<dyn LocalLaw<3>> {
    let law = ScalarDamage::new(settings(curve, measure));
    law.in_band(BAND).unwrap().unwrap()
}

const CURVES: [SofteningCurve; 2] = [SofteningCurve::Exponential, SofteningCurve::Linear];
const MEASURES: [EquivalentStrain; 2] = [EquivalentStrain::Mazars, EquivalentStrain::Energy];

/// A point that goes from gradient to gradient.
struct Point<'a, const D: usize> {
    law: &'a dyn LocalLaw<D>,
    past: Vec<f64>,
    dissipated: f64,
}

impl<'a, const D: usize> Point<'a, D> {
    fn new(law: &'a dyn LocalLaw<D>) -> Self {
        Self {
            law,
            past: vec![0.0; law.history().len()],
            dissipated: 0.0,
        }
    }

    fn step(&mut self, g: &Tensor<D>) -> LocalResponse<D> {
        let mut present = vec![f64::NAN; self.past.len()];
        let found = self.law.respond(g, 1.0, &self.past, &mut present);
        assert!(found.dissipated >= 0.0 && present[0] >= self.past[0]);
        self.dissipated += found.dissipated;
        self.past = present;
        found
    }
}

/// Uniaxial stress at a strain that has never been exceeded, by the formulas of the curve: `f_t (ε_u − ε)/(ε_u − ε₀)` with `ε_u = 2 G/(h f_t)`, `f_t exp(−(ε − ε₀)/ε_f)` with `ε_f = G/(h f_t) − ε₀/2`.
fn envelope(curve: SofteningCurve, strain: f64) -> f64 {
    let onset = STRENGTH / YOUNG;
    let area = ENERGY / (BAND * STRENGTH);
    let whole = match curve {
        _ if strain <= onset => YOUNG * strain,
        SofteningCurve::Linear if strain >= 2.0 * area => 0.0,
        SofteningCurve::Linear => STRENGTH * (2.0 * area - strain) / (2.0 * area - onset),
        SofteningCurve::Exponential => STRENGTH * (-(strain - onset) / (area - 0.5 * onset)).exp(),
    };
    whole + RESIDUAL * (YOUNG * strain - whole)
}

#[test]
fn uniaxial_tension_follows_its_curve_unloads_to_the_origin_and_reloads() {
    for (curve, measure) in CURVES
        .into_iter()
        .zip(MEASURES)
        .chain([(CURVES[1], MEASURES[0]), (CURVES[0], MEASURES[1])])
    {
        let bar = Reduced::<1>::new(law(curve, measure), Kinematics::Bar);
        let mut point = Point::new(&bar);
        let onset = STRENGTH / YOUNG;
        let is_near = |point: &mut Point<'_, 1>, strain: f64, expected: f64| {
            let found = point.step(&Tensor::<1>::new(strain));
            let stress = found.stress[0];
            assert!(
                (stress - expected).abs() < 1e-10 * STRENGTH,
                "{curve:?} {measure:?} at {strain}: {stress} {expected}"
            );
            assert!((found.stored - 0.5 * stress * strain).abs() < 1e-10 * STRENGTH * onset);
        };
        // up to the peak, which is the strength, and beyond
        for part in [0.3, 0.999, 1.0, 1.001, 1.7] {
            is_near(&mut point, part * onset, envelope(curve, part * onset));
        }
        assert!((envelope(curve, onset) / STRENGTH - 1.0).abs() < 1e-15);
        assert!(point.dissipated > 0.0);
        // along the secant to the origin and back, with nothing dissipated
        let (top, spent) = (1.7 * onset, point.dissipated);
        for part in [0.6, 0.0, 0.4, 1.0] {
            is_near(&mut point, part * top, part * envelope(curve, top));
        }
        assert_eq!(point.dissipated, spent);
        for part in [2.0, 4.0, 7.0, 12.0, 13.0, 40.0, 1e4] {
            is_near(&mut point, part * onset, envelope(curve, part * onset));
        }
        // the area under the curve is the fracture energy over the band, but for what is left of the stiffness
        let expected = (1.0 - RESIDUAL) * ENERGY / BAND;
        assert!(
            (point.dissipated / expected - 1.0).abs() < 1e-10,
            "{curve:?}"
        );
        assert!((point.past[0] - (1.0 - RESIDUAL)).abs() < 1e-6);
    }
}

#[test]
fn compression_counts_by_the_measure() {
    // a cylinder pressed: extensions ν ε on two sides, so that the strength is that of tension over √2 ν
    let bar =
        |measure| Reduced::<1>::new(law(SofteningCurve::Exponential, measure), Kinematics::Bar);
    for (measure, strength) in [
        (MEASURES[0], STRENGTH / (2f64.sqrt() * POISSON)),
        (MEASURES[1], STRENGTH),
    ] {
        let bar = bar(measure);
        let mut point = Point::new(&bar);
        point.step(&Tensor::<1>::new(-0.999_999 * strength / YOUNG));
        assert_eq!(point.past[0], 0.0, "{measure:?}");
        point.step(&Tensor::<1>::new(-1.000_001 * strength / YOUNG));
        assert!(point.past[0] > 0.0, "{measure:?}");
    }
}

/// Strains that turn as they grow, come and go.
fn turning<const D: usize>(k: usize) -> Tensor<D> {
    let t = k as f64 * 0.05;
    Tensor::from_fn(|i, j| {
        let phase = (2 * i.min(j) + 3 * i.max(j)) as f64;
        6e-3 * (t + phase).sin() * (0.4 * t).sin()
    })
}

#[test]
fn plates_and_long_bodies_are_solids_with_what_their_sides_do() {
    for (curve, measure) in CURVES.into_iter().zip(MEASURES) {
        let solid = law(curve, measure);
        for kinematics in [Kinematics::PlaneStress, Kinematics::PlaneStrain] {
            let flat = Reduced::<2>::new(Arc::clone(&solid), kinematics);
            let (mut flat, mut whole) = (Point::new(&flat), Point::new(&*solid));
            for k in 0..60 {
                let g = turning::<2>(k);
                let found = flat.step(&g);
                // the damage is the same for all stresses, so that the side of a plate moves as that of an elastic one
                let side = match kinematics {
                    Kinematics::PlaneStress => -POISSON / (1.0 - POISSON) * g.trace(),
                    _ => 0.0,
                };
                let padded = Tensor::<3>::from_fn(|i, j| match (i < 2 && j < 2, i == j) {
                    (true, _) => g[(i, j)],
                    (_, true) => side,
                    _ => 0.0,
                });
                let expected = whole.step(&padded);
                for (i, j) in [(0, 0), (0, 1), (1, 1)] {
                    let off = found.stress[(i, j)] - expected.stress[(i, j)];
                    assert!(off.abs() < 1e-9 * STRENGTH, "{kinematics:?} {k}: {off}");
                }
                assert!((found.across - expected.stress[(2, 2)]).abs() < 1e-9 * STRENGTH);
                assert!((found.stored - expected.stored).abs() < 1e-9 * STRENGTH);
            }
            assert!(flat.past[0] > 0.5, "{kinematics:?}: {}", flat.past[0]);
            assert!((flat.dissipated / whole.dissipated - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn work_is_stored_or_dissipated_on_paths_that_turn() {
    for measure in MEASURES {
        let law = law(SofteningCurve::Exponential, measure);
        // between points of the path the work is that of the trapezoidal rule, of second order in their number
        let off = |parts: usize| {
            let (mut point, mut work) = (Point::new(&*law), 0.0);
            let mut last = (Tensor::<3>::zeros(), Tensor::<3>::zeros());
            let mut stored = 0.0;
            for k in 1..=60 * parts {
                let at = |k: usize| {
                    let (whole, part) = (k / parts, (k % parts) as f64 / parts as f64);
                    turning::<3>(whole) * (1.0 - part) + turning::<3>(whole + 1) * part
                };
                let g = at(k);
                let found = point.step(&g);
                work += 0.5 * (found.stress + last.1).dot(&(g - last.0));
                last = (g, found.stress);
                stored = found.stored;
            }
            (stored + point.dissipated - work).abs() / work
        };
        let (coarse, fine) = (off(20), off(40));
        assert!(
            fine < 1e-4 && fine < 0.4 * coarse,
            "{measure:?}: {coarse} {fine}"
        );
    }
}

#[test]
fn bands_that_would_snap_back_are_refused_with_the_number() {
    for curve in CURVES {
        let law = ScalarDamage::new(settings(curve, EquivalentStrain::Mazars));
        // 2 E G/f² = 25
        assert!(law.in_band(24.9).unwrap().is_ok());
        for width in [25.0, 40.0, f64::NAN] {
            let why = law.in_band(width).unwrap().unwrap_err().to_string();
            assert!(
                why.contains("2.5000e1") && why.contains("snap back"),
                "{why}"
            );
        }
        // without a band nothing softens
        let found = Point::new(&law).step(&(Tensor::<3>::identity() * 0.1));
        assert!((found.stress[(0, 0)] - 0.1 * YOUNG / (1.0 - 2.0 * POISSON)).abs() < 1e-9);
    }
}
