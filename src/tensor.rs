//! Small tensors, const generic in the dimension `D` (1, 2 or 3); the only home of their helpers.

use nalgebra::{SMatrix, SVector};

/// A vector of `D` components: a position, bond, displacement or force.
pub type Vector<const D: usize> = SVector<f64, D>;

/// A second-order tensor of `D × D` components.
pub type Tensor<const D: usize> = SMatrix<f64, D, D>;

/// Names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// A fourth-order tensor `C_ijkl`, stored as `D × D` second-order tensors `[i][j](k, l)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tensor4<const D: usize>(pub [[Tensor<D>; D]; D]);

impl<const D: usize> Tensor4<D> {
    /// The tensor whose components are all zero.
    pub fn zeros() -> Self {
        Self([[Tensor::zeros(); D]; D])
    }

    /// The tensor of the components `component(i, j, k, l)`.
    pub fn from_fn(component: impl Fn(usize, usize, usize, usize) -> f64) -> Self {
        Self(std::array::from_fn(|i| {
            std::array::from_fn(|j| Tensor::from_fn(|k, l| component(i, j, k, l)))
        }))
    }

    /// `C_ijkl = λ δ_ij δ_kl + μ (δ_ik δ_jl + δ_il δ_jk)`; `lambda`, `mu` are the Lamé parameters \[Pa\].
    pub fn isotropic(lambda: f64, mu: f64) -> Self {
        let mut c = Self::zeros();
        for i in 0..D {
            for j in 0..D {
                for k in 0..D {
                    for l in 0..D {
                        let d = |a: usize, b: usize| f64::from(u8::from(a == b));
                        c.0[i][j][(k, l)] = lambda * d(i, j) * d(k, l)
                            + mu * (d(i, k) * d(j, l) + d(i, l) * d(j, k));
                    }
                }
            }
        }
        c
    }

    /// The component `C_ijkl`.
    pub fn get(&self, i: usize, j: usize, k: usize, l: usize) -> f64 {
        self.0[i][j][(k, l)]
    }

    /// Adds `scale · ξ ⊗ ξ ⊗ ξ ⊗ ξ`, one bond's share of a fourth moment.
    pub fn add_fourth_power(&mut self, scale: f64, xi: &Vector<D>) {
        let xx = xi * xi.transpose();
        for i in 0..D {
            for j in 0..D {
                self.0[i][j] += xx * (scale * xx[(i, j)]);
            }
        }
    }

    /// `self + scale · other`.
    pub fn add_scaled(&mut self, scale: f64, other: &Self) {
        for i in 0..D {
            for j in 0..D {
                self.0[i][j] += other.0[i][j] * scale;
            }
        }
    }

    /// `self · scale`.
    pub fn scaled(&self, scale: f64) -> Self {
        let mut c = Self::zeros();
        c.add_scaled(scale, self);
        c
    }

    /// `(C : G)_ij = C_ijkl G_kl`.
    pub fn contract(&self, g: &Tensor<D>) -> Tensor<D> {
        Tensor::from_fn(|i, j| self.0[i][j].component_mul(g).sum())
    }

    /// `A_ik = a_j C_ijkl b_l`: the block that two gradients `a`, `b` make of a stiffness.
    pub fn between(&self, a: &Vector<D>, b: &Vector<D>) -> Tensor<D> {
        Tensor::from_fn(|i, k| {
            let mut s = 0.0;
            for j in 0..D {
                for l in 0..D {
                    s += a[j] * self.0[i][j][(k, l)] * b[l];
                }
            }
            s
        })
    }

