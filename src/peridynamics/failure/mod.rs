//! Criteria by which bonds break, one file each.
//!
//! | file | criterion | source |
//! |---|---|---|
//! | `critical_stretch.rs` | stretch of the bond | \[Silling2005\] |
//! | `fracture_energy.rs` | stretch at which a plane takes the fracture energy | [`mod@super::critical_stretch`] |
//! | `tearing_parameter.rs` | plastic flow under tension | [SAND2015-7998] eq. (6.33) |
//!
//! A criterion that implements [`FailureCriterion`] and has its line in the list of this file is a key of materials. Those of a stretch break bonds in all passes; those of a state do in the generic pass, which takes any law.

mod critical_stretch;
mod fracture_energy;
mod tearing_parameter;

use std::fmt::{Debug, Display};
use std::sync::Arc;

use super::{Families, Horizon};

#[cfg(test)]
pub(crate) use tearing_parameter::CriticalTearing;
pub(crate) use tearing_parameter::tension;

/// All criteria, in the order in which materials list their keys.
pub fn all() -> &'static [&'static dyn FailureCriterion] {
    &[
        &fracture_energy::FractureEnergy,
        &critical_stretch::CriticalStretch,
        &tearing_parameter::TearingParameter,
    ]
}

/// The criterion of a key, if there is one.
pub fn of_key(key: &str) -> Option<&'static dyn FailureCriterion> {
    all().iter().copied().find(|c| c.key() == key)
}

/// Stretch of the bond, `critical-stretch`.
pub const CRITICAL_STRETCH: &dyn FailureCriterion = &critical_stretch::CriticalStretch;
/// Energy per area of a new crack, `fracture-energy`.
pub const FRACTURE_ENERGY: &dyn FailureCriterion = &fracture_energy::FractureEnergy;

/// A criterion by which bonds break.
pub trait FailureCriterion: Debug + Sync {
    /// Key of materials.
    fn key(&self) -> &'static str;

    /// Description, a sentence.
    fn about(&self) -> &'static str;

    /// Returns true if materials of a named law have the key. A routine of a user (`umat`) and interfaces between materials have those of a stretch alone.
    fn applies_to(&self, law: &BondTraits) -> bool;

    /// Threshold of the number that a scene types.
    fn threshold(&self, value: f64) -> Threshold;
}

/// Properties of a law by which criteria apply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BondTraits {
    /// True if bonds can break.
    pub breaks: bool,
    /// True if the energy of a bond is known ([`super::Law::bond_energy`]).
    pub has_bond_energy: bool,
    /// True if points have a plastic strain.
    pub flows: bool,
    /// True if bonds or points lose their stiffness by a damage of the law.
    pub damages: bool,
}

/// Threshold at which a bond breaks.
#[derive(Clone, Debug)]
pub enum Threshold {
    /// Stretch of the bond \[1\].
    Stretch(f64),
    /// Energy per area of a new crack \[J/m²\], from which the stretch of the bond follows.
    Energy(f64),
    /// State of points and bonds.
    State(Arc<dyn StateCriterion>),
}

/// A criterion with its number.
#[derive(Clone, Copy, Debug)]
pub struct Fracture {
    /// The criterion.
    pub criterion: &'static dyn FailureCriterion,
    /// The number that a scene types.
    pub value: f64,
    /// Stretch at which a bond is through over that at which it begins to soften; 1 for bonds that break at once.
    pub softening: f64,
    /// True if a scene types that.
    pub types_softening: bool,
}

impl PartialEq for Fracture {
    fn eq(&self, other: &Self) -> bool {
        let numbers = |f: &Self| (f.value, f.softening);
        self.criterion.key() == other.criterion.key() && numbers(self) == numbers(other)
    }
}

impl Fracture {
    /// Returns true if a stretch breaks the bond, typed or calibrated to an energy.
    pub fn is_of_stretch(self) -> bool {
        match self.criterion.threshold(self.value) {
            Threshold::Stretch(_) | Threshold::Energy(_) => true,
            Threshold::State(_) => false,
        }
    }

