//! Critical stretch of a bond, \[Silling2005\].

use super::{BondTraits, FailureCriterion, Threshold};

/// A bond breaks once its stretch `(|ξ + η| − |ξ|)/|ξ|` exceeds a number.
#[derive(Debug)]
pub struct CriticalStretch;

impl FailureCriterion for CriticalStretch {
    fn key(&self) -> &'static str {
        "critical-stretch"
    }

    fn about(&self) -> &'static str {
        "Stretch at which a bond breaks, instead of `fracture-energy`."
    }

    fn applies_to(&self, law: &BondTraits) -> bool {
        law.breaks
    }

    fn threshold(&self, value: f64) -> Threshold {
        Threshold::Stretch(value)
    }
}
