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

/// A quantity and the largest relative error that is wanted of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Want {
    /// The quantity; none for those that suit the outputs.
    pub quantity: Option<Quantity>,
    /// The error.
    pub error: f64,
}

impl Want {
    /// From the command line: `displacement=1%`, `probe:tip.u=0.01`, or `1%` for the quantities that suit the outputs.
    ///
    /// # Errors
    /// A message with the fault and the remedy.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (quantity, error) = match text.rsplit_once('=') {
            Some((quantity, error)) => (Some(Quantity::parse(quantity)?), error),
            None => (None, text),
        };
        let (number, unit) = match error.strip_suffix('%') {
            Some(number) => (number, 0.01),
            None => (error, 1.0),
        };
        match number.trim().parse::<f64>() {
            Ok(number) if number > 0.0 && number.is_finite() => Ok(Self {
                quantity,
                error: number * unit,
            }),
            _ => Err(format!(
                "`{error}` is no error above zero; write {}=1% or 0.01",
                quantity.map_or("displacement".to_owned(), |q| q.name())
            )),
        }
    }
}

/// Reference against which errors are measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reference {
    /// Full peridynamics where bonds break in time, elements alone where nothing breaks on the mesh of a file, else [`Reference::Finer`].
    Auto,
    /// Peridynamics everywhere.
    FullPd,
    /// Elements alone: half as large, of the mesh of a file of second order.
    Elements,
    /// The scene with half the horizon and spacing (half the spacing where the horizon is a length of the material).
    Finer,
    /// The scene with these keys set otherwise.
    Keys(Vec<String>),
    /// Another scene, with the same outputs.
    Scene(PathBuf),
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
    /// Quantities to compare, with the errors that are wanted of them.
    pub wants: Vec<Want>,
    /// Reference of the comparison.
    pub reference: Reference,
    /// Measure of cost of the front.
    pub cost: CostBy,
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
    /// Its coupling.
    pub coupling: String,
    /// A number for the bytes of the mesh file that it read, if it read one.
    pub mesh: Option<u64>,
    /// Its outcome.
    pub outcome: Outcome,
    /// Cost and error guessed before it ran, if others had run by then.
    pub guessed: Option<(f64, f64)>,
}

impl Case {
    /// Cost, and the largest of its errors over those that are wanted, if it ran. Errors below 1e-9 are round-off and count as that.
    pub fn point(&self, by: CostBy, wanted: &[f64]) -> Option<(f64, f64)> {
        match &self.outcome {
            Outcome::Ran { cost, errors } => {
                let each = errors.iter().zip(wanted);
                let ratio = each.map(|(error, wanted)| error.max(ROUND_OFF) / wanted);
                Some((by.of(cost), ratio.fold(0.0, f64::max)))
            }
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
    /// Quantities that were compared, with the errors that are wanted of them.
    pub wants: Vec<(Quantity, f64)>,
    /// The reference.
    pub reference: ReferenceRun,
    /// All cases in the order in which they ran.
    pub cases: Vec<Case>,
    /// Measure of cost of the front.
    pub by: CostBy,
    /// Combinations that were not run.
    pub left: usize,
    /// Reason why no more were run.
    pub ended: TradeEnd,
}

/// The reference of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceRun {
    /// The keys that it sets.
    pub keys: Vec<String>,
    /// In words, with the reason for it.
    pub why: String,
    /// Its cost.
    pub cost: Cost,
    /// Its own error.
    pub own_error: OwnError,
}

/// Knowledge of the error of a reference itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OwnError {
    /// From three spacings: those of this case, of the scene as it is, and of the reference, each half of that before.
    Order(Vec<String>),
    /// It is smaller than that of this case, whose elements are of first order.
    Bound(Vec<String>),
    /// Not at all.
    Unknown,
}

impl OwnError {
    /// The case that it takes.
    pub(super) fn case(&self) -> &[String] {
        match self {
            Self::Order(labels) | Self::Bound(labels) => labels,
            Self::Unknown => &[],
        }
    }
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
        "the outputs have no `{quantity}` to compare; add it to [output], or compare something else with --want"
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
