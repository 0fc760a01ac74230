//! Local laws: displacement gradient to stress, energy and tangent. A law knows no mesh and no unknowns.
//!
//! | file | law |
//! |---|---|
//! | `elastic.rs` | isotropic linear elasticity of a bar, in plane stress, plane strain and of a solid |
//! | `orthotropic.rs` | orthotropic linear elasticity, with axes that may turn from place to place |
//! | `j2.rs` | von Mises plasticity with isotropic hardening, for small strains |
//! | `hardening.rs` | its yield stress: linear, Voce, Johnson–Cook |
//! | `hyperelastic.rs` | St Venant–Kirchhoff and Neo-Hooke, for strains of any size |
//! | `logarithmic_j2.rs` | the same for strains of any size |
//! | `scalar_damage.rs`, `softening.rs` | isotropic scalar damage with a tensile strength and a fracture energy, and its softening |
//! | `generalised_maxwell.rs`, `prony.rs` | linear viscoelasticity: a Prony series of the shear modulus, for small strains |
//! | `expanding.rs` | any law of solids that expands with its temperature |
//! | `reduction.rs` | any law of solids in bars, plates and long bodies |
//! | `algorithmic_tangent.rs` | differences of any law, for its algorithmic tangent |
//! | `user_routine.rs` | settings of a scene for a user's compiled routine; crate `bondline-umat` loads it and makes a law of it |
//!
//! A law takes the gradient `G_ij = ∂u_i/∂x_j` \[1\] at the end of a step and the history variables, and gives the first Piola–Kirchhoff stress `P` \[Pa\] (for small strains there is but one stress),
//! the energies stored and dissipated \[J/m^D\], and the tangent of the undeformed body `C = ∂P/∂G` \[Pa\]. It serves the points of a correspondence material and the quadrature points of finite elements.
//! A new law is one file and one line in the table of the conformance tests, which check for every law that these belong together, that nothing is stressed at rest, and that a rotation
//! (linearised, where the law is for small strains) stresses nothing.

mod algorithmic_tangent;
mod elastic;
mod expanding;
mod generalised_maxwell;
mod hardening;
mod hyperelastic;
mod j2;
mod logarithmic_j2;
mod orthotropic;
#[cfg(test)]
mod path_tests;
mod prony;
mod reduction;
mod scalar_damage;
mod softening;
#[cfg(test)]
mod tangent_tests;
mod user_routine;

pub(crate) use algorithmic_tangent::central_differences;
pub use elastic::Elastic;
pub use expanding::{Expanding, begin_heating, heat_work};
pub use generalised_maxwell::GeneralisedMaxwell;
pub use hardening::{Hardening, JohnsonCook};
pub use hyperelastic::{NeoHooke, StVenantKirchhoff};
pub use j2::J2;
pub use logarithmic_j2::LogarithmicJ2;
pub use orthotropic::{Axes, EngineeringConstants, Orthotropic, OrthotropicError, PAIRS};
pub use prony::{Arm, Carried, PronySeries, PronyStep};
pub use reduction::Reduced;
pub use scalar_damage::{
    EquivalentStrain, RESIDUAL, ScalarDamage, ScalarDamageSettings, SofteningCurve,
};
pub use softening::Envelope;
pub(crate) use user_routine::routine_loader;
pub use user_routine::{
    RoutineError, RoutineLoader, UmatEnergies, UmatSettings, set_routine_loader,
};

use std::sync::Arc;

use crate::tensor::{Tensor, Tensor4, principal_values};

/// Kinematic assumption by which a body of one, two or three dimensions represents a solid.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Hash,
    serde::Serialize,
    serde::Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "KinematicsSpec")]
pub enum Kinematics {
    /// One dimension: uniaxial stress.
    Bar,
    /// Two dimensions: a thin plate.
    PlaneStress,
    /// Two dimensions: a long body.
    PlaneStrain,
    /// Three dimensions.
    Solid,
}

