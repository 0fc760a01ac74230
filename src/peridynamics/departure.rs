//! Departure of a law from its linearisation: the behaviour that finite elements and rows that keep to the linearisation lack.

use crate::{
    material::LocalLaw,
    tensor::{Tensor, least_eigenvalue},
};

/// Departure of a law from [`crate::peridynamics::Law::linearised`] under a uniform strain that is reached at once and then held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Departure {
    /// Nothing, whatever the strain and the time.
    None,
    /// Something that begins at a strain.
    AtStrain {
        /// The strain over that at which it begins \[1\]; nothing has begun up to 1.
        factor: f64,
        /// The behaviour that begins, as a clause: "its bonds soften".
        begins: &'static str,
        /// Means by which finite elements do it too, or something like it, in words of a scene; none if there is none.
        in_elements: Option<&'static str>,
    },
    /// A loss of stress with the time.
    WithTime {
        /// The part of the stress at once that is lost \[1\].
        lost: f64,
        /// As of [`Departure::AtStrain`].
        in_elements: Option<&'static str>,
    },
}

/// The material in which finite elements lose their stiffness by damage, in words of a scene.
pub(crate) const DAMAGED_ELEMENTS: &str =
    "the material damage-correspondence, whose elements soften";

/// Part of a linear stress by which that of a law has to differ before it counts as another.
const DIFFERENT: f64 = 0.05;

/// Part of a linear stress up to which a difference is none: of rounding, and of large strains a millionth as large as those of the body.
const SAME: f64 = 1e-3;

/// Returns the departure of a local law from its tangent at rest, by its response: to the strain at once, then held for a `time` \[s\].
pub(crate) fn of_local_law<const D: usize>(
    law: &dyn LocalLaw<D>,
    strain: &Tensor<D>,
    time: f64,
) -> Departure {
    /// Part of the strain that no law takes for large.
    const SMALL: f64 = 1e-6;
    /// Halvings of the interval in which the departure begins: to six digits.
    const HALVINGS: usize = 20;
    let different = |scale: f64| {
        let strain = strain * scale;
        let linear = law.tangent().contract(&strain);
        let (mut past, mut present) = (
            vec![0.0; law.history().len()],
            vec![0.0; law.history().len()],
        );
        law.respond(&strain, 0.0, &past, &mut present);
        past.copy_from_slice(&present);
        let held = law.respond(&strain, time, &past, &mut present);
        (held.stress - linear).norm() / linear.norm()
    };
    let lost = different(SMALL);
    if lost > SAME {
        return Departure::WithTime {
            lost,
            in_elements: None,
        };
    }
    let whole = different(1.0);
    let factor = if whole > DIFFERENT {
        let (mut within, mut beyond) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (within + beyond);
            if different(middle) > DIFFERENT {
                beyond = middle;
            } else {
                within = middle;
            }
        }
        1.0 / beyond
    } else {
        // a strain without stress is none
        (whole / DIFFERENT).min(1.0)
    };
    Departure::AtStrain {
        factor,
        begins: "its stress departs from proportion to the strain by 5 %",
        in_elements: None,
    }
}

/// The largest principal value of a strain; zero of one that is compressive in all directions.
pub fn largest_extension<const D: usize>(strain: &Tensor<D>) -> f64 {
    // the least eigenvalue is known of what is not negative
    let size = strain.norm();
    let shifted = Tensor::<D>::identity() * size - strain;
    (size - least_eigenvalue(&shifted)).max(0.0)
}

/// The stretch of either sign at which the force of a bond `s (1 + β s²)` differs from proportion as much as counts.
pub(crate) fn stretch_of_cubic(beta: f64) -> f64 {
    (DIFFERENT / beta.abs()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::Vector;

    #[test]
    fn the_largest_extension_is_a_principal_value() {
        let turned = nalgebra::Rotation2::new(0.7).into_inner();
        let of = |a: f64, b: f64| {
            let diagonal = Tensor::<2>::from_diagonal(&Vector::from([a, b]));
            largest_extension(&(turned * diagonal * turned.transpose()))
        };
        assert!((of(0.3, -0.8) - 0.3).abs() < 1e-15);
        assert!((of(-0.1, 0.02) - 0.02).abs() < 1e-15);
        assert_eq!(of(-0.1, -0.2), 0.0);
        assert_eq!(largest_extension(&Tensor::<1>::from_element(0.25)), 0.25);
    }
}
