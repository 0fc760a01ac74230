//! Peridynamic laws, one file each; [`crate::peridynamics::law`] defines their interface.
//!
//! | file | law | source |
//! |---|---|---|
//! | `bond_based.rs` | bonds that act alone | [SAND2015-7998] eq. (3.1) |
//! | `lps.rs` | linear peridynamic solid | eq. (5.16) |
//! | `correspondence.rs` | elastic correspondence, to first order | section 7.2 |
//! | `continuum_damage.rs` | bonds that lose their stiffness by damage | section 6.2 |
//! | `softening_bond.rs` | bonds that soften: strength and fracture energy | |
//! | `hardening.rs` | bonds that stiffen with their stretch | |
//! | `pals.rs`, `pave.rs`, `pave_dilatation.rs` | position-aware solid, linear (PALS) and viscoelastic (PAVE) | sections 4.2, 4.3 |
//! | `maxwell.rs` | viscoelastic bonds, one Maxwell arm | section 4.3 |
//! | `local_correspondence.rs` | correspondence with any local law | section 7.2 |
//! | `several.rs` | several materials of one law in one body | |
//! | `plastic.rs`, `johnson_cook.rs` | correspondence with J2 plasticity | |
//! | `viscoelastic.rs` | correspondence with linear viscoelasticity | section 4.3 |
//! | `relaxing.rs` | parameters of a shear modulus that relaxes | |
//! | `damage.rs` | correspondence with scalar damage | section 6.2.6 |
//! | `neo_hooke.rs`, `st_venant_kirchhoff.rs` | correspondence with hyperelasticity, for large deformations | |
//!
//! A law that implements [`NamedLaw`] and has its line in the list at the end of this file is a material of scenes, by its key.

mod bond_based;
mod continuum_damage;
mod correspondence;
mod damage;
mod hardening;
mod johnson_cook;
mod local_correspondence;
mod lps;
mod maxwell;
mod neo_hooke;
mod pals;
mod pave;
mod pave_dilatation;
mod plastic;
mod relaxing;
mod several;
mod softening_bond;
mod st_venant_kirchhoff;
mod viscoelastic;

use std::sync::Arc;

use crate::material::{Expanding, Kinematics, LocalLaw, Reduced};
use crate::peridynamics::failure::BondTraits;
use crate::peridynamics::{
    Influence, Law, Micromodulus, ZeroEnergyControl, force_state::PLASTIC_STRAIN,
};

pub use bond_based::BondBased;
pub use continuum_damage::ContinuumDamage;
pub use correspondence::Correspondence;
pub use damage::DamageCorrespondence;
pub use hardening::Hardening;
pub use johnson_cook::JohnsonCookCorrespondence;
pub use local_correspondence::LocalCorrespondence;
pub use lps::LinearPeridynamicSolid;
pub use maxwell::Maxwell;
pub use neo_hooke::NeoHookeSolid;
pub use pals::PositionAwareSolid;
pub use pave::PositionAwareViscoelasticSolid;
pub use plastic::PlasticCorrespondence;
pub use several::{NoMixture, Several, StiffnessMean};
pub use softening_bond::SofteningBond;
pub use st_venant_kirchhoff::StVenantKirchhoffSolid;
pub use viscoelastic::ViscoelasticCorrespondence;

/// A number, or a word, that a law takes beside the elastic constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its key in a scene.
    pub key: &'static str,
    /// Description of the parameter.
    pub about: &'static str,
    /// Its value if left out; none if it has to be given.
    pub default: Option<f64>,
    /// Its least value.
    pub least: f64,
    /// Its largest value.
    pub most: f64,
    /// A usual value, by which every law is tested.
    pub usual: f64,
    /// The words that it is chosen from; its value is the place of the word. Empty for a number.
    pub words: &'static [&'static str],
}

impl Parameter {
    /// A choice of words, the first if it is left out.
    pub const fn words(
        key: &'static str,
        about: &'static str,
        words: &'static [&'static str],
    ) -> Self {
        Self {
            key,
            about,
            default: Some(0.0),
            least: 0.0,
            most: (words.len() - 1) as f64,
            usual: 0.0,
            words,
        }
    }
}

/// Softening of bonds that break by a fracture energy. With the default a crack grows at the load of linear elastic fracture mechanics; with bonds that break at once the lattice traps it up to 1.4 times that load (`bondline verify growth`).
pub const SOFTENING: Parameter = Parameter {
    key: "softening",
    about: "Stretch at which a bond is through over that at which it begins to soften, with `fracture-energy`; 1 for bonds that break at once. 3 if left out, or 1 where bonds cannot soften.",
    default: Some(3.0),
    least: 1.0,
    most: 1e3,
    usual: 1.0,
    words: &[],
};

/// Poisson ratios that a law has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ratio {
    /// That of pairwise bonds: 1/4, in plane stress 1/3.
    Pairwise,
    /// Any: a scene gives it.
    Any,
}

