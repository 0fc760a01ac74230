use super::*;
use crate::peridynamics::TIE_TOLERANCE;

/// Reproducible numbers in [0, 1).
fn random(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1u64 << 53) as f64
}

#[test]
fn shares_by_hand() {
    let share = |algorithm: PartialVolume, x: f64, y: f64, ratio: f64| {
        let point = Vector::<2>::new(x, y);
        let cell = BoxCell::cube(point, 1.0).unwrap();
        algorithm.share(&Vector::zeros(), ratio, &point, &cell, TIE_TOLERANCE)
    };
    use PartialVolume::{Exact, Full, Hhb, PdLammps};
    // a tie: whole, half, half, and the segment of the disc
    assert_eq!(share(Full, 3.0, 0.0, 3.0), 1.0);
    assert_eq!(share(Full, 3.0, 0.0, 3.0 - 1e-9), 1.0);
    assert_eq!(share(Full, 3.0, 0.0, 3.0 - 1e-5), 0.0);
    assert!((share(PdLammps, 3.0, 0.0, 3.0) - 0.5).abs() < 1e-15);
    assert!((share(PdLammps, 3.0, 0.0, 3.0 - 1e-9) - 0.5).abs() < 1e-8);
    assert!((share(Hhb, 3.0, 0.0, 3.0) - 0.5).abs() < 1e-15);
    // ∫ √(9 − y²) dy over [−½, ½], less 2.5
    let segment = 0.5 * 35.0f64.sqrt() / 2.0 + 9.0 * (1.0f64 / 6.0).asin() - 2.5;
    assert!((share(Exact, 3.0, 0.0, 3.0) - segment).abs() < 1e-15);
    // beyond the horizon: 0.2 of the ramp is left
    assert_eq!(share(PdLammps, 3.3, 0.0, 3.0), 0.0);
    assert!((share(Hhb, 3.3, 0.0, 3.0) - 0.2).abs() < 1e-14);
    // the ramp of (2, 2) at δ = 3, |ξ| = 2√2
    assert!((share(PdLammps, 2.0, 2.0, 3.0) - (3.5 - 8.0f64.sqrt())).abs() < 1e-14);
}

/// Composite Gauss-Legendre, two points, of the chord `√(r² − x²)` cut to a strip.
fn area_by_quadrature(low: [f64; 2], high: [f64; 2], radius: f64, pieces: usize) -> f64 {
    let h = (high[0] - low[0]) / pieces as f64;
    let g = 0.5 / 3.0f64.sqrt();
    (0..2 * pieces)
        .map(|q| {
            let side = if q % 2 == 0 { -g } else { g };
            let x: f64 = low[0] + ((q / 2) as f64 + 0.5 + side) * h;
            let w = (radius * radius - x * x).max(0.0).sqrt();
            0.5 * h * (high[1].min(w) - low[1].max(-w)).max(0.0)
        })
        .sum()
}

#[test]
fn closed_forms_match_quadrature_on_random_boxes() {
    let mut state = 77;
    let mut cut = 0;
    for _ in 0..60 {
        let mut side = || {
            let a = 2.0 * random(&mut state) - 1.0;
            (a, a + 0.05 + random(&mut state))
        };
        let (x, y, z) = (side(), side(), side());
        let low = Vector::<3>::new(x.0, y.0, z.0);
        let high = Vector::<3>::new(x.1, y.1, z.1);
        let flat = BoxCell::new(low.xy(), high.xy()).unwrap();
        let area = flat.ball_measure(&Vector::zeros(), 0.9);
        let reference = area_by_quadrature([x.0, y.0], [x.1, y.1], 0.9, 4000);
        assert!((area - reference).abs() < 1e-6, "{area} {reference}");
        // slices of the box are rectangles against discs
        let solid = BoxCell::new(low, high)
            .unwrap()
            .ball_measure(&Vector::zeros(), 0.9);
        let slices = 4000;
        let h = (z.1 - z.0) / slices as f64;
        let stacked: f64 = (0..slices)
            .map(|s| {
                let at: f64 = z.0 + (s as f64 + 0.5) * h;
                let r = (0.81 - at * at).max(0.0).sqrt();
                h * flat.ball_measure(&Vector::zeros(), r)
            })
            .sum();
        assert!((solid - stacked).abs() < 2e-6, "{solid} {stacked}");
        cut += usize::from(solid > 1e-3 && solid < 0.999 * (high - low).product());
    }
    assert!(cut > 20, "{cut}");
}

#[test]
fn unusable_input_is_named() {
    let flat = BoxCell::new(Vector::<2>::new(0.0, 1.0), Vector::<2>::new(1.0, 1.0)).unwrap_err();
    assert!(flat.to_string().contains("from [0.0, 1.0] to [1.0, 1.0]"));
    let ratio = lattice_cells::<2>(PartialVolume::Full, 0.5, TIE_TOLERANCE).unwrap_err();
    assert!(ratio.to_string().contains("0.5"));
}
