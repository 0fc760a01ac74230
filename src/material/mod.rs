//! Local laws: displacement gradient to stress, energy and tangent. A law knows no mesh and no unknowns.
//!
//! | file | law |
//! |---|---|
//! | `elastic.rs` | isotropic linear elasticity of a bar, in plane stress, plane strain and of a solid |
//! | `lattice.rs` | a law given by its tensor, such as the fourth moments of a peridynamic lattice |
//!
//! A law takes the gradient `G_ij = ∂u_i/∂x_j` \[1\] and gives the energy density `W(G)` \[Pa\], the stress
//! `σ = ∂W/∂G` \[Pa\] and the tangent `C = ∂σ/∂G` \[Pa\]. A new law is one file, one line in the list below and one line
//! in the table of the conformance tests, which check for every law that these three belong together, that nothing
//! is stressed at rest, and that a (linearised) rotation stresses nothing.

mod elastic;
mod lattice;

pub use elastic::{Elastic, LinearElastic};
pub use lattice::Lattice;

use crate::tensor::{Tensor, Tensor4};

/// How a body of `D` dimensions stands for a solid of three.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kinematics {
    /// 1D: uniaxial stress, the sides are free to contract.
    Bar,
    /// 2D: no stress out of the plane (a thin plate).
    PlaneStress,
    /// 2D: no strain out of the plane (a long body).
    PlaneStrain,
    /// 3D.
    Solid,
}

impl Kinematics {
    /// The dimension in which these kinematics make sense.
    pub fn dimension(self) -> usize {
        match self {
            Self::Bar => 1,
            Self::PlaneStress | Self::PlaneStrain => 2,
            Self::Solid => 3,
        }
    }

    /// The name, as a scene spells it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bar => "bar",
            Self::PlaneStress => "plane-stress",
            Self::PlaneStrain => "plane-strain",
            Self::Solid => "solid",
        }
    }
}

/// A value or a combination that no material can have.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// Young's modulus is not positive and finite.
    #[error(
        "Young's modulus is {value}, but must be positive and finite; give it in the scene's unit of stress, such as 72e9 for 72 GPa"
    )]
    YoungsModulus {
        /// What was given \[Pa\].
        value: f64,
    },
    /// Poisson's ratio is outside of (-1, 0.5).
    #[error(
        "Poisson's ratio is {value}, but must be above -1 and below 0.5{}",
        if *value == 0.5 {
            ": at 0.5 the material is incompressible and its bulk modulus infinite; take a value below, such as 0.49"
        } else {
            ", outside of which the strain energy is not positive; most solids have 0 to 0.45"
        }
    )]
    PoissonRatio {
        /// What was given.
        value: f64,
    },
    /// The density is negative or not finite.
    #[error(
        "the density is {value}, but must be zero or positive and finite; a static run does not use it and accepts 0"
    )]
    Density {
        /// What was given [kg/m³].
        value: f64,
    },
    /// The kinematics belong to another dimension.
    #[error(
        "{} describes a body of {} dimension(s), but the mesh has {dimension}; use {}",
        kinematics.name(),
        kinematics.dimension(),
        match dimension { 1 => "bar", 2 => "plane-stress or plane-strain", _ => "solid" }
    )]
    Kinematics {
        /// What was given.
        kinematics: Kinematics,
        /// Dimension of the mesh.
        dimension: usize,
    },
    /// A tensor given for a law has a component that is not a number.
    #[error(
        "component C{i}{j}{k}{l} of the stiffness tensor is {value}, but must be finite; check the weights it was summed from"
    )]
    NotFinite {
        /// First index, from 1.
        i: usize,
        /// Second index.
        j: usize,
        /// Third index.
        k: usize,
        /// Fourth index.
        l: usize,
        /// The component \[Pa\].
        value: f64,
    },
    /// A tensor given for a law lacks a symmetry without which there is no energy or no objectivity.
    #[error(
        "the stiffness tensor differs from its {symmetry} transpose by {relative:.1e} of its largest component, but must agree to 1e-10; symmetrise it first"
    )]
    Asymmetric {
        /// `minor` (C_ijkl = C_jikl = C_ijlk) or `major` (C_ijkl = C_klij).
        symmetry: &'static str,
        /// Largest difference, relative to the largest component.
        relative: f64,
    },
}

/// A local law: stress and energy of a displacement gradient, here and now.
pub trait LocalLaw<const D: usize>: Send + Sync {
    /// `C_ijkl = ∂σ_ij/∂G_kl` \[Pa\], at rest.
    fn tangent(&self) -> &Tensor4<D>;