impl Kinematics {
    /// All of them.
    pub const ALL: &'static [Self] =
        &[Self::Bar, Self::PlaneStress, Self::PlaneStrain, Self::Solid];

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
        /// The value given \[Pa\].
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
        /// The value given.
        value: f64,
    },
    /// The density is negative or not finite.
    #[error(
        "the density is {value}, but must be zero or positive and finite; a static run does not use it and accepts 0"
    )]
    Density {
        /// The value given [kg/m³].
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
        /// The kinematics given.
        kinematics: Kinematics,
        /// Dimension of the mesh.
        dimension: usize,
    },
}

/// A band of localised deformation in which a law cannot have its fracture energy.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "a crack band of the width {width:.4e} is too wide for the tensile strength {strength:e} and the fracture energy {energy:e}: at the strength it stores more than that energy, and would snap back; it has to be narrower than 2 E G/f² = {widest:.4e}"
)]
pub struct WideBand {
    /// Its width h \[m\].
    pub width: f64,
    /// The width above which this happens \[m\].
    pub widest: f64,
    /// Tensile strength \[Pa\].
    pub strength: f64,
    /// Fracture energy \[J/m²\].
    pub energy: f64,
}

/// The law in such a band, or the reason against it.
pub type Banded<const D: usize> = Result<Arc<dyn LocalLaw<D>>, WideBand>;

/// Response of a local law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalResponse<const D: usize> {
    /// First Piola–Kirchhoff stress at the end of the step \[Pa\], force per undeformed area; symmetric where the law is for small strains.
    pub stress: Tensor<D>,
    /// Normal Cauchy stress out of the body's plane \[Pa\]; zero in a bar, in plane stress and in a solid.
    pub across: f64,
    /// Volume over undeformed volume, `J = det F` of the solid; 1 where the law is for small strains.
    pub volume_ratio: f64,
    /// Energy stored then \[J/m^D\]; zero at rest.
    pub stored: f64,
    /// Energy dissipated within the step \[J/m^D\].
    pub dissipated: f64,
}

impl<const D: usize> LocalResponse<D> {
    /// The Cauchy stress `σ = P Fᵀ/J` \[Pa\] at the displacement gradient that gave this response; the stress itself where the law is for small strains.
    pub fn cauchy(&self, gradient: &Tensor<D>, is_objective: bool) -> Tensor<D> {
        match is_objective {
            true => self.stress * (Tensor::identity() + gradient).transpose() / self.volume_ratio,
            false => self.stress,
        }
    }

    /// The principal values of that stress and of the one out of the plane \[Pa\], in any order.
    pub fn principal_stresses(&self, gradient: &Tensor<D>, is_objective: bool) -> [f64; 3] {
        let cauchy = self.cauchy(gradient, is_objective);
        let mut whole = Tensor::<3>::zeros();
        for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
            whole[(i, j)] = 0.5 * (cauchy[(i, j)] + cauchy[(j, i)]);
        }
        if D < 3 {
            whole[(2, 2)] = self.across;
        }
        principal_values(&whole)
    }
}

/// Memory of a local law at a point; all numbers are zero at the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LocalHistory {
    /// The names of the numbers. Those without a name are not shown.
    pub names: &'static [&'static str],
    /// Index of the damage D among the numbers, by which the law loses its stiffness; none of a law without damage.
    pub damage: Option<usize>,
    /// Index of the free stretch `α ΔT` among the numbers, for the owner of a temperature to write before each response; none of a law that does not expand by itself.
    pub free_stretch: Option<usize>,
    /// True of a law whose response depends on how the deformation came about.
    pub is_path_dependent: bool,
}

impl LocalHistory {
    /// A law without memory.
    pub const NONE: Self = Self::of(&[]);

    /// A law with these history variables, none of them a damage.
    pub const fn of(names: &'static [&'static str]) -> Self {
        Self {
            names,
            damage: None,
            free_stretch: None,
            is_path_dependent: !names.is_empty(),
        }
    }

    /// Count of the numbers.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// True of a law without memory.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }
}

