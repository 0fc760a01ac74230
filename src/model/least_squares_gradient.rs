//! First and second derivatives at a point of a cloud, by weighted least squares on its nearest neighbours.

use nalgebra::{DMatrix, DVector};

use crate::tensor::{Tensor, Vector};

/// Weights of the derivatives of a field at a point: `∂_b u ≈ Σ_n gradient[n][b] (u_n − u_0)`, likewise the Hessian.
///
/// Exact for quadratic fields.
pub struct DerivativeWeights<const D: usize> {
    /// The neighbours used, as given.
    pub neighbours: Vec<u32>,
    /// Weights of the gradient, one vector per neighbour \[1/m\].
    pub gradient: Vec<Vector<D>>,
    /// Weights of the Hessian, one symmetric tensor per neighbour \[1/m²\].
    pub hessian: Vec<Tensor<D>>,
}

/// Number of monomials of degree 1 and 2 in `D` variables.
const fn monomials(d: usize) -> usize {
    d + d * (d + 1) / 2
}

/// Derivatives from the nearest neighbours; the ring grows until a quadratic is determined.
///
/// `neighbours` gives bond vectors and names. The nearest ring on a lattice is its `3^D − 1` neighbours; their weights fall off as `|ξ|⁻⁸`, so that the stencil
/// is close to the standard compact differences, which have no short-wave mechanism.
///
/// Returns `None` where no ring determines a quadratic (collinear points).
pub fn quadratic<const D: usize>(
    spacing: f64,
    neighbours: &[(u32, Vector<D>)],
) -> Option<DerivativeWeights<D>> {
    let columns = monomials(D);
    for ring in [1.01 * (D as f64).sqrt(), 2.3, 3.3, 4.5] {
        let near: Vec<_> = neighbours
            .iter()
            .filter(|(_, xi)| xi.norm() <= ring * spacing)
            .collect();
        if near.len() < columns {
            continue;
        }
        let mut a = DMatrix::zeros(near.len(), columns);
        let mut w = DVector::zeros(near.len());
        for (r, (_, xi)) in near.iter().enumerate() {
            let x = xi / spacing;
            w[r] = x.norm_squared().powi(-2);
            for (c, value) in monomial_row(&x).into_iter().enumerate() {
                a[(r, c)] = w[r] * value;
            }
        }
        let Some(inverse) = left_inverse(a, 1e-8) else {
            continue;
        };
        let mut result = DerivativeWeights {
            neighbours: Vec::new(),
            gradient: Vec::new(),
            hessian: Vec::new(),
        };
        for (r, (name, _)) in near.iter().enumerate() {
            let coefficient = |c: usize| inverse[(c, r)] * w[r];
            result.neighbours.push(*name);
            result
                .gradient
                .push(Vector::from_fn(|b, _| coefficient(b) / spacing));
            let mut hessian = Tensor::zeros();
            let mut c = D;
            for b in 0..D {
                for d in b..D {
                    hessian[(b, d)] = coefficient(c) / (spacing * spacing);
                    hessian[(d, b)] = hessian[(b, d)];
                    c += 1;
                }
            }
            result.hessian.push(hessian);
        }
        return Some(result);
    }
    None
}

/// `(AᵀA)⁻¹Aᵀ` by QR with column pivoting; `None` if the columns depend on each other to within `tolerance`.
///
/// A singular value decomposition would do as well, but nalgebra's loses half of the digits where singular values coincide, as they do on lattices.
fn left_inverse(a: DMatrix<f64>, tolerance: f64) -> Option<DMatrix<f64>> {
    let qr = a.col_piv_qr();
    let r = qr.r();
    let diagonal = r.diagonal().abs();
    if diagonal.min() <= tolerance * diagonal.max() {
        return None;
    }
    let mut inverse = r.solve_upper_triangular(&qr.q().transpose())?;
    qr.p().inv_permute_rows(&mut inverse);
    Some(inverse)
}

