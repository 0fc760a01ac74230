//! Monitoring of a run: energy that nothing supplied, elements that rotate, and linear parts beyond the range in which their material is linear.
//!
//! A model whose stiffness is symmetric and positive, whatever its strain, keeps its energy, and is not watched. Every other may feed its modes at the seam, whatever was computed before the first step:
//!
//! ```text
//! gain = (kinetic + stored + dissipated − work − start) / (largest of |kinetic + stored| and |work| so far)
//! ```
//!
//! Energies are those of the rows of the history, and of every hundredth step where rows are farther apart, so that watching costs less than one per cent.

use super::seen::{Rotated, Seen};
use super::writer::{EnergyRow, Moment};
use crate::model::Model;
use crate::observe::summary::{Ended, EnergyGain, Rotation};
use crate::observe::warning::Warning;
use crate::run::linear_parts::LinearParts;
use crate::run::rotation::Rotations;
use crate::run::setup::RunSettings;
use crate::scene::solve::Explicit as Spec;

/// Steps between two looks, at least.
const STEPS: u64 = 100;

/// Looks at a whole run, at most, beside those at rows of the history.
const LOOKS: u64 = 1000;

/// Relative gain of energy beyond which it is warned of.
pub(crate) const TOLD: f64 = 0.01;

/// Kind of energy balance, which decides whether it is watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Balance {
    /// It closes by construction.
    Proved,
    /// It would if the law did not change with the strain.
    WatchedForLaw,
    /// Nothing shows that it closes.
    Watched,
    /// It does not: elements expand by forces that do work, bonds that know their temperature by their stretch, and what passes the seam between them counts on neither side.
    Apart,
}

impl Balance {
    /// Returns true if a gain of energy means anything.
    fn is_watched(self) -> bool {
        matches!(self, Self::WatchedForLaw | Self::Watched)
    }
}

/// True of a scene whose energies do not add up to a balance: of linear elements the thermal forces do work as loads do, of heated bonds and of local laws the temperature does.
pub(crate) fn energies_are_apart<const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
    is_linear: bool,
) -> bool {
    let cells = 0..model.mesh.cell_count();
    let has_elements = || cells.into_iter().any(|c| model.is_element(c));
    let knows_heat = model.body().is_some() || rest.has_nonlinear_elements(model);
    let is_heated = rest.stresses.thermal.is_some() && !is_linear;
    is_heated && knows_heat && has_elements()
}

/// The limits of a run, and the values observed so far.
pub(crate) struct Guard<'m, const D: usize> {
    balance: Balance,
    largest_gain: f64,
    largest_rotation: f64,
    every: u64,
    rotations: Rotations<'m, D>,
    parts: LinearParts<'m, D>,
    pub seen: Seen,
}

impl<'m, const D: usize> Guard<'m, D> {
    /// For a run of so many steps.
    pub fn new(
        (rotations, parts): (Rotations<'m, D>, LinearParts<'m, D>),
        balance: Balance,
        spec: &Spec,
        steps: u64,
        seen: Seen,
    ) -> Self {
        Self {
            balance,
            largest_gain: spec.largest_energy_gain,
            largest_rotation: spec.largest_rotation.unwrap_or(f64::INFINITY),
            every: STEPS.max(steps / LOOKS),
            rotations,
            parts,
            seen,
        }
    }

    /// Returns true if energies, rotations or strains may be looked at after a step.
    pub fn looks_after(&self, step: u64) -> bool {
        step.is_multiple_of(self.every)
    }

    /// Returns true if energies are wanted after a step, be there a row of the history or not.
    pub fn wants_energies(&self, step: u64) -> bool {
        self.balance.is_watched() && step.is_multiple_of(self.every)
    }

    /// Looks at the energies of a state; returns the reason, if any, to end the run.
    pub fn look_at_energies(&mut self, moment: &Moment<'_>, row: &EnergyRow) -> Option<Ended> {
        let energy = (row.kinetic + row.stored).abs().max(row.work.abs());
        let seen = &mut self.seen;
        seen.largest = seen.largest.max(energy);
        // the first steps from rest under a load have energies of the order of what a step makes of them: 12 % at the first one
        let begins = moment.state.step < STEPS;
        if !self.balance.is_watched() || seen.largest == 0.0 || begins {
            return None;
        }
        let gain = (row.dissipated - row.missing) / seen.largest;
        let now = (gain, moment.state.step, moment.state.time);
        if gain > TOLD && seen.told.is_none() {
            seen.told = Some(now);
        }
        if seen.most.is_none_or(|(most, ..)| gain > most) {
            seen.most = Some(now);
        }
        (gain > self.largest_gain).then_some(Ended::EnergyGained)
    }

    /// The limit that has been exceeded, if one has.
    pub fn exceeded(&self) -> Option<Ended> {
        let seen = &self.seen;
        let rotated = seen.rotated.filter(|r| r.degrees > self.largest_rotation);
        let gained = seen.most.filter(|(gain, ..)| *gain > self.largest_gain);
        rotated
            .map(|_| Ended::ElementsRotated)
            .or(gained.map(|_| Ended::EnergyGained))
    }

    /// Looks at the rotation of elements, and at the strains of linear parts, where that is due; returns the reason, if any, to end the run.
    pub fn look_at_strains(&mut self, moment: &Moment<'_>, is_last: bool) -> Option<Ended> {
        let state = moment.state;
        if !(is_last || state.step.is_multiple_of(self.every)) {
            return None;
        }
        let now = (state.step, state.time);
        self.parts.look(&state.u, now, &mut self.seen.passed);
        let found = self.rotations.largest(&state.u)?;
        if self.seen.rotated.is_none_or(|r| found.degrees > r.degrees) {
            self.seen.rotated = Some(Rotated {
                degrees: found.degrees,
                place: found.place,
                step: state.step,
                time: state.time,
                energy: found.energy,
            });
        }
        (found.degrees > self.largest_rotation).then_some(Ended::ElementsRotated)
    }

    /// Returns the energy gain for the summary; none of a run whose balance closes by construction.
    pub fn energy_gain(&self) -> Option<EnergyGain> {
        let (most, step, time) = self.seen.most?;
        let (_, told_step, told_time) = self.seen.told.unwrap_or((most, step, time));
        Some(EnergyGain {
            largest: most,
            step,
            time,
            limit: self.largest_gain,
            first_told: self.seen.told.map(|_| (told_step, told_time)),
            by_law: self.balance == Balance::WatchedForLaw,
        })
    }

    /// Returns warnings of parts that are linear or whole beyond the range in which their material is, in a run that ends at a time.
    pub fn passed(&self, time: f64) -> impl Iterator<Item = Warning> {
        self.parts.told(&self.seen.passed, time)
    }

    /// Returns the rotation for the summary; none where no element has rotated enough to matter.
    pub fn rotation(&self) -> Option<Rotation> {
        let r = self.seen.rotated?;
        self.rotations.told(
            r.degrees,
            r.place,
            r.energy,
            self.seen.largest,
            Some((r.step, r.time)),
        )
    }
}
