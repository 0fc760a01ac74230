//! Failure of bonds in the generic pass.

#![deny(clippy::wildcard_enum_match_arm)]

use super::{BondCriterion, BondSetup, Failure};
use crate::peridynamics::{PdBody, tearing_parameter::TearingParameter};

/// What breaks bonds.
pub(super) enum BondFailure {
    /// Nothing.
    Never,
    /// The value of `t` of each bond.
    Stretch(Vec<f64>),
    /// The tearing parameter of its ends.
    Tearing(TearingParameter),
}

impl BondFailure {
    pub(super) fn new<const D: usize>(setup: &BondSetup<'_, D>, body: &PdBody<D>) -> Self {
        // bonds may break by their damage alone
        let Some(failure) = setup.failure.filter(Failure::has_limit) else {
            return Self::Never;
        };
        let points = setup.position.len();
        match failure.critical {
            BondCriterion::TearingParameter(critical) => {
                // of whole families: those of the pass may lack bonds that a seam has of its own
                let whole = (0..points).map(|i| match body.is_foot(i) {
                    true => 0.0,
                    false => body.volume_of_family(i, setup.volume),
                });
                let whole: Vec<f64> = whole.collect();
                let horizon = &body.cloud.horizon;
                Self::Tearing(TearingParameter::new(critical, &whole, horizon))
            }
            BondCriterion::Uniform(_) | BondCriterion::PerBond(_) => {
                let mut limit = Vec::with_capacity(setup.families.neighbours.len());
                for i in 0..points {
                    for (k, &j) in setup.families.of(i).iter().enumerate() {
                        limit.push(setup.limit(i, k, &setup.bond(i, j as usize)));
                    }
                }
                Self::Stretch(limit)
            }
        }
    }

    /// The numbers of its history, for a checkpoint.
    pub(super) fn kept(&self) -> &[f64] {
        match self {
            Self::Never | Self::Stretch(_) => &[],
            Self::Tearing(tearing) => tearing.values(),
        }
    }

    /// The same, to be put back.
    pub(super) fn kept_mut(&mut self) -> &mut [f64] {
        match self {
            Self::Never | Self::Stretch(_) => &mut [],
            Self::Tearing(tearing) => tearing.values_mut(),
        }
    }

    /// Numbers that it keeps \[8 bytes\].
    pub(super) fn numbers(&self) -> usize {
        match self {
            Self::Never => 0,
            Self::Stretch(limit) => limit.len(),
            Self::Tearing(tearing) => 2 * tearing.values().len(),
        }
    }
}