    /// The same tensor of a body that is turned: `C'_ijkl = Q_ia Q_jb Q_kc Q_ld C_abcd`, with the minor and major symmetries of a stiffness to the last digit.
    pub fn turned(&self, q: &Tensor<D>) -> Self {
        let mut c = *self;
        for _ in 0..4 {
            // one index at a time, which becomes the last
            let old = c;
            c = Self::from_fn(|b, c, d, i| (0..D).map(|a| q[(i, a)] * old.get(a, b, c, d)).sum());
        }
        let minor = Self::from_fn(|i, j, k, l| {
            0.25 * ((c.get(i, j, k, l) + c.get(j, i, k, l))
                + (c.get(i, j, l, k) + c.get(j, i, l, k)))
        });
        Self::from_fn(|i, j, k, l| 0.5 * (minor.get(i, j, k, l) + minor.get(k, l, i, j)))
    }

    /// Lamé's parameters (λ, μ) of the isotropic tensor that is nearest in the sum of squares of all components; its own of an isotropic one.
    pub fn isotropic_part(&self) -> (f64, f64) {
        let d = D as f64;
        let pairs = || (0..D).flat_map(|i| (0..D).map(move |j| (i, j)));
        let bulk: f64 = pairs().map(|(i, j)| self.get(i, i, j, j)).sum();
        if D == 1 {
            return (bulk / 3.0, bulk / 3.0);
        }
        let all: f64 = pairs().map(|(i, j)| self.get(i, j, i, j)).sum();
        let mu = (d * all - bulk) / (d * (d + 2.0) * (d - 1.0));
        ((bulk - 2.0 * d * mu) / (d * d), mu)
    }

    /// The largest stress along an axis under a unit stretch along it with held sides, `C_iiii`: λ + 2 μ of an isotropic tensor.
    pub fn longitudinal_modulus(&self) -> f64 {
        (0..D).map(|i| self.get(i, i, i, i)).fold(0.0, f64::max)
    }

    /// Returns the stress under a unit stretch along the first axis with free sides, of an isotropic C: Young's modulus, in plane strain over 1 − ν².
    pub fn uniaxial_modulus(&self) -> f64 {
        let (along, across) = (self.get(0, 0, 0, 0), self.get(0, 0, D - 1, D - 1));
        match D {
            1 => along,
            2 => along - across * across / along,
            _ => along - 2.0 * across * across / (along + across),
        }
    }

    /// The largest component by magnitude.
    pub fn amax(&self) -> f64 {
        self.0
            .iter()
            .flatten()
            .map(|t| t.amax())
            .fold(0.0, f64::max)
    }
}

/// The infinitesimal strain `ε = ½ (G + Gᵀ)` of a displacement gradient `G`.
pub fn strain<const D: usize>(g: &Tensor<D>) -> Tensor<D> {
    (g + g.transpose()) * 0.5
}

/// Pads a `D`-vector with zeros to three components, for output.
pub fn padded<const D: usize>(v: &Vector<D>) -> [f64; 3] {
    let mut p = [0.0; 3];
    for i in 0..D {
        p[i] = v[i];
    }
    p
}

/// The least eigenvalue of a symmetric, positive semidefinite tensor.
pub fn least_eigenvalue<const D: usize>(t: &Tensor<D>) -> f64 {
    // beyond D the trace, which is no less than any of them
    let mut whole = Tensor::<3>::from_diagonal_element(t.trace());
    for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
        whole[(i, j)] = t[(i, j)];
    }
    whole.symmetric_eigenvalues().min()
}

/// The determinant of a tensor.
pub fn determinant<const D: usize>(t: &Tensor<D>) -> f64 {
    match D {
        1 => t[(0, 0)],
        2 => t[(0, 0)] * t[(1, 1)] - t[(0, 1)] * t[(1, 0)],
        _ => (0..3).map(|j| t[(0, j)] * cofactor(t, 0, j)).sum(),
    }
}

/// Distance of cos 3θ from ±1 within which two principal values are near each other and the angle loses its digits.
const DISTINCT: f64 = 1e-4;

