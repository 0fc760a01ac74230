use std::f64::consts::PI;

use super::*;
use crate::peridynamics::TIE_TOLERANCE;

/// Reproducible numbers in [0, 1).
fn random(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1u64 << 53) as f64
}

fn ball<const D: usize>(radius: f64) -> f64 {
    match D {
        1 => 2.0 * radius,
        2 => PI * radius * radius,
        _ => 4.0 / 3.0 * PI * radius.powi(3),
    }
}

/// Sum of the shares of a full family and the point's own cell, relative to the ball, less one.
fn defect<const D: usize>(algorithm: PartialVolume, ratio: f64) -> f64 {
    let cells = lattice_cells::<D>(algorithm, ratio, TIE_TOLERANCE).unwrap();
    let sum = 1.0 + cells.iter().map(|c| c.share).sum::<f64>();
    (sum / ball::<D>(ratio) - 1.0).abs()
}

#[test]
fn exact_shares_of_a_full_family_add_up_to_the_ball() {
    for n in 75..=150 {
        let ratio = 0.04 * f64::from(n);
        assert!(defect::<1>(PartialVolume::Exact, ratio) < 1e-14);
        let plane = defect::<2>(PartialVolume::Exact, ratio);
        assert!(plane < 1e-14, "{ratio}: {plane:e}");
        if n % 15 == 0 {
            let solid = defect::<3>(PartialVolume::Exact, ratio);
            assert!(solid < 1e-13, "{ratio}: {solid:e}");
        }
    }
    // the others do not: the first misses the area by 2 % and more at most ratios
    assert!(defect::<2>(PartialVolume::Full, 3.3) > 0.02);
    assert!(defect::<2>(PartialVolume::PdLammps, 3.3) > 0.02);
}