/// `x_b`, then `x_b x_d` (halved on the diagonal) for `b ≤ d`: the Taylor monomials.
fn monomial_row<const D: usize>(x: &Vector<D>) -> Vec<f64> {
    let mut row: Vec<f64> = x.iter().copied().collect();
    for b in 0..D {
        for d in b..D {
            row.push(if b == d { 0.5 } else { 1.0 } * x[b] * x[d]);
        }
    }
    row
}

/// The Taylor monomials of degree two: `x_b x_d`, halved on the diagonal, for `b ≤ d`.
pub(crate) fn second_monomials<const D: usize>(x: &Vector<D>) -> Vec<f64> {
    monomial_row(x).split_off(D)
}

/// Least independence of the monomials on a patch, as the smallest over the largest diagonal entry of R: the nearest sites of regular elements have 0.1 and more.
const DETERMINED: f64 = 0.02;

/// Weights of the second derivatives `∂_b ∂_d u` (`b ≤ d`) at the origin, one list per datum, by least squares over data at `data`; exact for quadratic fields.
///
/// The weight of a datum at the distance `r` is `1/(r² + ¼)`, lengths being in units of an element. Returns `None` if the data determine no quadratic well.
pub(crate) fn second_derivatives<const D: usize>(data: &[Vector<D>]) -> Option<Vec<Vec<f64>>> {
    let columns = 1 + monomials(D);
    if data.len() < columns {
        return None;
    }
    let mut a = DMatrix::zeros(data.len(), columns);
    let weights: Vec<f64> = data
        .iter()
        .map(|x| 1.0 / (x.norm_squared() + 0.25))
        .collect();
    for (r, (x, w)) in data.iter().zip(&weights).enumerate() {
        a[(r, 0)] = *w;
        for (c, value) in monomial_row(x).into_iter().enumerate() {
            a[(r, c + 1)] = w * value;
        }
    }
    let inverse = left_inverse(a, DETERMINED)?;
    Some(
        weights
            .iter()
            .enumerate()
            .map(|(r, w)| (1 + D..columns).map(|c| inverse[(c, r)] * w).collect())
            .collect(),
    )
}

/// Weights of a moving least-squares fit of degree 1 (`affine`) or 2 at `x`, over data at `data`; they reproduce polynomials of that degree.
///
/// Source: the constraint of [SAND2015-7998] section 7.3 (there quadratic). The weight of a datum at distance `r` is `(1 − (r/R)²)²`, `R` just beyond the farthest datum.
/// Returns `None` if the data do not determine the polynomial.
pub fn fit<const D: usize>(
    x: &Vector<D>,
    data: &[Vector<D>],
    degree: FitDegree,
) -> Option<Vec<f64>> {
    let columns = match degree {
        FitDegree::Affine => 1 + D,
        FitDegree::Quadratic => 1 + monomials(D),
    };
    if data.len() < columns {
        return None;
    }
    let radius = data.iter().map(|p| (p - x).norm()).fold(0.0, f64::max) * 1.1;
    let mut a = DMatrix::zeros(data.len(), columns);
    let mut w = Vec::with_capacity(data.len());
    for (r, p) in data.iter().enumerate() {
        let d = (p - x) / radius;
        let weight = 1.0 - d.norm_squared();
        w.push(weight);
        a[(r, 0)] = weight;
        for (c, value) in monomial_row(&d).into_iter().take(columns - 1).enumerate() {
            a[(r, c + 1)] = weight * value;
        }
    }
    let inverse = left_inverse(a, 1e-7)?;
    Some((0..data.len()).map(|r| inverse[(0, r)] * w[r]).collect())
}

