//! Parameters of a study, its cases, and its end.

use crate::variants::{Knob, Quantity};
use bondline::observe::ObserveError;
use bondline::scene::SceneError;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::Duration;

/// Errors below are round-off.
const ROUND_OFF: f64 = 1e-9;

/// Cost of a case.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Seconds of all stages but output.
    pub seconds: f64,
    /// The most memory that its process held, in bytes; 0 where the system does not tell.
    pub memory: f64,
    /// Bonds times steps (times one in a scene at rest).
    pub bond_visits: f64,
    /// Unknowns.
    pub unknowns: f64,
}

/// Outcome of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// It ran.
    Ran {
        /// Its cost.
        cost: Cost,
        /// Relative difference from the reference, one per quantity.
        errors: Vec<f64>,
    },
    /// It was refused, or broke off.
    Refused {
        /// In the program's own words, a line.
        why: String,
    },
    /// It took several times as long as the reference.
    OverTime {
        /// Seconds after which it was ended.
        seconds: f64,
    },
}

/// Reference against which errors are measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reference {
    /// Full peridynamics where bonds break or the scene moves, else [`Reference::Finer`].
    Auto,
    /// Peridynamics everywhere.
    FullPd,
    /// The scene with half the horizon and spacing (half the spacing where the horizon is a length of the material).
    Finer,
    /// The scene with these keys set otherwise.
    Keys(Vec<String>),
}

/// Measure of the cost of a case in the front.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CostBy {
    /// Seconds.
    #[default]
    Time,
    /// Memory.
    Memory,
    /// Bonds times steps: no noise.
    BondVisits,
}

impl CostBy {
    pub(super) fn of(self, cost: &Cost) -> f64 {
        match self {
            Self::Time => cost.seconds,
            Self::Memory => cost.memory,
            Self::BondVisits => cost.bond_visits,
        }
    }

    /// In tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Memory => "memory",
            Self::BondVisits => "bond visits",
        }
    }
}

/// A study.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeParams {
    /// The scene file.
    pub scene: PathBuf,
    /// Keys set for all cases, the reference among them.
    pub overrides: Vec<String>,
    /// Names of knobs to turn; empty for all that apply.
    pub knobs: Vec<String>,
    /// Further knobs, see [`typed`](super::typed).
    pub vary: Vec<Knob>,
    /// Quantities to compare; empty for those that suit the outputs. The error of a case is the largest of them.
    pub quantities: Vec<Quantity>,
    /// Reference of the comparison.
    pub reference: Reference,
    /// Measure of cost of the front.
    pub cost: CostBy,
    /// Errors for which the cheapest case is wanted as a scene.
    pub wanted: Vec<f64>,
    /// Time for all cases together.
    pub budget: Duration,
    /// Folder for tables, plot, scenes and records for resuming.
    pub output: PathBuf,
}

/// One case of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Case {
    /// Its settings, one per knob that is turned; empty for the scene as it is.
    pub settings: Vec<String>,
    /// The keys that they set.
    pub overrides: Vec<String>,
    /// A number for the bytes of the mesh file that it read, if it read one.
    pub mesh: Option<u64>,
    /// Its outcome.
    pub outcome: Outcome,
    /// Cost and error guessed before it ran, if others had run by then.
    pub guessed: Option<(f64, f64)>,
}

impl Case {
    /// Cost and error, if it ran. Errors below 1e-9 are round-off and count as that.
    pub fn point(&self, by: CostBy) -> Option<(f64, f64)> {
        match &self.outcome {
            Outcome::Ran { cost, errors } => Some((
                by.of(cost),
                errors.iter().copied().fold(ROUND_OFF, f64::max),
            )),
            _ => None,
        }
    }

    /// In tables.
    pub fn name(&self) -> String {
        if self.settings.is_empty() {
            "the scene".to_owned()
        } else {
            self.settings.join(", ")
        }
    }
}

/// Results of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Trade {
    /// The scene file.
    pub scene: PathBuf,
    /// Quantities that were compared.
    pub quantities: Vec<Quantity>,
    /// The keys of the reference, and its cost.
    pub reference: (Vec<String>, Cost),
    /// All cases in the order in which they ran.
    pub cases: Vec<Case>,
    /// Measure of cost of the front.
    pub by: CostBy,
    /// Combinations that were not run.
    pub left: usize,
    /// Reason why no more were run.
    pub ended: TradeEnd,
}

/// Reason for the end of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TradeEnd {
    /// No combination promises a better front.
    Complete,
    /// The time is used up; a second call goes on.
    Budget,
    /// It was interrupted; a second call goes on.
    Interrupted,
}

/// Failure of a study.
#[derive(Debug, thiserror::Error)]
pub enum TradeError {
    /// The scene.
    #[error("{}", .0.message())]
    Scene(Box<SceneError>),
    /// A knob that the scene does not have.
    #[error("the knob `{knob}` does not apply to this scene; those that do: {known}")]
    Knob {
        /// Its name.
        knob: String,
        /// The knobs that apply.
        known: String,
    },
    /// The reference, or the scene itself, does not run.
    #[error("{what} does not run: {why}; {remedy}")]
    Base {
        /// Name of the one that does not run.
        what: &'static str,
        /// In the run's words.
        why: String,
        /// The remedy.
        remedy: &'static str,
    },
    /// A quantity that the outputs do not have.
    #[error(
        "the outputs have no `{quantity}` to compare; add it to [output], or compare something else with --quantity"
    )]
    Quantity {
        /// Its name.
        quantity: String,
    },
    /// Two references.
    #[error("the study in {} was made of another scene, mesh, reference or quantity, or by another build of the program; give another --output, or remove it", path.display())]
    Another {
        /// Its record.
        path: PathBuf,
    },
    /// A case of an earlier study runs on.
    #[error("process {process} still writes into {}: a case of a study that was killed; end it, wait for it, or give another --output", path.display())]
    Busy {
        /// The folder.
        path: PathBuf,
        /// The process.
        process: u32,
    },
    /// A file.
    #[error("{}: {source}; check the folder and the disk", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The program could not be started for a case.
    #[error("cannot start {}: {source}", path.display())]
    Program {
        /// This program.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A run's summary is no JSON.
    #[error("a run's summary cannot be read ({why}): {text}; please report this with the scene")]
    Summary {
        /// The summary.
        text: String,
        /// The error of its JSON.
        why: String,
    },
    /// A table, a plot or a scene.
    #[error(transparent)]
    Observe(#[from] ObserveError),
}
