//! The shape tensor of a family and its inverse.

use super::moment_fitted_weights::place;
use crate::tensor::{Tensor, Vector, inverse, least_eigenvalue};

/// Largest condition number of a shape tensor that is inverted.
///
/// `|K| |K⁻¹|` in the Frobenius norm: 3 for a full 3D family, and beyond 1e12 rounding of coordinates decides the inverse.
pub const SHAPE_CONDITION_LIMIT: f64 = 1e10;

/// Shape tensor `K = Σ ω ξ⊗ξ V` over the bonds `(ξ, V)` of one family.
///
/// Source: [SAND2015-7998] eq. (6.30) and section 7.2. Units: ξ \[m\], V [m^D] → [m^(D+2)] times those of ω.
pub fn shape_tensor<const D: usize>(bonds: &[(Vector<D>, f64)], omega: &[f64]) -> Tensor<D> {
    let mut k = Tensor::zeros();
    for ((xi, volume), w) in bonds.iter().zip(omega) {
        k += xi * xi.transpose() * (w * volume);
    }
    k
}

/// A shape tensor that cannot be inverted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "{}shape tensor of a family of {bonds} bonds has condition number {condition:.1e} (limit {limit:.0e}): the bonds are too few, \
     or lie in one line or plane; widen the horizon there or fill the family",
    place(point),
    limit = SHAPE_CONDITION_LIMIT
)]
pub struct ShapeError {
    /// The point, once [`ShapeError::at`] has told.
    pub point: Option<usize>,
    /// Bonds in the family.
    pub bonds: usize,
    /// `|K| |K⁻¹|`, infinite if K is singular to the last digit.
    pub condition: f64,
}

impl ShapeError {
    /// The same error, naming the point of the family.
    pub fn at(mut self, index: usize) -> Self {
        self.point = Some(index);
        self
    }
}

/// `K⁻¹` of a family's shape tensor; `bonds` is the family's size, for the message.
///
/// # Errors
/// [`ShapeError`] if the condition number exceeds [`SHAPE_CONDITION_LIMIT`].
pub fn invert_shape_tensor<const D: usize>(
    k: &Tensor<D>,
    bonds: usize,
) -> Result<Tensor<D>, ShapeError> {
    let inverse = k.try_inverse();
    let condition = inverse.map_or(f64::INFINITY, |i| i.norm() * k.norm());
    match inverse {
        Some(inverse) if condition <= SHAPE_CONDITION_LIMIT => Ok(inverse),
        _ => Err(ShapeError {
            point: None,
            bonds,
            condition,
        }),
    }
}

/// Least share of the second moment K that intact bonds have to keep, along the direction along which they keep the least.
pub const SPANNED: f64 = 0.2;

/// `K⁻¹` of the intact bonds of a family whose bonds had the shape tensor `whole`, those `left` of a family that has lost some; none if they do not span the space by [`SPANNED`].
pub(crate) fn spanned_inverse<const D: usize>(
    whole: &Tensor<D>,
    left: Option<&Tensor<D>>,
) -> Option<Tensor<D>> {
    let Some(left) = left else {
        return Some(inverse(whole)?.0);
    };
    // K = L Lᵀ: the least eigenvalue of L⁻¹ K_left L⁻ᵀ
    let (root, _) = inverse(&whole.cholesky()?.l())?;
    match least_eigenvalue(&(root * left * root.transpose())) >= SPANNED {
        true => Some(inverse(left)?.0),
        false => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_lattice_family_has_an_isotropic_shape_tensor() {
        // The six nearest neighbours at h = 0.5, V = h³, ω = 3: K = 3 · 2 h² · h³ I.
        let h = 0.5f64;
        let bonds: Vec<(Vector<3>, f64)> = (0..6)
            .map(|k| {
                let mut xi = Vector::<3>::zeros();
                xi[k / 2] = if k % 2 == 0 { h } else { -h };
                (xi, h.powi(3))
            })
            .collect();
        let k = shape_tensor(&bonds, &[3.0; 6]);
        assert!((k - Tensor::<3>::identity() * (6.0 * h.powi(5))).amax() < 1e-15);
        let inverse = invert_shape_tensor(&k, 6).unwrap();
        assert!((inverse * k - Tensor::<3>::identity()).amax() < 1e-15);
        let m: f64 = crate::peridynamics::moment_fitted_weights::weighted_volume(&bonds, &[3.0; 6]);
        assert!((m - k.trace()).abs() < 1e-15);
    }

    #[test]
    fn bonds_in_one_plane_or_line_are_refused_at_their_point() {
        // A plane tilted against the axes, so that no component of K is zero.
        let (a, b) = (
            Vector::<3>::new(1.0, 0.3, -0.2),
            Vector::<3>::new(-0.4, 0.9, 0.7),
        );
        let bonds: Vec<(Vector<3>, f64)> = (0..9)
            .map(|k| (a * f64::from(k % 3 - 1) + b * f64::from(k / 3 - 1), 0.1))
            .collect();
        let k = shape_tensor(&bonds, &[1.0; 9]);
        let error = invert_shape_tensor(&k, 9).unwrap_err().at(17).to_string();
        assert!(
            error.contains("point 17")
                && error.contains("9 bonds")
                && error.contains("one line or plane"),
            "{error}"
        );
        let line = shape_tensor(&[(Vector::<2>::new(0.3, 0.7), 1.0)], &[1.0]);
        assert!(invert_shape_tensor(&line, 1).is_err());
        assert!(invert_shape_tensor(&Tensor::<2>::zeros(), 0).is_err());
        assert!(invert_shape_tensor(&Tensor::<2>::repeat(f64::NAN), 3).is_err());
        // Lifted out of its plane, the same family passes, with the condition that the lift allows.
        let mut lifted = bonds;
        lifted[0].0 += a.cross(&b) * 0.1;
        assert!(invert_shape_tensor(&shape_tensor(&lifted, &[1.0; 9]), 9).is_ok());
    }
}