/// The principal values of a symmetric tensor, in any order: by the angle of its deviator where they are distinct, else by an iteration that takes ten times as long.
pub fn principal_values(t: &Tensor<3>) -> [f64; 3] {
    let mean = t.trace() / 3.0;
    let deviator = t - Tensor::identity() * mean;
    let radius = (deviator.norm_squared() / 6.0).sqrt();
    let cosine = determinant(&deviator) / (2.0 * radius.powi(3));
    if cosine.is_nan() || cosine.abs() > 1.0 - DISTINCT {
        return t.symmetric_eigenvalues().into();
    }
    let angle = cosine.acos() / 3.0;
    let (half, rest) = (radius * angle.cos(), radius * 3f64.sqrt() * angle.sin());
    [mean + 2.0 * half, mean - half - rest, mean - half + rest]
}

/// The inverse and the determinant of a tensor; `None` if the determinant is zero or not a number.
pub fn inverse<const D: usize>(t: &Tensor<D>) -> Option<(Tensor<D>, f64)> {
    let det = determinant(t);
    if det == 0.0 || !det.is_finite() {
        return None;
    }
    let inverse = match D {
        1 => Tensor::from_element(1.0 / det),
        2 => Tensor::from_fn(|i, j| {
            let t = t[(1 - j, 1 - i)] / det;
            if i == j { t } else { -t }
        }),
        _ => Tensor::from_fn(|i, j| cofactor(t, j, i) / det),
    };
    Some((inverse, det))
}

/// The cofactor `(i, j)` of a tensor of three dimensions.
fn cofactor<const D: usize>(t: &Tensor<D>, i: usize, j: usize) -> f64 {
    // cyclic indices carry the sign
    let (a, b) = ((i + 1) % 3, (i + 2) % 3);
    let (c, d) = ((j + 1) % 3, (j + 2) % 3);
    t[(a, c)] * t[(b, d)] - t[(a, d)] * t[(b, c)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inverts<const D: usize>() {
        let t = Tensor::<D>::from_fn(|i, j| {
            ((5 * i + 3 * j + 1) as f64).sin() + if i == j { 2.0 } else { 0.0 }
        });
        let (inverse, det) = inverse(&t).unwrap();
        assert!((t * inverse - Tensor::identity()).amax() < 1e-14);
        assert!((determinant(&inverse) * det - 1.0).abs() < 1e-14);
        assert!(super::inverse(&Tensor::<D>::zeros()).is_none());
    }

    #[test]
    fn principal_values_are_those_of_a_turned_diagonal() {
        let turn = nalgebra::Rotation3::from_euler_angles(0.4, -1.1, 2.3);
        let lists = [
            [3.0, -1.0, 0.5],
            [1.0, 1.0 + 1e-6, -2.0],
            [1.0, 1.0, 2.5],
            [-4.0, 2.0, 2.0],
            [7.0; 3],
            [0.0; 3],
            [1e9, 1e9 + 3e7, -1e5],
        ];
        for values in lists {
            let diagonal = Tensor::<3>::from_diagonal(&values.into());
            let t = turn.matrix() * diagonal * turn.matrix().transpose();
            let mut found = principal_values(&strain(&t));
            let mut expected = values;
            found.sort_by(f64::total_cmp);
            expected.sort_by(f64::total_cmp);
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() <= 1e-13 * t.norm(), "{values:?}");
            }
        }
    }

    #[test]
    fn the_isotropic_part_of_an_isotropic_tensor_is_its_own() {
        let near = |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() + (b - d).abs() < 1e-14;
        assert!(near(
            Tensor4::<2>::isotropic(1.7, 0.4).isotropic_part(),
            (1.7, 0.4)
        ));
        assert!(near(
            Tensor4::<3>::isotropic(-0.2, 0.9).isotropic_part(),
            (-0.2, 0.9)
        ));
    }

    #[test]
    fn inverse_times_tensor_is_identity() {
        inverts::<1>();
        inverts::<2>();
        inverts::<3>();
        let t = Tensor::<2>::new(1.0, 2.0, 3.0, 4.0);
        assert_eq!(determinant(&t), -2.0);
    }
}
