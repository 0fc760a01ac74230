//! Isotropic linear elasticity.

use super::{Kinematics, MaterialError};
use crate::tensor::Tensor4;

/// An isotropic, linearly elastic solid, validated.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Elastic {
    youngs_modulus: f64,
    poisson_ratio: f64,
    density: f64,
}

impl Elastic {
    /// A solid of Young's modulus E \[Pa\], Poisson's ratio ν and density ρ [kg/m³].
    ///
    /// # Errors
    /// `MaterialError::{YoungsModulus, PoissonRatio, Density}` unless E > 0, -1 < ν < 0.5, ρ ≥ 0, all finite.
    pub fn new(
        youngs_modulus: f64,
        poisson_ratio: f64,
        density: f64,
    ) -> Result<Self, MaterialError> {
        if !(youngs_modulus.is_finite() && youngs_modulus > 0.0) {
            return Err(MaterialError::YoungsModulus {
                value: youngs_modulus,
            });
        }
        if !(poisson_ratio > -1.0 && poisson_ratio < 0.5) {
            return Err(MaterialError::PoissonRatio {
                value: poisson_ratio,
            });
        }
        if !(density.is_finite() && density >= 0.0) {
            return Err(MaterialError::Density { value: density });
        }
        Ok(Self {
            youngs_modulus,
            poisson_ratio,
            density,
        })
    }

    /// Young's modulus E \[Pa\].
    pub fn youngs_modulus(&self) -> f64 {
        self.youngs_modulus
    }

    /// Poisson's ratio ν.
    pub fn poisson_ratio(&self) -> f64 {
        self.poisson_ratio
    }

    /// Density ρ [kg/m³].
    pub fn density(&self) -> f64 {
        self.density
    }

    /// Shear modulus `μ = E / (2 (1 + ν))` \[Pa\].
    pub fn shear_modulus(&self) -> f64 {
        self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))
    }

    /// The Lamé parameters (λ_D, μ) \[Pa\] of `D` dimensions: `C_ijkl = λ_D δ_ij δ_kl + μ (δ_ik δ_jl + δ_il δ_jk)`.
    ///
    /// | kinematics | λ_D |
    /// |---|---|
    /// | bar | `E − 2μ`, so that `C_1111 = E` |
    /// | plane stress | `E ν / (1 − ν²)` |
    /// | plane strain, solid | `E ν / ((1 + ν) (1 − 2ν))` |
    ///
    /// μ is the shear modulus in every case.
    ///
    /// # Errors
    /// `MaterialError::Kinematics` if the kinematics belong to another dimension than `D`.
    pub fn lame<const D: usize>(
        &self,
        kinematics: Kinematics,
    ) -> Result<(f64, f64), MaterialError> {
        if kinematics.dimension() != D {
            return Err(MaterialError::Kinematics {
                kinematics,
                dimension: D,
            });
        }
        let (e, nu) = (self.youngs_modulus, self.poisson_ratio);
        let mu = self.shear_modulus();
        let lambda = match kinematics {
            Kinematics::Bar => e - 2.0 * mu,
            Kinematics::PlaneStress => e * nu / (1.0 - nu * nu),
            Kinematics::PlaneStrain | Kinematics::Solid => e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
        };
        Ok((lambda, mu))
    }

    /// The stiffness tensor \[Pa\] of `D` dimensions.
    ///
    /// # Errors
    /// `MaterialError::Kinematics` if the kinematics belong to another dimension than `D`.
    pub fn stiffness<const D: usize>(
        &self,
        kinematics: Kinematics,
    ) -> Result<Tensor4<D>, MaterialError> {
        let (lambda, mu) = self.lame::<D>(kinematics)?;
        Ok(Tensor4::isotropic(lambda, mu))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::Tensor;

    #[test]
    fn reduced_laws_are_the_solid_with_its_constraint() {
        let solid = Elastic::new(210e9, 0.3, 7800.0).unwrap();
        let c3 = solid.stiffness::<3>(Kinematics::Solid).unwrap();
        // Hooke's law in compliance form, sigma to epsilon, is the independent reference
        let (e, nu) = (210e9, 0.3);
        let strain_of =
            |s: Tensor<3>| s * ((1.0 + nu) / e) - Tensor::identity() * (nu / e * s.trace());
        let s = Tensor::<3>::new(3e6, 1e6, 0.0, 1e6, -2e6, 0.0, 0.0, 0.0, 0.0);
        let strain = strain_of(s);
        assert!((c3.contract(&strain) - s).amax() < 1e-8 * s.amax());

        let in_plane = strain.fixed_view::<2, 2>(0, 0).into_owned();
        let c2 = solid.stiffness::<2>(Kinematics::PlaneStress).unwrap();
        let expected = s.fixed_view::<2, 2>(0, 0).into_owned();
        assert!((c2.contract(&in_plane) - expected).amax() < 1e-12 * s.amax());

        let mut flat = Tensor::<3>::zeros();
        flat.fixed_view_mut::<2, 2>(0, 0).copy_from(&in_plane);
        let expected = c3.contract(&flat).fixed_view::<2, 2>(0, 0).into_owned();
        let c2 = solid.stiffness::<2>(Kinematics::PlaneStrain).unwrap();
        assert!((c2.contract(&in_plane) - expected).amax() < 1e-12 * s.amax());

        let c1 = solid.stiffness::<1>(Kinematics::Bar).unwrap();
        assert!((c1.get(0, 0, 0, 0) / e - 1.0).abs() < 1e-15);
    }
}