    /// The stress `σ(G)` \[Pa\]; `gradient` is `G_ij = ∂u_i/∂x_j`.
    fn stress(&self, gradient: &Tensor<D>) -> Tensor<D> {
        self.tangent().contract(gradient)
    }

    /// The energy density `W(G)` \[Pa\], zero at rest.
    fn energy(&self, gradient: &Tensor<D>) -> f64 {
        0.5 * self.stress(gradient).dot(gradient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::Vector;

    fn elastic() -> Elastic {
        Elastic::new(72e9, 0.22, 2440.0).unwrap()
    }

    /// Every law in every dimension it has: the one line a new law adds.
    fn laws<const D: usize>(kinematics: &[Kinematics]) -> Vec<(String, Box<dyn LocalLaw<D>>)> {
        let mut laws: Vec<(String, Box<dyn LocalLaw<D>>)> = Vec::new();
        for &k in kinematics {
            let law = LinearElastic::<D>::new(&elastic(), k).unwrap();
            laws.push((format!("linear elastic, {}", k.name()), Box::new(law)));
        }
        let mut moments = Tensor4::zeros();
        for n in 0..12 {
            let bond = Vector::<D>::from_fn(|i, _| ((n * 7 + i * 5) as f64).sin() + 0.2);
            moments.add_fourth_power(3e9, &bond);
        }
        laws.push((
            "lattice".into(),
            Box::new(Lattice::new(moments, 2440.0).unwrap()),
        ));
        laws
    }

    fn conform<const D: usize>(kinematics: &[Kinematics]) {
        for (name, law) in laws::<D>(kinematics) {
            let scale = law.tangent().amax();
            let g = Tensor::<D>::from_fn(|i, j| ((3 * i + 5 * j + 1) as f64).cos() * 1e-3);
            assert_eq!(law.energy(&Tensor::zeros()), 0.0, "{name}");
            assert_eq!(law.stress(&Tensor::zeros()).amax(), 0.0, "{name}");
            assert!(law.energy(&g) > 0.0, "{name}");
            let step = 1e-5;
            let stress = law.stress(&g);
            for k in 0..D {
                for l in 0..D {
                    let mut e = Tensor::<D>::zeros();
                    e[(k, l)] = step;
                    let dw = (law.energy(&(g + e)) - law.energy(&(g - e))) / (2.0 * step);
                    assert!(
                        (dw - stress[(k, l)]).abs() < 1e-9 * scale,
                        "{name}: stress {k}{l}"
                    );
                    let ds = (law.stress(&(g + e)) - law.stress(&(g - e))) / (2.0 * step);
                    for i in 0..D {
                        for j in 0..D {
                            let c = law.tangent().get(i, j, k, l);
                            assert!(
                                (ds[(i, j)] - c).abs() < 1e-9 * scale,
                                "{name}: tangent {i}{j}{k}{l}"
                            );
                        }
                    }
                }
            }
            let skew = (g - g.transpose()) * 0.5;
            assert!(
                law.stress(&skew).amax() <= 1e-15 * scale,
                "{name}: rotation"
            );
            assert!(
                (law.stress(&(g + skew)) - stress).amax() <= 1e-15 * scale,
                "{name}: added rotation"
            );
        }
    }

    #[test]
    fn every_law_conforms() {
        conform::<1>(&[Kinematics::Bar]);
        conform::<2>(&[Kinematics::PlaneStress, Kinematics::PlaneStrain]);
        conform::<3>(&[Kinematics::Solid]);
    }

    #[test]
    fn messages_name_value_and_remedy() {
        let half = Elastic::new(1.0, 0.5, 0.0).unwrap_err().to_string();
        assert!(
            half.contains("0.5") && half.contains("incompressible"),
            "{half}"
        );
        for bad in [-1.0, 0.7, f64::NAN] {
            let message = Elastic::new(1.0, bad, 0.0).unwrap_err().to_string();
            assert!(message.contains("above -1 and below 0.5"), "{message}");
        }
        for bad in [0.0, -72e9, f64::INFINITY, f64::NAN] {
            let message = Elastic::new(bad, 0.2, 0.0).unwrap_err().to_string();
            assert!(message.contains("positive and finite"), "{message}");
        }
        for bad in [-1.0, f64::NAN] {
            let message = Elastic::new(1.0, 0.2, bad).unwrap_err().to_string();
            assert!(message.contains("density"), "{message}");
        }
        let message = elastic()
            .stiffness::<3>(Kinematics::PlaneStress)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("plane-stress") && message.contains("use solid"),
            "{message}"
        );
    }
}
