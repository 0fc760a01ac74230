//! What speed costs in accuracy: a scene run with its knobs turned, each case measured against a reference.
//!
//! | file | what |
//! |---|---|
//! | `case.rs` | one case in a process of its own: its cost, its outcome |
//! | `effects.rs` | guesses of cost and error for cases that were not run; the Pareto front |
//! | `study.rs` | which case runs next |
//! | `record.rs` | what is kept of a study, so that it can go on |
//! | `report.rs` | table, CSV, JSON, plot, and the scene for a wanted error |
//!
//! What can be turned in a scene, and how far outputs are apart, is in `study/variants`.
//!
//! First the reference runs, then the scene as it is, then every setting alone. From these, cost and error of every combination are guessed, and the
//! one that promises the largest gain over the front so far is run, again and again, until none promises any or the time is used up. Every outcome is
//! written as soon as it is known, and a study that was interrupted goes on from there.

mod case;
mod effects;
mod record;
mod report;
mod study;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

pub use crate::study::variants::{KNOBS, Knob, Quantity, Setting, distance_from_path, typed};
pub use case::{Cost, Outcome};
pub use effects::front;

use crate::observe::ObserveError;
use crate::observe::claim::{Claim, Files};
use crate::progress::Progress;
use crate::regular_file;
use crate::scene::{SceneError, SceneSpec, Source};
use crate::study::accuracy;
use crate::study::variants::{Base, measured_keys};
use case::{Attempt, Runner};
use record::{Head, kept, new_record, read_record};
use study::Study;

/// What errors are measured against.
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

/// What a case costs in the front.
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
    fn of(self, cost: &Cost) -> f64 {
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
    /// Further knobs, see [`typed`].
    pub vary: Vec<Knob>,
    /// What is compared; empty for what suits the outputs. The error of a case is the largest of them.
    pub quantities: Vec<Quantity>,
    /// What it is compared with.
    pub reference: Reference,
    /// What the front is over.
    pub cost: CostBy,
    /// Errors for which the cheapest case is wanted as a scene.
    pub wanted: Vec<f64>,
    /// Time for all cases together.
    pub budget: Duration,
    /// Folder for tables, plot, scenes and what resuming needs.
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
    /// How it ended.
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

/// What a study found.
#[derive(Clone, Debug, PartialEq)]
pub struct Trade {
    /// The scene file.
    pub scene: PathBuf,
    /// What was compared.
    pub quantities: Vec<Quantity>,
    /// The keys of the reference, and what it cost.
    pub reference: (Vec<String>, Cost),
    /// All cases in the order in which they ran.
    pub cases: Vec<Case>,
    /// What the front is over.
    pub by: CostBy,
    /// Combinations that were not run.
    pub left: usize,
    /// Why no more were.
    pub ended: TradeEnd,
}

/// Why a study ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TradeEnd {
    /// No combination promises a better front.
    Complete,
    /// The time is used up; a second call goes on.
    Budget,
    /// It was interrupted; a second call goes on.
    Interrupted,
}

