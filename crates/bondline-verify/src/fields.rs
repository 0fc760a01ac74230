//! Exact displacement fields and error norms.

use bondline::tensor::{Tensor, Vector};

/// A displacement field that is known everywhere.
#[derive(Clone, Debug, PartialEq)]
pub enum Field<const D: usize> {
    /// `u = G x`.
    Affine(Tensor<D>),
    /// `u = e_c Π x_a^n_a`.
    Monomial {
        /// The component `c` that is not zero.
        component: usize,
        /// The powers `n_a`.
        powers: [u32; D],
    },
}

impl<const D: usize> Field<D> {
    /// `u(x)`.
    pub fn value(&self, x: &Vector<D>) -> Vector<D> {
        match self {
            Self::Affine(g) => g * x,
            Self::Monomial { component, powers } => {
                let mut u = Vector::zeros();
                u[*component] = (0..D).map(|a| x[a].powi(powers[a] as i32)).product();
                u
            }
        }
    }

    /// `∂_k ∂_l u_c` of the component `c` that a monomial has; zero for an affine field.
    pub fn second_derivatives(&self, x: &Vector<D>) -> Tensor<D> {
        let Self::Monomial { powers, .. } = self else {
            return Tensor::zeros();
        };
        Tensor::from_fn(|k, l| {
            let (mut factor, mut left) = (1.0, *powers);
            for a in [k, l] {
                factor *= f64::from(left[a]);
                left[a] = left[a].saturating_sub(1);
            }
            factor * (0..D).map(|a| x[a].powi(left[a] as i32)).product::<f64>()
        })
    }

    /// The values at many places, `D` numbers for each.
    pub fn at<'a>(&self, places: impl IntoIterator<Item = &'a Vector<D>>) -> Vec<f64> {
        let mut u = Vec::new();
        for x in places {
            u.extend(self.value(x).iter());
        }
        u
    }
}

/// All `D²` gradients with one entry 1, then the infinitesimal rotations about every axis, each of Frobenius norm 1.
pub fn affine_modes<const D: usize>() -> Vec<Field<D>> {
    let mut modes = Vec::new();
    for i in 0..D {
        for j in 0..D {
            let mut g = Tensor::zeros();
            g[(i, j)] = 1.0;
            modes.push(Field::Affine(g));
        }
    }
    modes.extend(rotations());
    modes
}

/// Infinitesimal rotations in every coordinate plane, of Frobenius norm 1; none in 1D.
pub fn rotations<const D: usize>() -> Vec<Field<D>> {
    let mut modes = Vec::new();
    for i in 0..D {
        for j in i + 1..D {
            let mut w = Tensor::zeros();
            w[(i, j)] = -0.5_f64.sqrt();
            w[(j, i)] = 0.5_f64.sqrt();
            modes.push(Field::Affine(w));
        }
    }
    modes
}

/// Every monomial of a degree, in every component.
pub fn monomials<const D: usize>(degree: u32) -> Vec<Field<D>> {
    let mut powers = vec![[0u32; D]];
    for a in 0..D {
        powers = powers
            .into_iter()
            .flat_map(|p| {
                let left = degree - p.iter().sum::<u32>();
                let lowest = if a + 1 == D { left } else { 0 };
                (lowest..=left).map(move |n| {
                    let mut p = p;
                    p[a] = n;
                    p
                })
            })
            .collect();
    }
    (0..D)
        .flat_map(|component| {
            powers
                .iter()
                .map(move |&powers| Field::Monomial { component, powers })
        })
        .collect()
}

/// Sizes of an error. They decide the order that is observed: always say which one is meant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Norms {
    /// The largest component.
    pub max: f64,
    /// `√(Σ |e|²/N)` over the sites.
    pub nodal: f64,
    /// `√(Σ V |e|²/Σ V)`, the L2 norm of a field that is constant around each site.
    pub piecewise: f64,
}

/// The norms of an error with `D` numbers per site.
///
/// Shapes: `error` has `D` entries per entry of `volumes`. Units: those of the error.
pub fn norms<const D: usize>(error: &[f64], volumes: &[f64]) -> Norms {
    let mut n = Norms::default();
    let (mut sum, mut weighted) = (0.0, 0.0);
    for (e, v) in error.chunks(D).zip(volumes) {
        let square: f64 = e.iter().map(|e| e * e).sum();
        n.max = e.iter().fold(n.max, |m, e| worst(m, e.abs()));
        sum += square;
        weighted += v * square;
    }
    n.nodal = (sum / volumes.len() as f64).sqrt();
    n.piecewise = (weighted / volumes.iter().sum::<f64>()).sqrt();
    n
}

/// The larger of two sizes; a size that is no number wins, so that it cannot hide.
pub fn worst(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() {
        f64::NAN
    } else {
        a.max(b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_span_every_gradient_and_rotate_without_strain() {
        assert_eq!(affine_modes::<1>().len(), 1);
        assert_eq!(affine_modes::<2>().len(), 5);
        assert_eq!(affine_modes::<3>().len(), 12);
        for mode in rotations::<3>() {
            let Field::Affine(w) = mode else {
                panic!("a rotation is affine")
            };
            assert_eq!((w + w.transpose()).amax(), 0.0);
            assert!((w.norm() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn monomials_are_complete_and_distinct() {
        // (n + D − 1 choose D − 1) monomials of degree n, in D components
        assert_eq!(monomials::<1>(4).len(), 1);
        assert_eq!(monomials::<2>(3).len(), 2 * 4);
        assert_eq!(monomials::<3>(2).len(), 3 * 6);
        let all = monomials::<3>(4);
        assert_eq!(all.len(), 3 * 15);
        for (i, m) in all.iter().enumerate() {
            assert!(!all[..i].contains(m));
            let Field::Monomial { powers, .. } = m else {
                panic!("a monomial")
            };
            assert_eq!(powers.iter().sum::<u32>(), 4);
        }
    }

    #[test]
    fn second_derivatives_are_those_of_finite_differences() {
        let x = Vector::<3>::new(0.7, -0.4, 1.1);
        let s = 1e-4;
        for degree in 1..=4 {
            for field in monomials::<3>(degree) {
                let Field::Monomial { component, .. } = field else {
                    panic!("a monomial")
                };
                let exact = field.second_derivatives(&x);
                for k in 0..3 {
                    for l in 0..3 {
                        let u = |p: f64, q: f64| {
                            let mut y = x;
                            y[k] += p * s;
                            y[l] += q * s;
                            field.value(&y)[component]
                        };
                        let d = (u(1.0, 1.0) - u(1.0, -1.0) - u(-1.0, 1.0) + u(-1.0, -1.0))
                            / (4.0 * s * s);
                        assert!((d - exact[(k, l)]).abs() < 1e-5, "{field:?} {k} {l}");
                    }
                }
            }
        }
    }

    #[test]
    fn norms_of_a_known_error() {
        let n = norms::<2>(&[3.0, 4.0, 0.0, 0.0], &[1.0, 3.0]);
        assert_eq!(n.max, 4.0);
        assert!((n.nodal - 12.5_f64.sqrt()).abs() < 1e-15);
        assert!((n.piecewise - 2.5).abs() < 1e-15);
        assert!(norms::<1>(&[f64::NAN, 1.0], &[1.0, 1.0]).max.is_nan());
    }
}