/// The central differences of [`LocalLaw::respond`].
pub fn differenced_tangent<const D: usize>(
    law: &(impl LocalLaw<D> + ?Sized),
    gradient: &Tensor<D>,
    step: f64,
    past: &[f64],
) -> Tensor4<D> {
    central_differences(gradient, past.len(), |gradient, present| {
        law.respond(gradient, step, past, present).stress
    })
}

/// A local law: stress and energies of a displacement gradient, and of the history.
pub trait LocalLaw<const D: usize>: Send + Sync + std::fmt::Debug {
    /// `C_ijkl = ∂P_ij/∂G_kl` of the undeformed body \[Pa\].
    fn tangent(&self) -> &Tensor4<D>;

    /// Returns true if the stress is `C : G`, whatever came before.
    fn is_linear(&self) -> bool;

    /// Returns true if it holds for strains of any size: a rotation of the deformed body rotates its stress, `P(Q F) = Q P(F)`.
    fn is_objective(&self) -> bool;

    /// The history variables of a point.
    fn history(&self) -> LocalHistory;

    /// Returns true if it flows without a change of volume, so that cells with a dilatation at each quadrature point would resist it.
    fn flows_at_constant_volume(&self) -> bool;

    /// The response at the end of a step of the length `step` \[s\]; `gradient` is `G_ij = ∂u_i/∂x_j`. Overwrites `present` with what is remembered then; `past` is what was at its beginning.
    fn respond(
        &self,
        gradient: &Tensor<D>,
        step: f64,
        past: &[f64],
        present: &mut [f64],
    ) -> LocalResponse<D>;

    /// The law where its deformation localises in a band of the width `width` \[m\]: of a law whose softening takes an energy per area, so that what it does at a point depends on that length. None of a law without one.
    fn in_band(&self, width: f64) -> Option<Banded<D>>;

    /// The algorithmic tangent `C_ijkl = ∂P_ij/∂G_kl` of [`LocalLaw::respond`] \[Pa\], with which Newton's method converges quadratically; where it has a kink, at the onset of flow, that of either side.
    /// Not a number where there is no response. A law that says nothing has the central differences of its response, `2 D²` of them.
    fn algorithmic_tangent(&self, gradient: &Tensor<D>, step: f64, past: &[f64]) -> Tensor4<D> {
        differenced_tangent(self, gradient, step, past)
    }

    /// Returns true if `C_ijkl = C_klij` holds for [`LocalLaw::algorithmic_tangent`], so that solvers may take a stiffness made of it for a symmetric one.
    fn has_symmetric_tangent(&self) -> bool {
        false
    }

    /// Returns the last failure within the law, with its remedy; none of a law that computes what it is given. A response that failed is not a number.
    fn failure(&self) -> Option<String> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn elastic() -> Elastic {
        Elastic::new(72e9, 0.22, 2440.0).unwrap()
    }

    /// Every law in every dimension it has: the one line a new law adds.
    pub(super) fn laws<const D: usize>(
        kinematics: &[Kinematics],
    ) -> Vec<(String, Box<dyn LocalLaw<D>>)> {
        let mut laws: Vec<(String, Box<dyn LocalLaw<D>>)> = Vec::new();
        for kinematics in kinematics
            .iter()
            .filter(|k| J2::<D>::KINEMATICS.contains(k))
        {
            let (lambda, shear) = elastic().lame::<D>(*kinematics).unwrap();
            // yields far beyond the gradients of these tests
            let law = J2::<D>::new(lambda, shear, 1e10, 1e9);
            laws.push((format!("J2, {}", kinematics.name()), Box::new(law)));
        }
        let (lambda, shear) = elastic().lame::<3>(Kinematics::Solid).unwrap();
        let hardening = Hardening::Voce {
            yield_stress: 1e10,
            modulus: 1e9,
            saturation: 0.0,
            rate: 0.0,
        };
        let damage = ScalarDamage::new(ScalarDamageSettings {
            lambda,
            shear,
            strength: 1e10,
            energy: 1e10,
            measure: EquivalentStrain::Mazars,
            curve: SofteningCurve::Exponential,
        });
        let series = PronySeries::new(vec![(0.3, 0.4), (0.65, 2.5)]);
        let solids: [(&str, Arc<dyn LocalLaw<3>>); 6] = [
            (
                "generalised Maxwell",
                Arc::new(GeneralisedMaxwell::new(lambda, shear, series)),
            ),
            (
                "scalar damage",
                Arc::new(damage.banded(1.0).expect("14 at most")),
            ),
            (
                "J2 in logarithmic strains",
                Arc::new(LogarithmicJ2::new(lambda, shear, hardening)),
            ),
            (
                "J2 of solids",
                Arc::new(J2::<3>::new(lambda, shear, 1e10, 1e9)),
            ),
            (
                "St Venant–Kirchhoff",
                Arc::new(StVenantKirchhoff::new(lambda, shear)),
            ),
            ("Neo-Hooke", Arc::new(NeoHooke::new(lambda, shear))),
        ];
        for (name, law) in solids {
            for &k in kinematics {
                let reduced = Reduced::new(Arc::clone(&law), k);
                laws.push((format!("{name}, {}", k.name()), Box::new(reduced)));
            }
        }
        laws
    }

