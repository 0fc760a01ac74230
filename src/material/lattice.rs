//! A local law given by its stiffness tensor.

use super::{LocalLaw, MaterialError};
use crate::tensor::Tensor4;

/// A linear law given by its tensor: what a regular peridynamic lattice is to an affine field,
/// `C = ½ Σ λ(|ξ|) ξ⊗ξ⊗ξ⊗ξ V`.
///
/// Beside such a lattice it leaves no jump of stiffness at a seam, where the analytic constants would.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice<const D: usize> {
    stiffness: Tensor4<D>,
    density: f64,
}

impl<const D: usize> Lattice<D> {
    /// The law `σ = C : G` of the tensor C \[Pa\] with density [kg/m³].
    ///
    /// # Errors
    /// `MaterialError::NotFinite` for a component that is not a number, `MaterialError::Asymmetric` unless
    /// C has its minor symmetries (else a rotation would be stressed) and its major one (else there is no energy),
    /// `MaterialError::Density` unless the density is zero or positive.
    pub fn new(stiffness: Tensor4<D>, density: f64) -> Result<Self, MaterialError> {
        if !(density.is_finite() && density >= 0.0) {
            return Err(MaterialError::Density { value: density });
        }
        let (mut minor, mut major) = (0.0f64, 0.0f64);
        for i in 0..D {
            for j in 0..D {
                for k in 0..D {
                    for l in 0..D {
                        let c = stiffness.get(i, j, k, l);
                        if !c.is_finite() {
                            return Err(MaterialError::NotFinite {
                                i: i + 1,
                                j: j + 1,
                                k: k + 1,
                                l: l + 1,
                                value: c,
                            });
                        }
                        minor = minor
                            .max((c - stiffness.get(j, i, k, l)).abs())
                            .max((c - stiffness.get(i, j, l, k)).abs());
                        major = major.max((c - stiffness.get(k, l, i, j)).abs());
                    }
                }
            }
        }
        let scale = stiffness.amax();
        for (symmetry, difference) in [("minor", minor), ("major", major)] {
            if difference > 1e-10 * scale {
                return Err(MaterialError::Asymmetric {
                    symmetry,
                    relative: difference / scale,
                });
            }
        }
        Ok(Self { stiffness, density })
    }

    /// Density [kg/m³].
    pub fn density(&self) -> f64 {
        self.density
    }
}

impl<const D: usize> LocalLaw<D> for Lattice<D> {
    fn tangent(&self) -> &Tensor4<D> {
        &self.stiffness
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensors_without_energy_or_objectivity_are_refused() {
        let mut c = Tensor4::<2>::isotropic(1.0, 1.0);
        assert!(Lattice::new(c, 1.0).is_ok());
        c.0[0][1][(0, 1)] += 1e-3;
        let message = Lattice::new(c, 1.0).unwrap_err().to_string();
        assert!(message.contains("minor"), "{message}");
        let mut c = Tensor4::<2>::isotropic(1.0, 1.0);
        c.0[0][0][(1, 1)] += 1e-3;
        let message = Lattice::new(c, 1.0).unwrap_err().to_string();
        assert!(message.contains("major"), "{message}");
        c.0[1][0][(1, 1)] = f64::NAN;
        let message = Lattice::new(c, 1.0).unwrap_err().to_string();
        assert!(message.contains("C2122"), "{message}");
    }
}