/// Order of the constraint where mesh and points meet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "InterfaceSpec")]
pub enum FitDegree {
    /// Affine fields pass exactly.
    Affine,
    /// Quadratic fields pass exactly.
    #[default]
    Quadratic,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a lattice of spacing 0.5 around the origin, moved by up to `jitter` spacings.
    fn around<const D: usize>(reach: i32, jitter: f64) -> Vec<Vector<D>> {
        let side = 2 * reach + 1;
        let mut state = 7u64;
        (0..side.pow(D as u32))
            .map(|index| {
                let mut rest = index;
                Vector::from_fn(|_, _| {
                    let k = rest % side - reach;
                    rest /= side;
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1);
                    let noise = (state >> 33) as f64 / f64::from(1u32 << 30) - 1.0;
                    0.5 * (f64::from(k) + jitter * noise)
                })
            })
            .collect()
    }

    /// A quadratic with gradient `g` and Hessian `h` at the origin.
    fn quadratic_field<const D: usize>(x: &Vector<D>) -> (f64, Vector<D>, Tensor<D>) {
        let g = Vector::<D>::from_fn(|a, _| 1.5 - a as f64);
        let h = Tensor::<D>::from_fn(|a, b| 0.3 + (a + b) as f64 + if a == b { 2.0 } else { 0.0 });
        (0.7 + g.dot(x) + 0.5 * x.dot(&(h * x)), g, h)
    }

    fn derivatives_are_exact_for_quadratics<const D: usize>() {
        for jitter in [0.0, 0.15] {
            let points = around::<D>(2, jitter);
            let centre = points
                .iter()
                .position(|x| x.norm() < 0.2)
                .expect("the centre");
            let bonds: Vec<(u32, Vector<D>)> = (0..points.len())
                .filter(|&i| i != centre)
                .map(|i| (i as u32, points[i] - points[centre]))
                .collect();
            let weights = quadratic(0.5, &bonds).expect("enough neighbours");
            let (here, ..) = quadratic_field(&points[centre]);
            let (mut g, mut h) = (Vector::<D>::zeros(), Tensor::<D>::zeros());
            for (n, &j) in weights.neighbours.iter().enumerate() {
                let difference = quadratic_field(&points[j as usize]).0 - here;
                g += weights.gradient[n] * difference;
                h += weights.hessian[n] * difference;
            }
            let (_, g0, h0) = quadratic_field(&points[centre]);
            assert!((g - (g0 + h0 * points[centre])).amax() < 1e-11);
            assert!((h - h0).amax() < 1e-11);
        }
    }

    #[test]
    fn derivatives_of_quadratics_in_every_dimension() {
        derivatives_are_exact_for_quadratics::<1>();
        derivatives_are_exact_for_quadratics::<2>();
        derivatives_are_exact_for_quadratics::<3>();
    }

    #[test]
    fn on_a_lattice_the_nearest_ring_is_enough() {
        let bonds: Vec<(u32, Vector<3>)> = (0..)
            .zip(around::<3>(3, 0.0))
            .filter(|(_, x)| x.norm() > 0.1)
            .collect();
        assert_eq!(
            quadratic(0.5, &bonds).expect("a lattice").neighbours.len(),
            26
        );
    }

    #[test]
    fn fits_reproduce_their_degree_and_refuse_too_little() {
        let x = Vector::<2>::new(0.11, -0.07);
        let data = around::<2>(1, 0.2);
        let value = |weights: &[f64], f: &dyn Fn(&Vector<2>) -> f64| -> f64 {
            data.iter().zip(weights).map(|(p, w)| w * f(p)).sum()
        };
        let affine = |p: &Vector<2>| 2.0 - p[0] + 3.0 * p[1];
        let square = |p: &Vector<2>| quadratic_field(p).0;
        let weights = fit(&x, &data, FitDegree::Quadratic).expect("nine points");
        assert!((value(&weights, &square) - square(&x)).abs() < 1e-12);
        let weights = fit(&x, &data, FitDegree::Affine).expect("nine points");
        assert!((value(&weights, &affine) - affine(&x)).abs() < 1e-13);
        assert!((value(&weights, &square) - square(&x)).abs() > 1e-3);
        let line: Vec<Vector<2>> = (0..9)
            .map(|k| Vector::<2>::new(f64::from(k), 0.0))
            .collect();
        assert!(fit(&x, &line, FitDegree::Affine).is_none());
        assert!(fit(&x, &data[..5], FitDegree::Quadratic).is_none());
    }
}