    /// Energy per area of a new crack \[J/m²\], of a criterion that is one.
    pub fn energy(self) -> Option<f64> {
        match self.criterion.threshold(self.value) {
            Threshold::Energy(energy) => Some(energy),
            Threshold::Stretch(_) | Threshold::State(_) => None,
        }
    }

    /// Stretch at which a bond breaks, none of a criterion of a state; `of_energy` gives that of a fracture energy \[J/m²\].
    ///
    /// # Errors
    /// Those of `of_energy`.
    pub fn stretch<E>(
        self,
        of_energy: impl FnOnce(f64) -> Result<f64, E>,
    ) -> Result<Option<f64>, E> {
        match self.criterion.threshold(self.value) {
            Threshold::Stretch(stretch) => Ok(Some(stretch)),
            Threshold::Energy(energy) => of_energy(energy).map(Some),
            Threshold::State(_) => Ok(None),
        }
    }
}

/// A criterion of the state of points and bonds, with its number; displayed as "the tearing parameter 0.12".
pub trait StateCriterion: Debug + Display + Send + Sync {
    /// Response of the law that it reads.
    fn reads(&self) -> Reads;

    /// State before the first step.
    fn begin(&self, body: &WholeBody<'_>) -> Box<dyn FailureState>;
}

/// Response of a law that a criterion reads. A pass computes what is read, and no more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reads {
    /// Plastic flow of points and its triaxiality, [`Flow`].
    pub flow: bool,
    /// Extensions and forces of bonds.
    pub bonds: bool,
}

/// A body before its first step.
#[derive(Clone, Copy, Debug)]
pub struct WholeBody<'a> {
    /// Volume of the whole family of each point, centre included; zero of places that are no part of the body \[m^D\].
    pub family_volume: &'a [f64],
    /// Horizon of each point.
    pub horizon: &'a Horizon,
    /// Families of the pass.
    pub families: &'a Families,
    /// Number of the bond from the other end, of each bond; [`u32::MAX`] where there is none.
    pub reverse: &'a [u32],
}

/// Plastic flow of a point within a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flow {
    /// Equivalent plastic strain at the end of the step.
    pub strain: f64,
    /// Its growth in the step.
    pub growth: f64,
    /// `max{0, 2 σ₁/(3 (σ₁ − σ̄))}`.
    pub tension: f64,
}

/// Extension of a bond beyond free expansion \[m\], and force state along the deformed bond, `T⟨ξ⟩ · M` \[N/m^(2D)\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BondResponse {
    /// `|ξ + η| − |ξ|`, or to first order.
    pub extension: f64,
    /// Of the near end alone.
    pub force: f64,
}

/// Responses of the bonds of a family: calls back with the number of each intact bond.
pub type FamilyResponse<'a> = dyn Fn(usize, &mut dyn FnMut(usize, BondResponse)) + Sync + 'a;

/// State of a body at the end of a step. Bonds are numbered over all families.
pub struct EndOfStep<'a> {
    /// Families of the pass.
    pub families: &'a Families,
    /// Volume of each point \[m^D\].
    pub volume: &'a [f64],
    /// Bonds that stand.
    pub is_intact: &'a [bool],
    /// Plastic flow of each point in the step, if it is read.
    pub flow: &'a (dyn Fn(usize) -> Flow + Sync),
    /// Responses of the bonds of a point, if they are read.
    pub bonds: &'a FamilyResponse<'a>,
}

/// Course of a criterion of a state.
pub trait FailureState: Send + Sync {
    /// Ends a step.
    fn advance(&mut self, step: &EndOfStep<'_>);

    /// Returns true if bonds of a point may break: none is looked at of other points.
    fn may_break(&self, point: usize) -> bool;

    /// Returns true if a bond between two points breaks. The same from both ends.
    fn breaks(&self, ends: [usize; 2], bond: usize) -> bool;

    /// History, for checkpoints.
    fn history(&self) -> &[f64];

    /// Puts a history back, as long as that of [`FailureState::history`].
    fn restore(&mut self, history: &[f64]);

    /// Output fields: names, and a number of each point.
    fn fields(&self) -> Vec<(&'static str, Vec<f64>)>;
}