    fn conform<const D: usize>(kinematics: &[Kinematics]) {
        for (name, law) in laws::<D>(kinematics) {
            let past = vec![0.0; law.history().len()];
            // at once: what takes time has no energy whose derivative the stress is
            let respond = |g: &Tensor<D>| law.respond(g, 0.0, &past, &mut past.clone());
            let energy = |g: &Tensor<D>| respond(g).stored;
            let stress_of = |g: &Tensor<D>| respond(g).stress;
            let scale = law.tangent().amax();
            let g = Tensor::<D>::from_fn(|i, j| ((3 * i + 5 * j + 1) as f64).cos() * 1e-3);
            assert_eq!(energy(&Tensor::zeros()), 0.0, "{name}");
            assert_eq!(stress_of(&Tensor::zeros()).amax(), 0.0, "{name}");
            assert!(energy(&g) > 0.0, "{name}");
            let step = 1e-5;
            let stress = stress_of(&g);
            for k in 0..D {
                for l in 0..D {
                    let mut e = Tensor::<D>::zeros();
                    e[(k, l)] = step;
                    let dw = (energy(&(g + e)) - energy(&(g - e))) / (2.0 * step);
                    assert!(
                        (dw - stress[(k, l)]).abs() < 1e-9 * scale,
                        "{name}: stress {k}{l}"
                    );
                    let by = e * 1e-3;
                    let ds = (stress_of(&by) - stress_of(&-by)) / (2e-3 * step);
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
            if law.is_objective() {
                // a large one, in the plane of the first two directions
                let mut q = Tensor::<D>::identity();
                if D > 1 {
                    (q[(0, 0)], q[(1, 1)]) = (0.8f64.cos(), 0.8f64.cos());
                    (q[(0, 1)], q[(1, 0)]) = (-0.8f64.sin(), 0.8f64.sin());
                }
                let deformation = (Tensor::identity() + g * 100.0, stress_of(&(g * 100.0)));
                let turned = respond(&(q * deformation.0 - Tensor::identity()));
                let off = (turned.stress - q * deformation.1).amax();
                assert!(off < 1e-13 * scale, "{name}: rotation {off}");
                assert!((turned.stored - energy(&(g * 100.0))).abs() < 1e-13 * scale);
                let alone = stress_of(&(q - Tensor::identity())).amax();
                assert!(alone < 1e-14 * scale, "{name}: rotation alone");
                // angular momentum: the Cauchy stress is symmetric
                let kirchhoff = deformation.1 * deformation.0.transpose();
                let off = (kirchhoff - kirchhoff.transpose()).amax();
                assert!(off < 1e-13 * scale, "{name}: not symmetric {off}");
                continue;
            }
            assert!(stress_of(&skew).amax() <= 1e-15 * scale, "{name}: rotation");
            assert!(
                (stress_of(&(g + skew)) - stress).amax() <= 1e-15 * scale,
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
