//! Failure of bonds in the generic pass.

#![deny(clippy::wildcard_enum_match_arm)]

use super::{BondCriterion, BondSetup, Failure};
use crate::peridynamics::{
    PdBody,
    failure::{FailureState, Reads, WholeBody},
};

/// Criterion by which bonds break.
pub(super) enum BondFailure {
    /// None.
    Never,
    /// The value of `t` of each bond.
    Stretch(Vec<f64>),
    /// A state of points and bonds.
    State {
        /// Its course.
        state: Box<dyn FailureState>,
        /// Response of the law that it reads.
        reads: Reads,
        /// Displacements of the last force, of a criterion that reads bonds \[m\].
        displacement: Vec<f64>,
    },
}

impl BondFailure {
    /// The criterion of a setup; `reverse` has the number of each bond from its other end.
    pub(super) fn new<const D: usize>(
        setup: &BondSetup<'_, D>,
        body: &PdBody<D>,
        reverse: &[u32],
    ) -> Self {
        // bonds may break by their damage alone
        let Some(failure) = setup.failure.filter(Failure::has_limit) else {
            return Self::Never;
        };
        let points = setup.position.len();
        match failure.critical {
            BondCriterion::State(criterion) => {
                // of whole families: those of the pass may lack bonds that a seam has of its own
                let whole = (0..points).map(|i| match body.is_foot(i) {
                    true => 0.0,
                    false => body.volume_of_family(i, setup.volume),
                });
                let family_volume: Vec<f64> = whole.collect();
                let state = criterion.begin(&WholeBody {
                    family_volume: &family_volume,
                    horizon: &body.cloud.horizon,
                    families: setup.families,
                    reverse,
                });
                Self::State {
                    state,
                    reads: criterion.reads(),
                    displacement: Vec::new(),
                }
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

    /// Response of the law that it reads.
    pub(super) fn reads(&self) -> Reads {
        match self {
            Self::Never | Self::Stretch(_) => Reads::default(),
            Self::State { reads, .. } => *reads,
        }
    }

    /// Keeps the displacements of a force for the end of the step, if bonds are read then.
    pub(super) fn keep(&mut self, u: &[f64]) {
        match self {
            Self::State {
                reads: Reads { bonds: true, .. },
                displacement,
                ..
            } => {
                displacement.clear();
                displacement.extend_from_slice(u);
            }
            Self::Never | Self::Stretch(_) | Self::State { .. } => {}
        }
    }

    /// Numbers of its history, for a checkpoint.
    pub(super) fn history(&self) -> &[f64] {
        match self {
            Self::Never | Self::Stretch(_) => &[],
            Self::State { state, .. } => state.history(),
        }
    }

    /// Puts them back.
    pub(super) fn restore(&mut self, history: &[f64]) {
        match self {
            Self::Never | Self::Stretch(_) => {}
            Self::State { state, .. } => state.restore(history),
        }
    }

    /// Numbers that it keeps \[8 bytes\].
    pub(super) fn numbers(&self) -> usize {
        match self {
            Self::Never => 0,
            Self::Stretch(limit) => limit.len(),
            Self::State {
                state,
                displacement,
                ..
            } => 2 * state.history().len() + displacement.len(),
        }
    }
}
