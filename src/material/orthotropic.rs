//! Orthotropic linear elasticity: three planes of symmetry, whose normals are the axes 1, 2 and 3 of the material.
//!
//! ```text
//!   ε_11 = σ_11/E_1 − ν_12 σ_22/E_1 − ν_13 σ_33/E_1 + α_1 ΔT        2 ε_12 = σ_12/G_12
//!   ε_22 = σ_22/E_2 − ν_12 σ_11/E_1 − ν_23 σ_33/E_2 + α_2 ΔT        2 ε_13 = σ_13/G_13
//!   ε_33 = σ_33/E_3 − ν_13 σ_11/E_1 − ν_23 σ_22/E_2 + α_3 ΔT        2 ε_23 = σ_23/G_23
//! ```
//!
//! `ν_ij` is the contraction along j under a stress along i, and `ν_ij/E_i = ν_ji/E_j`. Source: [Lekhnitskii1963]. In bodies of fewer dimensions axis 3 is normal to the plane, and a bar runs along axis 1.

use std::fmt;
use std::sync::Arc;

use super::Kinematics;
use crate::tensor::{Tensor, Tensor4, Vector, inverse};

/// Pairs of axes, in the order of [`EngineeringConstants::poisson`] and [`EngineeringConstants::shear`].
pub const PAIRS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// Least determinant of the normalised compliance that is told from zero by the digits of its entries.
const SINGULAR: f64 = 1e-12;

/// Engineering constants of an orthotropic solid; those that the kinematics do not need are not looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EngineeringConstants {
    /// Young's moduli E₁, E₂, E₃ \[Pa\].
    pub young: [f64; 3],
    /// Poisson's ratios ν₁₂, ν₁₃, ν₂₃.
    pub poisson: [f64; 3],
    /// Shear moduli G₁₂, G₁₃, G₂₃ \[Pa\].
    pub shear: [f64; 3],
    /// Thermal expansions α₁, α₂, α₃ per degree.
    pub expansion: [f64; 3],
}

/// Constants with which a strain would store no energy, or less than none.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum OrthotropicError {
    /// A Poisson's ratio beyond its bound.
    #[error(
        "nu{pair} is {value}, but must lie between -{bound:.6} and {bound:.6}: |nu{pair}| < sqrt(E{}/E{}), beyond which a strain stores no energy", &pair[..1], &pair[1..]
    )]
    Ratio {
        /// Its axes, such as "12".
        pair: &'static str,
        /// The value given.
        value: f64,
        /// The bound `√(E_i/E_j)`.
        bound: f64,
    },
    /// Poisson's ratios that do not go together.
    #[error(
        "1 - nu12 nu21 - nu13 nu31 - nu23 nu32 - 2 nu21 nu32 nu13 is {determinant:.3e}, but must be positive, or a strain stores no energy (nu21 = nu12 E2/E1, nu31 = nu13 E3/E1, nu32 = nu23 E3/E2)"
    )]
    Determinant {
        /// The determinant of the compliance over that without contraction.
        determinant: f64,
    },
}

impl OrthotropicError {
    /// Names of the ratios, in the order of [`PAIRS`].
    const NAMES: [&'static str; 3] = ["12", "13", "23"];
}

/// An orthotropic, linearly elastic body in its own axes, validated.
#[derive(Clone, Debug, PartialEq)]
pub struct Orthotropic<const D: usize> {
    stiffness: Tensor4<D>,
    expansion: Vector<D>,
    across: Vector<D>,
    across_per_degree: f64,
    held_energy: f64,
}

impl<const D: usize> Orthotropic<D> {
    /// Numbers of the axes whose normal stresses and strains enter these kinematics.
    pub fn normals(kinematics: Kinematics) -> usize {
        match kinematics {
            Kinematics::Bar => 1,
            Kinematics::PlaneStress => 2,
            Kinematics::PlaneStrain | Kinematics::Solid => 3,
        }
    }

