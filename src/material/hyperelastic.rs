//! Hyperelastic solids, for displacement gradients of any size.

use super::{Banded, LocalHistory, LocalLaw, LocalResponse};
use crate::tensor::{Tensor, Tensor4, inverse};

fn delta(i: usize, j: usize) -> f64 {
    f64::from(u8::from(i == j))
}

/// `det(I + G) − 1`, without the difference of two ones.
fn volume_change(g: &Tensor<3>) -> f64 {
    let minor = |i: usize, j: usize| g[(i, i)] * g[(j, j)] - g[(i, j)] * g[(j, i)];
    g.trace() + minor(0, 1) + minor(1, 2) + minor(0, 2) + g.determinant()
}

/// St Venant–Kirchhoff: `W = ½ λ (tr E)² + μ E : E` with the Green–Lagrange strain `E = ½ (FᵀF − I)`, `P = F S`, `S = λ tr E I + 2 μ E`.
///
/// For large rotations and moderate strains: under compression to `1/√3` of its length a bar softens without end.
#[derive(Clone, Debug)]
pub struct StVenantKirchhoff {
    elastic: Tensor4<3>,
}

impl StVenantKirchhoff {
    /// A solid of the Lamé parameters λ and μ \[Pa\].
    pub fn new(lambda: f64, shear: f64) -> Self {
        Self {
            elastic: Tensor4::isotropic(lambda, shear),
        }
    }
}

