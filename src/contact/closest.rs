//! The nearest place of a facet: of a point in 1D, a segment in 2D, a triangle in 3D.

use crate::tensor::Vector;

/// Barycentric coordinates of the place of a facet that is nearest to `x`.
///
/// Source of the regions of a triangle: Ericson, Real-Time Collision Detection (2005), section 5.1.5.
pub(super) fn nearest<const D: usize>(corners: &[Vector<D>; D], x: &Vector<D>) -> [f64; D] {
    let mut weights = [0.0; D];
    match D {
        1 => weights[0] = 1.0,
        2 => {
            let t = along(&corners[0], &corners[1], x);
            (weights[0], weights[1]) = (1.0 - t, t);
        }
        _ => {
            let found = of_triangle(&corners[0], &corners[1], &corners[2], x);
            weights.copy_from_slice(&found[..D]);
        }
    }
    weights
}

/// Part of the way from `a` to `b` at which a segment is nearest to `x`.
fn along<const D: usize>(a: &Vector<D>, b: &Vector<D>, x: &Vector<D>) -> f64 {
    let edge = b - a;
    let square = edge.norm_squared();
    if square > 0.0 {
        ((x - a).dot(&edge) / square).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

fn of_triangle<const D: usize>(
    a: &Vector<D>,
    b: &Vector<D>,
    c: &Vector<D>,
    x: &Vector<D>,
) -> [f64; 3] {
    let (ab, ac, ax) = (b - a, c - a, x - a);
    let (d1, d2) = (ab.dot(&ax), ac.dot(&ax));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bx = x - b;
    let (d3, d4) = (ab.dot(&bx), ac.dot(&bx));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let cx = x - c;
    let (d5, d6) = (ab.dot(&cx), ac.dot(&cx));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let of_c = d1 * d4 - d3 * d2;
    if of_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = along(a, b, x);
        return [1.0 - t, t, 0.0];
    }
    let of_b = d5 * d2 - d1 * d6;
    if of_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = along(a, c, x);
        return [1.0 - t, 0.0, t];
    }
    let of_a = d3 * d6 - d5 * d4;
    if of_a <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = along(b, c, x);
        return [0.0, 1.0 - t, t];
    }
    let sum = of_a + of_b + of_c;
    [of_a / sum, of_b / sum, of_c / sum]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the least distance over a fine grid of the facet.
    #[test]
    fn no_place_of_a_triangle_is_nearer() {
        let corners = [[0.1, 0.0, 0.2], [1.0, 0.2, 0.0], [0.3, 0.9, 0.4]].map(Vector::<3>::from);
        let place = |w: &[f64]| -> Vector<3> { corners.iter().zip(w).map(|(c, w)| c * *w).sum() };
        let mut seed = 7_u64;
        let mut number = || {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 53) as f64
        };
        for _ in 0..300 {
            let x = Vector::<3>::from_fn(|_, _| 3.0 * number() - 1.0);
            let weights = nearest(&corners, &x);
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert!(weights.iter().all(|w| *w >= 0.0));
            let found = (place(&weights) - x).norm();
            let mut least = f64::INFINITY;
            for i in 0..=100 {
                for j in 0..=100 - i {
                    let w = [i, j, 100 - i - j].map(|k| f64::from(k) / 100.0);
                    least = least.min((place(&w) - x).norm());
                }
            }
            assert!(found <= least + 1e-14 && found > least - 0.02, "{x:?}");
        }
    }

    #[test]
    fn a_segment_ends_at_its_corners() {
        let corners = [[0.0, 0.0], [2.0, 0.0]].map(Vector::<2>::from);
        for (x, t) in [([-1.0, 1.0], 0.0), ([0.5, -3.0], 0.25), ([5.0, 1.0], 1.0)] {
            assert_eq!(nearest(&corners, &Vector::<2>::from(x)), [1.0 - t, t]);
        }
    }
}