    /// Of the constants that the kinematics need, moduli being positive and finite.
    ///
    /// # Errors
    /// [`OrthotropicError`] unless every strain stores energy.
    pub fn new(
        constants: &EngineeringConstants,
        kinematics: Kinematics,
    ) -> Result<Self, OrthotropicError> {
        debug_assert_eq!(kinematics.dimension(), D);
        let EngineeringConstants {
            young: e,
            poisson,
            shear,
            expansion,
        } = constants;
        let normals = Self::normals(kinematics);
        // compliance times √(E_i E_j): 1 on the diagonal, and for axes that are not needed
        let mut compliance = Tensor::<3>::identity();
        for (k, (i, j)) in PAIRS.into_iter().enumerate().filter(|p| p.1.1 < normals) {
            let bound = (e[i] / e[j]).sqrt();
            let share = poisson[k] / bound;
            // also refuses what is not a number
            if share.is_nan() || share.abs() >= 1.0 {
                return Err(OrthotropicError::Ratio {
                    pair: OrthotropicError::NAMES[k],
                    value: poisson[k],
                    bound,
                });
            }
            compliance[(i, j)] = -share;
            compliance[(j, i)] = -share;
        }
        let found = inverse(&compliance).filter(|(_, determinant)| *determinant > SINGULAR);
        let Some((normal, _)) = found else {
            return Err(OrthotropicError::Determinant {
                determinant: crate::tensor::determinant(&compliance),
            });
        };
        let mut stiffness = Tensor4::zeros();
        for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
            stiffness.0[i][i][(j, j)] = normal[(i, j)] * (e[i] * e[j]).sqrt();
        }
        for (k, (i, j)) in PAIRS.into_iter().enumerate().filter(|p| p.1.1 < D) {
            for (a, b) in [(i, j), (j, i)] {
                stiffness.0[a][b][(a, b)] = shear[k];
                stiffness.0[a][b][(b, a)] = shear[k];
            }
        }
        // −S_3i/S_33: the stress across that keeps the strain there zero
        let is_held = kinematics == Kinematics::PlaneStrain;
        let across = Vector::from_fn(|i, _| match is_held {
            true => -compliance[(2, i)] * (e[2] / e[i]).sqrt(),
            false => 0.0,
        });
        let held_back = if is_held { expansion[2] } else { 0.0 };
        Ok(Self {
            stiffness,
            expansion: Vector::from_fn(|i, _| expansion[i] + across[i] * held_back),
            across,
            across_per_degree: if is_held { e[2] * expansion[2] } else { 0.0 },
            held_energy: if is_held {
                e[2] * expansion[2].powi(2)
            } else {
                0.0
            },
        })
    }

    /// The stiffness \[Pa\] of a body whose axes have the directions of the columns of `axes`.
    pub fn stiffness(&self, axes: &Tensor<D>) -> Tensor4<D> {
        self.stiffness.turned(axes)
    }

    /// Free strain per degree within the dimensions of the body; in plane strain `α_i + ν_i3 (E_3/E_i) α_3`.
    pub fn expansion(&self, axes: &Tensor<D>) -> Tensor<D> {
        axes * Tensor::from_diagonal(&self.expansion) * axes.transpose()
    }

    /// The normal stress out of the plane in plane strain \[Pa\], `Σ ν_i3 (E_3/E_i) σ_ii − E_3 α_3 ΔT` in the axes of the material; zero otherwise.
    pub fn across(&self, axes: &Tensor<D>, stress: &Tensor<D>, rise: f64) -> f64 {
        let own = axes.transpose() * stress * axes;
        own.diagonal().dot(&self.across) - self.across_per_degree * rise
    }

    /// Twice the energy per volume and squared degree of a body that the plane holds back across and that is free within, `E_3 α_3²` in plane strain \[Pa\]; zero otherwise.
    pub fn held_energy(&self) -> f64 {
        self.held_energy
    }
}

/// Directions of the axes of a material at a place, as columns.
#[derive(Clone)]
pub enum Axes<const D: usize> {
    /// The same everywhere.
    Fixed(Tensor<D>),
    /// By position.
    Field(AxesField<D>),
}

/// Directions of the axes by position, as columns; not numbers where there are none.
pub type AxesField<const D: usize> = Arc<dyn Fn(&Vector<D>) -> Tensor<D> + Send + Sync>;

impl<const D: usize> Axes<D> {
    /// At a place.
    pub fn at(&self, x: &Vector<D>) -> Tensor<D> {
        match self {
            Self::Fixed(axes) => *axes,
            Self::Field(field) => field(x),
        }
    }
}