#[test]
fn in_one_dimension_hhb_is_exact() {
    for n in 75..=150 {
        let ratio = 0.04 * f64::from(n);
        let hhb = lattice_cells::<1>(PartialVolume::Hhb, ratio, TIE_TOLERANCE).unwrap();
        let exact = lattice_cells::<1>(PartialVolume::Exact, ratio, TIE_TOLERANCE).unwrap();
        let largest = hhb
            .iter()
            .map(|c| {
                let twin = exact.iter().find(|e| e.offset == c.offset);
                (c.share - twin.map_or(0.0, |e| e.share)).abs()
            })
            .fold(0.0, f64::max);
        assert!(largest < 1e-13, "{ratio}: {largest:e}");
    }
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

#[test]
fn pieces_of_any_partition_add_up() {
    // uneven planes through a box that holds the ball: rectangles and boxes of different size
    let mut state = 5;
    let mut planes = |n: usize| -> Vec<f64> {
        let mut at: Vec<f64> = (0..n).map(|_| 2.4 * random(&mut state) - 1.2).collect();
        at.extend([-1.3, 1.3]);
        at.sort_by(f64::total_cmp);
        at
    };
    let (x, y, z) = (planes(7), planes(9), planes(6));
    let centre = Vector::<3>::new(0.1, -0.05, 0.07);
    let mut plane = 0.0;
    let mut solid = 0.0;
    for i in x.windows(2) {
        for j in y.windows(2) {
            let flat = BoxCell::new(Vector::<2>::new(i[0], j[0]), Vector::<2>::new(i[1], j[1]));
            plane += flat
                .unwrap()
                .ball_measure(&Vector::<2>::new(0.1, -0.05), 1.1);
            for k in z.windows(2) {
                let low = Vector::<3>::new(i[0], j[0], k[0]);
                let high = Vector::<3>::new(i[1], j[1], k[1]);
                solid += BoxCell::new(low, high).unwrap().ball_measure(&centre, 1.1);
            }
        }
    }
    assert!((plane / ball::<2>(1.1) - 1.0).abs() < 1e-14);
    assert!((solid / ball::<3>(1.1) - 1.0).abs() < 1e-14);
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
fn sampling_approaches_the_closed_form() {
    let cell = BoxCell::new(
        Vector::<3>::new(0.2, 0.3, 0.4),
        Vector::<3>::new(0.7, 0.9, 0.8),
    )
    .unwrap();
    let exact = cell.ball_measure(&Vector::zeros(), 0.9);
    let error = |levels| {
        let sampled =
            subdivide_and_sample(&cell, &Vector::zeros(), 0.9, levels, SAND_SAMPLES_PER_EDGE);
        (sampled / exact - 1.0).abs()
    };
    assert!(error(1) > error(5));
    let six = error(SAND_LEVELS);
    assert!(six < 1e-4 && six > 1e-12, "{six:e}");
    // no level at all is plain sampling: 64 points
    let whole = subdivide_and_sample(&cell, &Vector::zeros(), 0.9, 0, SAND_SAMPLES_PER_EDGE);
    assert!(((whole / cell.measure() * 64.0).fract()).abs() < 1e-9);
}

fn hexahedron(cell: &BoxCell<3>, map: impl Fn(Vector<3>) -> Vector<3>) -> Hexahedron {
    let (l, h) = cell.corners();
    let corner = |x: f64, y: f64, z: f64| map(Vector::<3>::new(x, y, z));
    Hexahedron::new([
        corner(l.x, l.y, l.z),
        corner(h.x, l.y, l.z),
        corner(h.x, h.y, l.z),
        corner(l.x, h.y, l.z),
        corner(l.x, l.y, h.z),
        corner(h.x, l.y, h.z),
        corner(h.x, h.y, h.z),
        corner(l.x, h.y, h.z),
    ])
    .unwrap()
}

#[test]
fn a_turned_box_has_the_same_volume_in_the_ball() {
    let (c, s) = (0.8, 0.6);
    let turn = |x: Vector<3>| {
        let y = Vector::<3>::new(c * x.x - s * x.y, s * x.x + c * x.y, x.z);
        Vector::<3>::new(y.x, c * y.y - s * y.z, s * y.y + c * y.z)
    };
    let cell = BoxCell::new(
        Vector::<3>::new(0.5, -0.3, 0.2),
        Vector::<3>::new(1.0, 0.5, 0.6),
    )
    .unwrap();
    let exact = cell.ball_measure(&Vector::zeros(), 0.9);
    let measured = hexahedron(&cell, turn).ball_volume(&Vector::zeros(), 0.9);
    assert!((measured - exact).abs() < 1e-14, "{measured} {exact}");
    // the ball inside, around, beyond, and a centre on a face's plane and on a corner
    for (centre, radius) in [
        (Vector::<3>::new(0.75, 0.1, 0.4), 0.1),
        (Vector::<3>::new(0.7, 0.1, 0.4), 3.0),
        (Vector::<3>::new(3.0, 0.1, 0.4), 0.5),
        (Vector::<3>::new(0.5, 0.1, 0.4), 0.3),
        (Vector::<3>::new(0.5, -0.3, 0.2), 0.45),
        (Vector::<3>::new(0.2, -0.3, 0.2), 0.45),
    ] {
        let exact = cell.ball_measure(&centre, radius);
        let straight = hexahedron(&cell, |x| x).ball_volume(&centre, radius);
        let turned = hexahedron(&cell, turn).ball_volume(&turn(centre), radius);
        assert!(
            (straight - exact).abs() < 1e-14,
            "{centre} {radius}: {straight} {exact}"
        );
        assert!(
            (turned - exact).abs() < 1e-13,
            "{centre} {radius}: {turned} {exact}"
        );
    }
}

#[test]
fn skewed_hexahedra_that_fill_a_box_fill_the_ball() {
    // eight hexahedra about a middle point that is moved off the middle: their faces are not plane
    let grid = [-1.0, 0.0, 1.0];
    let moved = |x: Vector<3>| {
        let inner = (1.0 - x.x * x.x) * (1.0 - x.y * x.y) * (1.0 - x.z * x.z);
        let face = |a: f64, b: f64| (1.0 - a * a) * (1.0 - b * b);
        x + Vector::<3>::new(0.15 * inner, -0.1 * face(x.y, x.x) * inner, 0.12 * inner)
            + Vector::<3>::new(0.1 * face(x.x, x.y), 0.1 * face(x.y, x.z), 0.0)
    };
    let mut sum = 0.0;
    let mut whole = 0.0;
    for i in 0..2 {
        for j in 0..2 {
            for k in 0..2 {
                let low = Vector::<3>::new(grid[i], grid[j], grid[k]);
                let cell = BoxCell::new(low, low.add_scalar(1.0)).unwrap();
                let hexahedron = hexahedron(&cell, moved);
                whole += hexahedron.volume();
                sum += hexahedron.ball_volume(&Vector::<3>::new(0.05, 0.02, -0.03), 0.6);
            }
        }
    }
    assert!((whole - 8.0).abs() < 1e-13, "{whole}");
    assert!((sum / ball::<3>(0.6) - 1.0).abs() < 1e-13, "{sum}");
}

#[test]
fn unusable_input_is_named() {
    let flat = BoxCell::new(Vector::<2>::new(0.0, 1.0), Vector::<2>::new(1.0, 1.0)).unwrap_err();
    assert!(flat.to_string().contains("from [0.0, 1.0] to [1.0, 1.0]"));
    let ratio = lattice_cells::<2>(PartialVolume::Full, 0.5, TIE_TOLERANCE).unwrap_err();
    assert!(ratio.to_string().contains("0.5"));
    let inside_out = Hexahedron::new([Vector::zeros(); 8]).unwrap_err();
    assert!(inside_out.to_string().contains("volume 0"));
}
