//! Areas of cracks of known size: segments and discs that cut the bonds of a lattice of unit spacing.

use super::*;
use crate::peridynamics::CrackArea;

/// Bonds between next neighbours of a lattice of `count` points along each axis that are cut.
fn cut<const D: usize>(
    count: usize,
    horizon: f64,
    is_cut: impl Fn(&Vector<D>, &Vector<D>) -> bool,
) -> Vec<BrokenBond<D>> {
    let area = CrackArea::<D>::new(1.0, horizon);
    let digits = |mut k: usize, base: usize| {
        Vector::<D>::from_fn(|_, _| {
            let digit = k % base;
            k /= base;
            digit as f64
        })
    };
    let mut found = Vec::new();
    for k in 0..count.pow(D as u32) {
        let x = digits(k, count);
        // each bond from one of its ends
        for step in 0..3_usize.pow(D as u32) / 2 {
            let xi = digits(step, 3).add_scalar(-1.0);
            if is_cut(&x, &(x + xi)) {
                found.push(BrokenBond {
                    middle: x + xi * 0.5,
                    area: area.of(&xi),
                    horizon,
                });
            }
        }
    }
    found
}

/// Returns true if the bond from `a` to `b` crosses a segment.
fn crosses(a: &Vector<2>, b: &Vector<2>, [p, q]: [[f64; 2]; 2]) -> bool {
    let side = |a: [f64; 2], b: [f64; 2], x: [f64; 2]| {
        (b[0] - a[0]) * (x[1] - a[1]) - (b[1] - a[1]) * (x[0] - a[0])
    };
    let [a, b] = [[a[0], a[1]], [b[0], b[1]]];
    side(a, b, p) * side(a, b, q) < 0.0 && side(p, q, a) * side(p, q, b) < 0.0
}

/// The segment of a length from a place at an angle \[degrees\].
fn ray(from: [f64; 2], angle: f64, length: f64) -> [[f64; 2]; 2] {
    let (s, c) = angle.to_radians().sin_cos();
    [from, [from[0] + length * c, from[1] + length * s]]
}

/// Length of the cracks that some segments leave.
fn length(segments: &[[[f64; 2]; 2]], horizon: f64) -> f64 {
    area(&cut::<2>(100, horizon, |a, b| {
        segments.iter().any(|s| crosses(a, b, *s))
    }))
}

#[test]
fn straight_cracks_have_their_length_at_every_angle() {
    for horizon in [3.0, 4.0] {
        for angle in [0.0, 5.0, 10.0, 22.5, 30.0, 45.0, 60.0, 80.0] {
            let found = length(&[ray([20.1, 20.27], angle, 60.0)], horizon);
            let limit = if angle == 0.0 { 1e-12 } else { 0.02 };
            assert!(
                (found / 60.0 - 1.0).abs() < limit,
                "{horizon} {angle} {found}"
            );
        }
    }
}

#[test]
fn layers_of_a_crack_count_once() {
    for layers in [2, 3, 5] {
        let rows = (0..layers).map(|l| ray([20.1, 30.27 + f64::from(l)], 0.0, 60.0));
        let found = length(&rows.collect::<Vec<_>>(), 4.0);
        assert!((found / 60.0 - 1.0).abs() < 0.05, "{layers} {found}");
    }
    // two cracks that are farther apart are two
    let apart = [0.0, 12.0].map(|y| ray([20.1, 30.27 + y], 0.0, 60.0));
    assert!((length(&apart, 4.0) / 120.0 - 1.0).abs() < 1e-12);
}

#[test]
fn branched_cracks_have_their_length_within_a_horizon() {
    for half in [30.0, 45.0, 60.0] {
        let end = [50.1, 50.27];
        let branches = [
            ray([10.1, 50.27], 0.0, 40.0),
            ray(end, half, 40.0),
            ray(end, -half, 40.0),
        ];
        let found = length(&branches, 4.0);
        assert!((found - 120.0).abs() < 4.0, "{half} {found}");
    }
}

#[test]
fn penny_cracks_have_their_radius_within_a_horizon() {
    let (radius, horizon) = (8.0, 3.0);
    for normal in [
        [0.0, 0.0, 1.0],
        [0.0, 1.0, 1.0],
        [1.0, 2.0, 2.0],
        [1.0, 1.0, 1.0],
    ] {
        let n = Vector::<3>::from(normal).normalize();
        let centre = Vector::<3>::new(12.1, 12.27, 12.33);
        let disc = |layer: f64| {
            move |a: &Vector<3>, b: &Vector<3>| {
                let [from, to] = [a, b].map(|x| n.dot(&(x - centre)) - layer);
                let met = a + (b - a) * (from / (from - to));
                from * to < 0.0 && (met - centre - n * layer).norm() < radius
            }
        };
        for layers in [1, 2] {
            let bonds = cut::<3>(25, horizon, |a, b| {
                (0..layers).any(|l| disc(1.5 * f64::from(l))(a, b))
            });
            let found = (area(&bonds) / std::f64::consts::PI).sqrt();
            assert!(
                (found - radius).abs() < 0.5 * horizon,
                "{normal:?} {layers} {found}"
            );
        }
    }
}

#[test]
fn bars_crack_once_within_a_horizon() {
    let broken = |places: &[f64]| {
        area(&cut::<1>(40, 3.0, |a, b| {
            places.iter().any(|x| (a[0] - x) * (b[0] - x) < 0.0)
        }))
    };
    assert!((broken(&[10.2]) - 1.0).abs() < 1e-12);
    assert!((broken(&[10.2, 11.2, 12.2]) - 1.0).abs() < 1e-12);
    assert!((broken(&[10.2, 20.2]) - 2.0).abs() < 1e-12);
    // two holes of a bar in pieces
    assert!((broken(&[10.2, 11.2, 17.2, 18.2, 19.2]) - 2.0).abs() < 1e-12);
}