impl<const D: usize> fmt::Debug for Axes<D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(axes) => write!(f, "{axes:?}"),
            Self::Field(_) => write!(f, "axes by position"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Elastic;
    use crate::tensor::strain;

    const LAMINA: EngineeringConstants = EngineeringConstants {
        young: [140.0, 10.0, 8.0],
        poisson: [0.3, 0.25, 0.4],
        shear: [5.0, 4.0, 3.0],
        expansion: [-1e-6, 2e-5, 3e-5],
    };

    fn turn() -> Tensor<3> {
        *nalgebra::Rotation3::from_euler_angles(0.4, -1.1, 2.3).matrix()
    }

    /// The largest difference of two tensors.
    fn off<const D: usize>(a: &Tensor4<D>, b: &Tensor4<D>) -> f64 {
        let mut difference = *a;
        difference.add_scaled(-1.0, b);
        difference.amax()
    }

    #[test]
    fn a_uniaxial_stress_stretches_and_contracts_as_the_constants_say() {
        let law = Orthotropic::<3>::new(&LAMINA, Kinematics::Solid).unwrap();
        let (e, [nu12, nu13, nu23]) = (LAMINA.young, LAMINA.poisson);
        let contracted = [
            [1.0, -nu12, -nu13],
            [-nu12 * e[1] / e[0], 1.0, -nu23],
            [-nu13 * e[2] / e[0], -nu23 * e[2] / e[1], 1.0],
        ];
        let axes = turn();
        let c = law.stiffness(&axes);
        for k in 0..3 {
            let own = Vector::<3>::from(contracted[k]) / e[k];
            let global = axes * Tensor::from_diagonal(&own) * axes.transpose();
            let stress = c.contract(&global);
            let along = axes.column(k) * axes.column(k).transpose();
            assert!((stress - along).amax() < 1e-14, "axis {k}: {stress}");
        }
        for (k, (i, j)) in PAIRS.into_iter().enumerate() {
            let sheared = axes.column(i) * axes.column(j).transpose();
            let stress = c.contract(&strain(&sheared));
            let expected = (sheared + sheared.transpose()) * LAMINA.shear[k];
            assert!((stress - expected).amax() < 1e-13, "pair {k}");
        }
    }

    #[test]
    fn equal_constants_are_those_of_an_isotropic_body() {
        let (e, nu) = (3.0, 0.3);
        let alike = EngineeringConstants {
            young: [e; 3],
            poisson: [nu; 3],
            shear: [0.5 * e / (1.0 + nu); 3],
            expansion: [2e-5; 3],
        };
        let elastic = Elastic::new(e, nu, 0.0).unwrap();
        let solid = Orthotropic::<3>::new(&alike, Kinematics::Solid).unwrap();
        let expected = elastic.stiffness::<3>(Kinematics::Solid).unwrap();
        assert!(off(&solid.stiffness(&turn()), &expected) < 1e-14);
        let angle = 0.7f64;
        let axes = Tensor::<2>::new(angle.cos(), -angle.sin(), angle.sin(), angle.cos());
        for kinematics in [Kinematics::PlaneStress, Kinematics::PlaneStrain] {
            let plane = Orthotropic::<2>::new(&alike, kinematics).unwrap();
            let expected = elastic.stiffness::<2>(kinematics).unwrap();
            assert!(off(&plane.stiffness(&axes), &expected) < 1e-14);
            let is_held = kinematics == Kinematics::PlaneStrain;
            let free = if is_held { 1.0 + nu } else { 1.0 } * 2e-5;
            assert!((plane.expansion(&axes) - Tensor::identity() * free).amax() < 1e-19);
            let stress = Tensor::<2>::new(1.0, 0.2, 0.2, -3.0);
            let expected = if is_held { -2.0 * nu - e * 2e-4 } else { 0.0 };
            assert!((plane.across(&axes, &stress, 10.0) - expected).abs() < 1e-15);
        }
        let bar = Orthotropic::<1>::new(&alike, Kinematics::Bar).unwrap();
        assert!((bar.stiffness(&Tensor::identity()).amax() - e).abs() < 1e-15);
    }

    #[test]
    fn plane_strain_is_the_solid_whose_strain_across_is_zero() {
        let solid = Orthotropic::<3>::new(&LAMINA, Kinematics::Solid).unwrap();
        let plane = Orthotropic::<2>::new(&LAMINA, Kinematics::PlaneStrain).unwrap();
        let (c, s) = (0.3f64.cos(), 0.3f64.sin());
        let axes = Tensor::<2>::new(c, -s, s, c);
        let whole = Tensor::<3>::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
        let rise = 50.0;
        let g = Tensor::<2>::new(1e-3, 2e-4, 2e-4, -3e-3);
        let mechanical = g - plane.expansion(&axes) * rise;
        let stress = plane.stiffness(&axes).contract(&mechanical);
        let mut g3 = Tensor::<3>::zeros();
        g3.fixed_view_mut::<2, 2>(0, 0).copy_from(&g);
        let expected = (solid.stiffness(&whole)).contract(&(g3 - solid.expansion(&whole) * rise));
        for (i, j) in [(0, 0), (0, 1), (1, 1)] {
            assert!((stress[(i, j)] - expected[(i, j)]).abs() < 1e-15);
        }
        let across = plane.across(&axes, &stress, rise);
        assert!((across - expected[(2, 2)]).abs() < 1e-15, "{across}");
    }

    #[test]
    fn a_turned_stiffness_keeps_its_symmetries_to_the_last_digit() {
        let law = Orthotropic::<3>::new(&LAMINA, Kinematics::Solid).unwrap();
        let c = law.stiffness(&turn());
        let [i, j, k, l] = [0, 1, 1, 2];
        for other in [c.get(j, i, k, l), c.get(i, j, l, k), c.get(k, l, i, j)] {
            assert_eq!(c.get(i, j, k, l).to_bits(), other.to_bits());
        }
    }

    #[test]
    fn constants_without_energy_are_refused_with_the_bound() {
        let beyond = EngineeringConstants {
            poisson: [3.8, 0.25, 0.4],
            ..LAMINA
        };
        for kinematics in [Kinematics::PlaneStress, Kinematics::PlaneStrain] {
            let said = Orthotropic::<2>::new(&beyond, kinematics).unwrap_err();
            let said = said.to_string();
            assert!(
                said.contains("nu12 is 3.8") && said.contains("3.741657"),
                "{said}"
            );
        }
        let together = EngineeringConstants {
            poisson: [3.0, 3.5, 0.9],
            ..LAMINA
        };
        let said = Orthotropic::<3>::new(&together, Kinematics::Solid).unwrap_err();
        assert!(matches!(said, OrthotropicError::Determinant { .. }));
        // the plane does not know of axis 3
        let thin = Orthotropic::<2>::new(&together, Kinematics::PlaneStress);
        assert!(thin.is_ok());
    }
}