/// Elastic constants of a scene's material, of its dimension \[Pa\], and other input of scenes for all laws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    /// Lamé's λ.
    pub lambda: f64,
    /// Shear modulus μ.
    pub shear: f64,
    /// The influence function ω of the scene, for laws that have one \[1\].
    pub influence: Influence,
    /// Shape of the stiffness of a bond over its length, for laws that have a choice \[1\].
    pub micromodulus: Micromodulus,
    /// Kinematics that the dimension stands for.
    pub kinematics: Kinematics,
    /// Density ρ [kg/m^D].
    pub density: f64,
    /// True of a body with a temperature, by which local laws expand.
    pub is_heated: bool,
}

impl Constants {
    /// The linearisation of a correspondence material with these constants and a zero-energy control, by its place in [`ZeroEnergyControl::WORDS`].
    pub fn correspondence<const D: usize>(
        &self,
        stabilisation: f64,
        control: f64,
    ) -> Correspondence<D> {
        Correspondence::new(self.influence, self.lambda, self.shear, stabilisation)
            .with_control(ZeroEnergyControl::of_place(control as usize), self.density)
    }

    /// The law of a solid in these kinematics, expanding where the body has a temperature.
    pub fn local<const D: usize>(&self, solid: Arc<dyn LocalLaw<3>>) -> Arc<dyn LocalLaw<D>> {
        let solid = match self.is_heated {
            true => Arc::new(Expanding::new(solid)),
            false => solid,
        };
        Arc::new(Reduced::new(solid, self.kinematics))
    }

    /// Lamé's λ of the solid of which the body is made \[Pa\].
    pub fn solid_lambda(&self) -> f64 {
        let (lambda, shear) = (self.lambda, self.shear);
        match self.kinematics {
            // λ + 2 μ is Young's modulus E, and ν = E/(2 μ) − 1
            Kinematics::Bar => {
                let poisson = 0.5 * lambda / shear;
                2.0 * shear * poisson / (1.0 - 2.0 * poisson)
            }
            Kinematics::PlaneStress => 2.0 * shear * lambda / (2.0 * shear - lambda),
            Kinematics::PlaneStrain | Kinematics::Solid => lambda,
        }
    }
}

/// A law as scenes name it: its key, its numbers, and how it is made of them.
pub trait NamedLaw<const D: usize> {
    /// The key of the material.
    const KEY: &'static str;
    /// Description of the law, in a sentence.
    const ABOUT: &'static str;
    /// Poisson ratios that it has.
    const RATIO: Ratio;
    /// Bodies that it holds for.
    const KINEMATICS: &'static [Kinematics];
    /// Parameters beside the elastic constants.
    const PARAMETERS: &'static [Parameter];

    /// Returns the key of the number to change, with the reason and the remedy, if these numbers conflict although each is within its limits.
    fn conflict(_values: &[f64]) -> Option<(&'static str, String)> {
        None
    }

    /// The law; `values` are those of [`NamedLaw::PARAMETERS`], each within its limits.
    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>>;
}

/// Every law of this folder with usual numbers, for tests that hold for all of them.
#[cfg(test)]
pub(crate) fn every<const D: usize>() -> Vec<Arc<dyn Law<D>>> {
    let constants = Constants {
        // a bar of Poisson's ratio 1/4
        lambda: if D == 1 { 0.65 } else { 1.7 },
        shear: 1.3,
        influence: Influence::Gaussian,
        micromodulus: Micromodulus::InverseDistance,
        kinematics: match D {
            1 => Kinematics::Bar,
            2 => Kinematics::PlaneStrain,
            _ => Kinematics::Solid,
        },
        density: 1.0,
        is_heated: false,
    };
    let named = Named::ALL.iter().map(|law| {
        let values: Vec<f64> = law.parameters().iter().map(|p| p.usual).collect();
        law.build(constants, &values)
    });
    named.map(on_a_lattice).chain(mixtures()).collect()
}

/// A law whose constants follow from a lattice, for a family of six bonds or less.
#[cfg(test)]
fn on_a_lattice<const D: usize>(law: Arc<dyn Law<D>>) -> Arc<dyn Law<D>> {
    use crate::{peridynamics::softening::RegularFamily, tensor::Vector};
    let Some(calibrate) = law.calibrate() else {
        return law;
    };
    let vector = |n: usize| {
        let (axis, sign) = (n / 2, if n.is_multiple_of(2) { 0.1 } else { -0.1 });
        Vector::from_fn(|a, _| if a == axis { sign } else { 0.0 })
    };
    let bonds: Vec<_> = (0..2 * D).map(|n| (vector(n), 1e4)).collect();
    let family = RegularFamily {
        bonds: &bonds,
        plane_energy: 0.1,
        horizon: 0.1,
    };
    calibrate.to_lattice(&family).unwrap()
}

