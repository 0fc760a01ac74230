//! Content of a checkpoint of a run: its state, its step, its zone, and the extent of its output until then.

use serde::{Deserialize, Serialize};

use super::crack_growth::CrackGrowth;
use super::impact_record::Peak;
use super::rezoning::{nonlocal, share};
use super::seen::Seen;
use crate::model::Model;
use crate::observe::rezoning_event::Switch;
use crate::solve::explicit::State;

/// All that a run needs to go on; the same bytes for the same scene and step, whenever it was stopped before.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Saved {
    /// Fields, time, step, work, broken bonds.
    pub state: State,
    /// Displacement that load steps before the motion left it to begin with; empty without any.
    pub loaded: Vec<f64>,
    /// Damage state of the system.
    pub damage: Vec<u64>,
    /// The time step and the limits that it was chosen by.
    pub pace: StepChoice,
    /// Extent of the output so far.
    pub written: Written,
    /// Arrival of damage at the edge of the nonlocal zone, if it got there.
    pub edge: Option<EdgeReached>,
    /// State of a zone that follows the crack; none of one that does not.
    pub zone: Option<SavedZone>,
    /// Extremes of energy, rotation and strains so far.
    pub seen: Seen,
}

/// State of a zone that follows the crack.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedZone {
    /// True for each cell that is nonlocal.
    pub nonlocal: Vec<bool>,
    /// Time at which each was wanted last \[s\], or became nonlocal; minus infinity if never.
    pub wanted: Vec<f64>,
    /// True if the state was looked at for a change already, where one is due.
    pub looked: bool,
    /// The changes so far.
    pub switches: Vec<Switch>,
    /// Its share of the volume at the start, and the most so far.
    pub shares: [f64; 2],
}

impl SavedZone {
    /// Of the layout that a run begins with.
    pub fn first<const D: usize>(model: &Model<D>) -> Self {
        let share = share(model);
        let nonlocal = nonlocal(model);
        let never = f64::NEG_INFINITY;
        Self {
            wanted: nonlocal
                .iter()
                .map(|n| if *n { 0.0 } else { never })
                .collect(),
            nonlocal,
            looked: true,
            switches: Vec::new(),
            shares: [share; 2],
        }
    }

    /// After a change to another layout.
    pub fn after<const D: usize>(mut self, switch: Switch, model: &Model<D>) -> Self {
        let now = nonlocal(model);
        let was = std::mem::replace(&mut self.nonlocal, now);
        for ((wanted, was), now) in self.wanted.iter_mut().zip(was).zip(&self.nonlocal) {
            if *now && !was {
                *wanted = switch.time;
            }
        }
        self.looked = true;
        self.shares[1] = self.shares[1].max(switch.share);
        self.switches.push(switch);
        self
    }
}

/// A time step, and the limits that it keeps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepChoice {
    /// The step.
    pub step: f64,
    /// Steps to the end.
    pub steps: u64,
    /// The largest step that is taken to be stable.
    pub stable: f64,
    /// The step that row sums guarantee to be stable.
    pub certified: f64,
    /// The site of the row that limits it.
    pub site: u64,
    /// The step and the time since when steps are of this size.
    pub since: (u64, f64),
}

impl StepChoice {
    /// The time after a step.
    pub fn time(&self, step: u64) -> f64 {
        self.since.1 + (step - self.since.0) as f64 * self.step
    }
}

/// Damage at the edge of the nonlocal zone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeReached {
    /// After this step.
    pub step: u64,
    /// At this time.
    pub time: f64,
    /// At this site.
    pub site: u64,
}

/// Part of a run's files that belongs to a state, and the records that go with it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Written {
    /// Lengths of the history and of the tables beside it: tips, then lines.
    pub bytes: Vec<u64>,
    /// Times of the VTU files.
    pub times: Vec<f64>,
    /// Kinetic and stored energy at the start.
    pub energy_at_start: f64,
    /// The largest forces of impactors so far.
    pub peaks: Vec<Peak>,
    /// Growth of cracks.
    pub growth: CrackGrowth,
}