impl LocalLaw<3> for StVenantKirchhoff {
    fn tangent(&self) -> &Tensor4<3> {
        &self.elastic
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn is_objective(&self) -> bool {
        true
    }

    fn flows_at_constant_volume(&self) -> bool {
        false
    }

    fn history(&self) -> LocalHistory {
        LocalHistory::NONE
    }

    // δ_ik S_lj + λ F_ij F_kl + μ ((F Fᵀ)_ik δ_jl + F_il F_kj)
    fn algorithmic_tangent(&self, gradient: &Tensor<3>, _step: f64, _past: &[f64]) -> Tensor4<3> {
        let green = (gradient + gradient.transpose() + gradient.transpose() * gradient) * 0.5;
        let second = self.elastic.contract(&green);
        let f = Tensor::identity() + gradient;
        let left = f * f.transpose();
        let (lambda, shear) = (self.elastic.get(0, 0, 1, 1), self.elastic.get(0, 1, 0, 1));
        Tensor4::from_fn(|i, j, k, l| {
            delta(i, k) * second[(l, j)]
                + lambda * f[(i, j)] * f[(k, l)]
                + shear * (left[(i, k)] * delta(j, l) + f[(i, l)] * f[(k, j)])
        })
    }

    fn has_symmetric_tangent(&self) -> bool {
        true
    }

    fn in_band(&self, _width: f64) -> Option<Banded<3>> {
        None
    }

    fn respond(
        &self,
        gradient: &Tensor<3>,
        _step: f64,
        _past: &[f64],
        _present: &mut [f64],
    ) -> LocalResponse<3> {
        let volume_ratio = 1.0 + volume_change(gradient);
        if volume_ratio <= 0.0 {
            return INSIDE_OUT;
        }
        // E without the difference of two ones, which would lose small strains
        let green = (gradient + gradient.transpose() + gradient.transpose() * gradient) * 0.5;
        let second = self.elastic.contract(&green);
        LocalResponse {
            stress: (Tensor::identity() + gradient) * second,
            across: 0.0,
            volume_ratio,
            stored: 0.5 * second.dot(&green),
            dissipated: 0.0,
        }
    }
}

/// The response of a material that is turned inside out.
const INSIDE_OUT: LocalResponse<3> = LocalResponse {
    stress: Tensor::from_array_storage(nalgebra::ArrayStorage([[f64::NAN; 3]; 3])),
    across: 0.0,
    volume_ratio: f64::NAN,
    stored: f64::NAN,
    dissipated: 0.0,
};

/// Compressible Neo-Hooke: `W = ½ μ (tr FᵀF − 3 − 2 ln J) + ½ λ (ln J)²`, `P = μ (F − F⁻ᵀ) + λ ln J F⁻ᵀ`, `J = det F` (\[BonetWood2008\] eq. 6.27).
///
/// A gradient that turns the material inside out, `J ≤ 0`, has no response: its stress is not a number.
#[derive(Clone, Debug)]
pub struct NeoHooke {
    lambda: f64,
    shear: f64,
    elastic: Tensor4<3>,
}

impl NeoHooke {
    /// A solid of the Lamé parameters λ and μ at rest \[Pa\].
    pub fn new(lambda: f64, shear: f64) -> Self {
        Self {
            lambda,
            shear,
            elastic: Tensor4::isotropic(lambda, shear),
        }
    }
}

impl LocalLaw<3> for NeoHooke {
    fn tangent(&self) -> &Tensor4<3> {
        &self.elastic
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn is_objective(&self) -> bool {
        true
    }

    fn flows_at_constant_volume(&self) -> bool {
        false
    }

    fn history(&self) -> LocalHistory {
        LocalHistory::NONE
    }

    // μ δ_ik δ_jl + (μ − λ ln J) A_il A_kj + λ A_ij A_kl,  A = F⁻ᵀ
    fn algorithmic_tangent(&self, gradient: &Tensor<3>, _step: f64, _past: &[f64]) -> Tensor4<3> {
        let log = volume_change(gradient).ln_1p();
        let Some((inverse, _)) =
            inverse(&(Tensor::identity() + gradient)).filter(|_| log.is_finite())
        else {
            return Tensor4::from_fn(|_, _, _, _| f64::NAN);
        };
        let a = inverse.transpose();
        let turned = self.shear - self.lambda * log;
        Tensor4::from_fn(|i, j, k, l| {
            self.shear * delta(i, k) * delta(j, l)
                + turned * a[(i, l)] * a[(k, j)]
                + self.lambda * a[(i, j)] * a[(k, l)]
        })
    }

    fn has_symmetric_tangent(&self) -> bool {
        true
    }

    fn in_band(&self, _width: f64) -> Option<Banded<3>> {
        None
    }

    fn respond(
        &self,
        gradient: &Tensor<3>,
        _step: f64,
        _past: &[f64],
        _present: &mut [f64],
    ) -> LocalResponse<3> {
        let log = volume_change(gradient).ln_1p();
        let deformation = Tensor::identity() + gradient;
        let Some((inverse, _)) = inverse(&deformation).filter(|_| log.is_finite()) else {
            return INSIDE_OUT;
        };
        // F − F⁻ᵀ = (F Fᵀ − I) F⁻ᵀ, and F Fᵀ − I without the difference of two ones
        let left = gradient + gradient.transpose() + gradient * gradient.transpose();
        let kirchhoff = left * self.shear + Tensor::identity() * (self.lambda * log);
        LocalResponse {
            stress: kirchhoff * inverse.transpose(),
            across: 0.0,
            volume_ratio: log.exp(),
            stored: 0.5 * self.shear * (left.trace() - 2.0 * log) + 0.5 * self.lambda * log * log,
            dissipated: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn respond(law: &dyn LocalLaw<3>, g: &Tensor<3>) -> LocalResponse<3> {
        law.respond(g, 0.0, &[], &mut [])
    }

    #[test]
    fn uniaxial_strain_has_its_closed_form() {
        let (lambda, shear) = (1.7, 1.3);
        for stretch in [0.6, 0.99, 1.3, 2.0f64] {
            let mut g = Tensor::<3>::zeros();
            g[(1, 1)] = stretch - 1.0;
            let found = respond(&StVenantKirchhoff::new(lambda, shear), &g);
            let green = 0.5 * (stretch * stretch - 1.0);
            let along = (lambda + 2.0 * shear) * green * stretch;
            assert!((found.stress[(1, 1)] - along).abs() < 1e-14 * 10.0);
            assert!((found.stress[(0, 0)] - lambda * green).abs() < 1e-14);
            let found = respond(&NeoHooke::new(lambda, shear), &g);
            let along = shear * (stretch - 1.0 / stretch) + lambda * stretch.ln() / stretch;
            assert!((found.stress[(1, 1)] - along).abs() < 1e-14);
            assert!((found.stress[(2, 2)] - lambda * stretch.ln()).abs() < 1e-14);
        }
    }

    #[test]
    fn what_is_turned_inside_out_has_no_response() {
        let laws: [&dyn LocalLaw<3>; 2] =
            [&StVenantKirchhoff::new(1.7, 1.3), &NeoHooke::new(1.7, 1.3)];
        for law in laws {
            let mut g = Tensor::<3>::zeros();
            for (along, is_whole) in [(-0.9, true), (-1.0, false), (-1.4, false)] {
                g[(1, 1)] = along;
                assert_eq!(
                    respond(law, &g).stress.iter().all(|s| s.is_finite()),
                    is_whole
                );
            }
        }
    }

    #[test]
    fn a_neo_hooke_solid_in_simple_shear_has_its_closed_form() {
        // J = 1: the Cauchy stress is μ (F Fᵀ − I)
        let (shear, gamma) = (1.3, 0.7);
        let mut g = Tensor::<3>::zeros();
        g[(0, 1)] = gamma;
        let found = respond(&NeoHooke::new(1.7, shear), &g);
        let cauchy = found.cauchy(&g, true);
        assert!((cauchy[(0, 1)] - shear * gamma).abs() < 1e-14);
        assert!((cauchy[(0, 0)] - shear * gamma * gamma).abs() < 1e-14);
        assert!(cauchy[(1, 1)].abs() < 1e-14);
        assert!((found.stored - 0.5 * shear * gamma * gamma).abs() < 1e-14);
    }
}