/// Bodies of two materials, numbers 0 and 1, for the same tests.
#[cfg(test)]
fn mixtures<const D: usize>() -> impl Iterator<Item = Arc<dyn Law<D>>> {
    let bonds = |shear| -> Arc<dyn Law<D>> {
        Arc::new(BondBased::new(Micromodulus::InverseDistance, shear))
    };
    let solid = |lambda, shear| -> Arc<dyn Law<D>> {
        Arc::new(LinearPeridynamicSolid::new(
            Influence::Gaussian,
            lambda,
            shear,
        ))
    };
    let flowing = |shear, yields| {
        let constants = Constants {
            lambda: 1.7,
            shear,
            influence: Influence::Gaussian,
            micromodulus: Micromodulus::InverseDistance,
            kinematics: match D {
                1 => Kinematics::Bar,
                2 => Kinematics::PlaneStrain,
                _ => Kinematics::Solid,
            },
            density: 1.0,
            is_heated: false,
        };
        let law = Named::PlasticCorrespondence;
        let mut values: Vec<f64> = law.parameters().iter().map(|p| p.usual).collect();
        values[0] *= yields;
        law.build::<D>(constants, &values)
    };
    let of = |first, second, mean: StiffnessMean| {
        let mixed = Several::new(vec![first, second], &[0, 1], |_, _| mean);
        mixed.ok().map(|law| Arc::new(law) as Arc<dyn Law<D>>)
    };
    let found = [
        of(bonds(1.3), bonds(4.1), StiffnessMean::Harmonic),
        of(bonds(1.3), bonds(4.1), StiffnessMean::Arithmetic),
        of(solid(1.7, 1.3), solid(0.4, 2.9), StiffnessMean::Harmonic),
        of(
            flowing(1.3, 1.0),
            flowing(0.7, 2.0),
            StiffnessMean::Harmonic,
        ),
    ];
    assert!(found.iter().all(Option::is_some));
    found.into_iter().flatten()
}

/// Declares [`Named`], the laws that scenes know by key.
macro_rules! named_laws {
    ($($law:ident),* $(,)?) => {
        /// A law that scenes know by its key.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Named {
            $(#[doc = concat!("[`", stringify!($law), "`]")] $law,)*
        }

        impl Named {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$law),*];
            /// Their keys.
            pub const KEYS: &'static [&'static str] = &[$(<$law<1> as NamedLaw<1>>::KEY),*];

            /// The key of the material.
            pub fn key(self) -> &'static str {
                match self { $(Self::$law => <$law<1> as NamedLaw<1>>::KEY,)* }
            }

            /// Returns the description of the law.
            pub fn about(self) -> &'static str {
                match self { $(Self::$law => <$law<1> as NamedLaw<1>>::ABOUT,)* }
            }

            /// Returns the Poisson ratios that it has.
            pub fn ratio(self) -> Ratio {
                match self { $(Self::$law => <$law<1> as NamedLaw<1>>::RATIO,)* }
            }

            /// Bodies that it holds for.
            pub fn kinematics(self) -> &'static [Kinematics] {
                match self { $(Self::$law => <$law<1> as NamedLaw<1>>::KINEMATICS,)* }
            }

            /// Returns the parameters beside the elastic constants.
            pub fn parameters(self) -> &'static [Parameter] {
                match self { $(Self::$law => <$law<1> as NamedLaw<1>>::PARAMETERS,)* }
            }

            /// See [`NamedLaw::conflict`].
            pub fn conflict(self, values: &[f64]) -> Option<(&'static str, String)> {
                match self { $(Self::$law => <$law<1> as NamedLaw<1>>::conflict(values),)* }
            }

            /// Properties by which criteria of failure apply.
            pub fn traits(self) -> BondTraits {
                let law = self.usual();
                let history = law.force_state().map(|states| states.history());
                BondTraits {
                    breaks: law.has_breakable_bonds(),
                    has_bond_energy: law.bond_energy(1.0).is_some(),
                    flows: history.is_some_and(|h| h.point.contains(&PLASTIC_STRAIN)),
                    damages: law.damages(),
                }
            }

            /// The law of a bar, with usual numbers.
            fn usual(self) -> Arc<dyn Law<1>> {
                let constants = Constants {
                    lambda: 0.5,
                    shear: 1.0,
                    influence: Influence::Gaussian,
                    micromodulus: Micromodulus::InverseDistance,
                    kinematics: Kinematics::Bar,
                    density: 1.0,
                    is_heated: false,
                };
                let values: Vec<f64> = self.parameters().iter().map(|p| p.usual).collect();
                self.build::<1>(constants, &values)
            }

            /// The law; `values` are those of [`Named::parameters`].
            pub fn build<const D: usize>(self, constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
                match self { $(Self::$law => <$law<D> as NamedLaw<D>>::build(constants, values),)* }
            }
        }
    };
}

named_laws! {
    BondBased,
    LinearPeridynamicSolid,
    Correspondence,
    Hardening,
    SofteningBond,
    ContinuumDamage,
    Maxwell,
    PositionAwareSolid,
    PositionAwareViscoelasticSolid,
    PlasticCorrespondence,
    JohnsonCookCorrespondence,
    DamageCorrespondence,
    ViscoelasticCorrespondence,
    NeoHookeSolid,
    StVenantKirchhoffSolid,
}