/// Why there is no study.
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
        /// What applies.
        known: String,
    },
    /// The reference, or the scene itself, does not run.
    #[error("{what} does not run: {why}; {remedy}")]
    Base {
        /// Which of them.
        what: &'static str,
        /// In the run's words.
        why: String,
        /// What to do.
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
        /// What the system said.
        source: std::io::Error,
    },
    /// The program could not be started for a case.
    #[error("cannot start {}: {source}", path.display())]
    Program {
        /// This program.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A run's summary is no JSON.
    #[error("a run's summary cannot be read ({why}): {text}; please report this with the scene")]
    Summary {
        /// The summary.
        text: String,
        /// What is wrong.
        why: String,
    },
    /// A table, a plot or a scene.
    #[error(transparent)]
    Observe(#[from] ObserveError),
}

/// Errors below are round-off.
const ROUND_OFF: f64 = 1e-9;

/// A case that takes longer than so many times the reference is of no use to anyone.
const PATIENCE: f64 = 4.0;

/// Runs a study with `program`, which must be this command line; `interrupt` ends it between and within cases.
///
/// # Errors
/// [`TradeError`]; outcomes known by then are kept in the folder, and a second call goes on from them.
pub fn trade(
    params: &TradeParams,
    program: &Path,
    interrupt: Option<&AtomicBool>,
    progress: &dyn Progress,
) -> Result<Trade, TradeError> {
    let text = regular_file::read_scene(&params.scene).map_err(|source| TradeError::File {
        path: params.scene.clone(),
        source,
    })?;
    let scene_error = |e: SceneError| TradeError::Scene(Box::new(e));
    let plain = Source::new(params.scene.display().to_string(), text.clone());
    let mut source = plain.clone();
    for o in &params.overrides {
        source.push_override(o).map_err(scene_error)?;
    }
    let directory = params.scene.parent().unwrap_or(Path::new(""));
    let chosen = accuracy::completed(&source, directory).map_err(scene_error)?;
    let complete = chosen.as_ref().map_or(&source, |(complete, _)| complete);
    let spec = SceneSpec::parse(complete).map_err(scene_error)?;
    let base = Base::of(&spec);
    let knobs = chosen_knobs(&base, params)?;
    let mut common = params.overrides.clone();
    common.extend(chosen.into_iter().flat_map(|c| c.1.overrides));
    common.extend(measured_keys(&spec));
    let keys = match &params.reference {
        Reference::Auto if base.breaks && base.moves => vec!["coupling=nonlocal".to_owned()],
        Reference::FullPd => vec!["coupling=nonlocal".to_owned()],
        Reference::Auto | Reference::Finer => base.overrides(&base.finer()),
        Reference::Keys(keys) => keys.clone(),
    };
    let runner = Runner {
        program,
        scene: &params.scene,
        interrupt,
    };
    let start = Instant::now();
    let _claim = Claim::take(
        &params.output,
        &params.scene.display().to_string(),
        &files(),
    )?;
    let program = record::program(program)?;
    let with = |keys: &[String]| -> Vec<String> { common.iter().chain(keys).cloned().collect() };
    let mesh = record::mesh(&plain, directory, &with(&keys));
    let head_of = |quantities: Vec<Quantity>, cost| Head {
        program: program.clone(),
        scene: text.clone(),
        mesh,
        overrides: common.clone(),
        reference: keys.clone(),
        quantities,
        cost,
    };
    let record_path = params.output.join("cases.jsonl");
    let folder = params.output.join("reference");
    let old = read_record(&record_path)?;
    let (reference, head, cases) = match old {
        Some((head, cases)) => {
            let wanted = if params.quantities.is_empty() {
                head.quantities.clone()
            } else {
                params.quantities.clone()
            };
            if head != head_of(wanted, head.cost) {
                return Err(TradeError::Another { path: record_path });
            }
            (kept(&folder)?, head, cases)
        }
        None => {
            progress.stage("reference", None);
            let ran = match runner.run(&with(&keys), &folder, params.budget)? {
                Attempt::Ran(ran) => ran,
                Attempt::Refused(why) => {
                    return Err(TradeError::Base {
                        what: "the reference",
                        why,
                        remedy: "choose another one with --reference",
                    });
                }
                Attempt::OverTime | Attempt::Interrupted => {
                    return Err(TradeError::Base {
                        what: "the reference",
                        why: "it used up the time".to_owned(),
                        remedy: "give more with --budget, or another one with --reference",
                    });
                }
            };
            let quantities = if params.quantities.is_empty() {
                ran.measured.quantities()
            } else {
                params.quantities.clone()
            };
            for quantity in &quantities {
                if ran.measured.error(&ran.measured, quantity).is_none() {
                    return Err(TradeError::Quantity {
                        quantity: quantity.name(),
                    });
                }
            }
            let head = head_of(quantities, ran.cost);
            (ran.measured, head, Vec::new())
        }
    };
    // what was found with another mesh is found again
    let is_known =
        |case: &Case| case.mesh == record::mesh(&plain, directory, &with(&case.overrides));
    let cases: Vec<Case> = cases.into_iter().filter(is_known).collect();
    // anew, because a killed study may have left half a line at the end
    let record = new_record(&record_path, &head, &cases).map_err(|source| TradeError::File {
        path: record_path.clone(),
        source,
    })?;
    let mut study = Study {
        params,
        runner,
        plain,
        directory,
        base,
        settings: knobs
            .into_iter()
            .enumerate()
            .flat_map(|(k, knob)| knob.settings.into_iter().map(move |s| (k, s)))
            .collect(),
        common,
        reference,
        reference_keys: head.reference.clone(),
        quantities: head.quantities.clone(),
        cases,
        skipped: Vec::new(),
        record,
        record_path,
        deadline: start + params.budget,
        patience: Duration::from_secs_f64(PATIENCE * head.cost.seconds + 10.0),
    };
    let ended = study.all(progress)?;
    progress.finish();
    let left = study.combinations().len();
    Ok(Trade {
        scene: params.scene.clone(),
        quantities: head.quantities,
        reference: (head.reference, head.cost),
        cases: study.cases,
        by: params.cost,
        left,
        ended,
    })
}

/// What a study writes into its folder, and its cases below it.
fn files() -> Files {
    Files {
        name: "trade".to_owned(),
        files: ["cases.jsonl", "reference", "case"]
            .map(str::to_owned)
            .into(),
        series: false,
    }
}

fn chosen_knobs(base: &Base, params: &TradeParams) -> Result<Vec<Knob>, TradeError> {
    let all = base.knobs();
    let mut chosen: Vec<Knob> = if params.knobs.is_empty() {
        // whoever names keys only wants those
        if params.vary.is_empty() {
            all
        } else {
            Vec::new()
        }
    } else {
        params
            .knobs
            .iter()
            .map(|name| {
                all.iter()
                    .find(|k| k.name == *name)
                    .cloned()
                    .ok_or_else(|| TradeError::Knob {
                        knob: name.clone(),
                        known: all
                            .iter()
                            .map(|k| k.name.as_str())
                            .collect::<Vec<_>>()
                            .join(", "),
                    })
            })
            .collect::<Result<_, _>>()?
    };
    chosen.extend(params.vary.iter().cloned());
    Ok(chosen)
}
