//! Fracture energy: bonds break at the stretch at which a plane through the body takes it, [`crate::peridynamics::critical_stretch`].

use super::{BondTraits, FailureCriterion, Threshold};

/// A bond breaks at the critical stretch that follows from an energy per area of a new crack.
#[derive(Debug)]
pub struct FractureEnergy;

impl FailureCriterion for FractureEnergy {
    fn key(&self) -> &'static str {
        "fracture-energy"
    }

    fn about(&self) -> &'static str {
        "Energy per area of a new crack, from which the critical stretch of bonds follows; without it and `critical-stretch` no bond breaks."
    }

    fn applies_to(&self, law: &BondTraits) -> bool {
        law.has_bond_energy
    }

    fn threshold(&self, value: f64) -> Threshold {
        Threshold::Energy(value)
    }
}
