//! What speed costs in accuracy: a scene run with its knobs turned, each case measured against a reference.
//!
//! | file | what |
//! |---|---|
//! | `knobs.rs` | what can be turned in a scene, and the overrides that it means |
//! | `case.rs` | one case in a process of its own: its cost, its outcome |
//! | `measure.rs` | how far its outputs are from those of the reference |
//! | `effects.rs` | guesses of cost and error for cases that were not run; the Pareto front |
//! | `report.rs` | table, CSV, JSON, plot, and the scene for a wanted error |
//!
//! First the reference runs, then the scene as it is, then every setting alone. From these, cost and error of every combination are guessed, and the
//! one that promises the largest gain over the front so far is run, again and again, until none promises any or the time is used up. Every outcome is
//! written as soon as it is known, and a study that was interrupted goes on from there.

mod case;
mod effects;
mod knobs;
mod measure;
mod report;

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

pub use case::{Cost, Outcome};
pub use effects::front;
pub use knobs::{KNOBS, Knob, Setting, typed};
pub use measure::Quantity;

use crate::observe::ObserveError;
use crate::progress::Progress;
use crate::scene::{SceneError, SceneSpec, Source};
use case::{Attempt, Runner};
use effects::{Effects, most_promising};
use knobs::{Base, coordinates};
use measure::Measured;

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
    #[error("the study in {} was made of another scene, reference or quantity; give another --output, or remove it", path.display())]
    Another {
        /// Its record.
        path: PathBuf,
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

/// A combination is worth running if it promises this factor in cost or error over the front.
const WORTH: f64 = 1.1;

/// The first line of a record: what its errors belong to.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Head {
    scene: String,
    overrides: Vec<String>,
    reference: Vec<String>,
    quantities: Vec<Quantity>,
    cost: Cost,
}

/// A study under way.
struct Study<'a> {
    params: &'a TradeParams,
    runner: Runner<'a>,
    base: Base,
    settings: Vec<(usize, Setting)>,
    common: Vec<String>,
    reference: Measured,
    reference_keys: Vec<String>,
    quantities: Vec<Quantity>,
    cases: Vec<Case>,
    /// Combinations that are the reference itself.
    skipped: Vec<Vec<String>>,
    record: std::fs::File,
    record_path: PathBuf,
    deadline: Instant,
    /// How long a case may take: some times the reference.
    patience: Duration,
}

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
    let text = std::fs::read_to_string(&params.scene).map_err(|source| TradeError::File {
        path: params.scene.clone(),
        source,
    })?;
    let scene_error = |e: SceneError| TradeError::Scene(Box::new(e));
    let mut source = Source::new(params.scene.display().to_string(), text.clone());
    for o in &params.overrides {
        source.push_override(o).map_err(scene_error)?;
    }
    let spec = SceneSpec::parse(&source).map_err(scene_error)?;
    let base = Base::of(&spec);
    let knobs = chosen_knobs(&base, params)?;
    let mut common = params.overrides.clone();
    if !base.moves && spec.output.lines.is_empty() && spec.output.probes.is_empty() {
        common.extend(lines(&spec));
    }
    if base.moves {
        // pictures cost more than the motion
        common.push("solve.explicit.outputs=1".to_owned());
    }
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
    let head_of = |quantities: Vec<Quantity>, cost| Head {
        scene: text.clone(),
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
            let all: Vec<String> = common.iter().chain(&keys).cloned().collect();
            let ran = match runner.run(&all, &folder, params.budget)? {
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
    // anew, because a killed study may have left half a line at the end
    let record = new_record(&record_path, &head, &cases).map_err(|source| TradeError::File {
        path: record_path.clone(),
        source,
    })?;
    let mut study = Study {
        params,
        runner,
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

/// Combinations beyond this are not looked at.
const MOST_COMBINATIONS: usize = 20_000;

impl Study<'_> {
    fn all(&mut self, progress: &dyn Progress) -> Result<TradeEnd, TradeError> {
        let singles = 1 + self.settings.len();
        progress.stage("the scene, and each setting alone", Some(singles as u64));
        if let Some(end) = self.case(&[], None, progress)? {
            return Ok(end);
        }
        if let Outcome::Refused { why } = &self.cases[0].outcome {
            return Err(TradeError::Base {
                what: "the scene",
                why: why.clone(),
                remedy: "try it with `bondline run`",
            });
        }
        progress.advance(1);
        for k in 0..self.settings.len() {
            if let Some(end) = self.case(&[k], None, progress)? {
                return Ok(end);
            }
            progress.advance(1);
        }
        progress.stage("combinations", None);
        while let Some((chosen, guess)) = self.next() {
            if let Some(end) = self.case(&chosen, Some(guess), progress)? {
                return Ok(end);
            }
        }
        Ok(TradeEnd::Complete)
    }

    fn labels(&self, chosen: &[usize]) -> Vec<String> {
        chosen
            .iter()
            .map(|&k| self.settings[k].1.label.clone())
            .collect()
    }

    fn chosen(&self, case: &Case) -> Option<Vec<usize>> {
        case.settings
            .iter()
            .map(|label| self.settings.iter().position(|s| s.1.label == *label))
            .collect()
    }

    /// Runs a case unless its outcome is known; why the study has to end, if it has.
    fn case(
        &mut self,
        chosen: &[usize],
        guessed: Option<(f64, f64)>,
        progress: &dyn Progress,
    ) -> Result<Option<TradeEnd>, TradeError> {
        let settings = self.labels(chosen);
        let overrides = self
            .base
            .overrides(chosen.iter().map(|&k| &self.settings[k].1.change));
        // the reference agrees with itself
        if overrides == self.reference_keys {
            self.skipped.push(settings);
            return Ok(None);
        }
        if self.cases.iter().any(|c| c.settings == settings) {
            return Ok(None);
        }
        let left = self.deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(Some(TradeEnd::Budget));
        }
        if self
            .runner
            .interrupt
            .is_some_and(|f| f.load(Ordering::Relaxed))
        {
            return Ok(Some(TradeEnd::Interrupted));
        }
        progress.tell(&format!(
            "{} ({:.0} s left)",
            if settings.is_empty() {
                "as it is".to_owned()
            } else {
                settings.join(", ")
            },
            left.as_secs_f64()
        ));
        let all: Vec<String> = self.common.iter().chain(&overrides).cloned().collect();
        let folder = self.params.output.join("case");
        let started = Instant::now();
        let outcome = match self.runner.run(&all, &folder, left.min(self.patience))? {
            Attempt::Interrupted => return Ok(Some(TradeEnd::Interrupted)),
            Attempt::Refused(why) => Outcome::Refused { why },
            Attempt::OverTime if left < self.patience => return Ok(Some(TradeEnd::Budget)),
            Attempt::OverTime => Outcome::OverTime {
                seconds: started.elapsed().as_secs_f64(),
            },
            Attempt::Ran(ran) => {
                let errors: Vec<Option<f64>> = self
                    .quantities
                    .iter()
                    .map(|q| ran.measured.error(&self.reference, q))
                    .collect();
                match errors.iter().position(Option::is_none) {
                    Some(k) => Outcome::Refused {
                        why: format!("its outputs have no {}", self.quantities[k].name()),
                    },
                    None => Outcome::Ran {
                        cost: ran.cost,
                        errors: errors.into_iter().flatten().collect(),
                    },
                }
            }
        };
        // what a case writes is of no further use
        let _ = std::fs::remove_dir_all(&folder);
        let case = Case {
            settings,
            overrides,
            outcome,
            guessed,
        };
        write_line(&mut self.record, &case).map_err(|source| TradeError::File {
            path: self.record_path.clone(),
            source,
        })?;
        self.cases.push(case);
        Ok(None)
    }

    /// Combinations of settings that ran alone, at most one of each knob, whose outcome is not known.
    fn combinations(&self) -> Vec<Vec<usize>> {
        let usable: Vec<usize> = (0..self.settings.len())
            .filter(|&k| {
                let label = &self.settings[k].1.label;
                self.cases.iter().any(|c| {
                    c.settings.as_slice() == std::slice::from_ref(label)
                        && matches!(c.outcome, Outcome::Ran { .. })
                })
            })
            .collect();
        let mut all: Vec<Vec<usize>> = vec![vec![]];
        for &k in &usable {
            let knob = self.settings[k].0;
            let with: Vec<Vec<usize>> = all
                .iter()
                .filter(|c| c.iter().all(|&o| self.settings[o].0 != knob))
                .map(|c| c.iter().copied().chain([k]).collect())
                .take(MOST_COMBINATIONS.saturating_sub(all.len()))
                .collect();
            all.extend(with);
        }
        all.retain(|c| {
            let labels = self.labels(c);
            c.len() > 1
                && !self.skipped.contains(&labels)
                && !self.cases.iter().any(|case| case.settings == labels)
        });
        all
    }

    /// The most promising combination, with cost and error as guessed.
    fn next(&self) -> Option<(Vec<usize>, (f64, f64))> {
        let ran: Vec<(Vec<usize>, (f64, f64))> = self
            .cases
            .iter()
            .filter_map(|c| Some((self.chosen(c)?, c.point(self.params.cost)?)))
            .collect();
        let number = self.settings.len();
        let of = |f: fn(&(f64, f64)) -> f64| {
            let values: Vec<_> = ran.iter().map(|(c, p)| (c.clone(), f(p))).collect();
            Effects::fit(number, &values)
        };
        let (cost, error) = (of(|p| p.0), of(|p| p.1));
        let candidates = self.combinations();
        let guessed: Vec<(f64, f64)> = candidates
            .iter()
            .map(|c| (cost.guess(c), error.guess(c)))
            .collect();
        let measured: Vec<(f64, f64)> = ran.iter().map(|r| r.1).collect();
        let wanted = self.params.wanted.iter().find_map(|&w| {
            // the cheapest that should meet a wanted error, if it is cheaper than what does
            let met = measured
                .iter()
                .filter(|p| p.1 <= w)
                .map(|p| p.0)
                .fold(f64::INFINITY, f64::min);
            (0..guessed.len())
                .filter(|&k| guessed[k].1 <= w && WORTH * guessed[k].0 < met)
                .min_by(|&a, &b| guessed[a].0.total_cmp(&guessed[b].0))
        });
        let k = wanted.or_else(|| most_promising(&guessed, &measured, WORTH))?;
        Some((candidates[k].clone(), guessed[k]))
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

/// Lines of samples through a generated mesh, for a scene that asks for none: at a third and two thirds of each width.
fn lines(spec: &SceneSpec) -> Vec<String> {
    let Some((min, max)) = knobs::corners(spec) else {
        return Vec::new();
    };
    let d = min.len();
    let mut list = Vec::new();
    for axis in 0..d {
        for (k, share) in [0.31, 0.64].iter().enumerate() {
            let (mut from, mut to) = (min.clone(), max.clone());
            for a in (0..d).filter(|a| *a != axis) {
                from[a] = min[a] + share * (max[a] - min[a]);
                to[a] = from[a];
            }
            list.push(format!(
                "output.lines.trade-{axis}-{k}={{from={},to={},samples=101}}",
                coordinates(&from),
                coordinates(&to)
            ));
            if d == 1 {
                break;
            }
        }
    }
    list
}

/// What the reference left.
fn kept(folder: &Path) -> Result<Measured, TradeError> {
    let path = folder.join("summary.json");
    let file_error = |source| TradeError::File {
        path: path.clone(),
        source,
    };
    let text = std::fs::read_to_string(&path).map_err(file_error)?;
    let summary = serde_json::from_str(&text).map_err(|e| TradeError::Summary {
        why: e.to_string(),
        text,
    })?;
    Measured::read(folder, &summary).map_err(file_error)
}

/// The record of a study, if there is one; a last line that was cut off is left out.
fn read_record(path: &Path) -> Result<Option<(Head, Vec<Case>)>, TradeError> {
    let text = match std::fs::read_to_string(path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(source) => {
            return Err(TradeError::File {
                path: path.to_path_buf(),
                source,
            });
        }
        Ok(text) => text,
    };
    let mut lines = text.lines();
    let Some(head) = lines.next().and_then(|l| serde_json::from_str(l).ok()) else {
        return Err(TradeError::Another {
            path: path.to_path_buf(),
        });
    };
    let cases = lines.map_while(|l| serde_json::from_str(l).ok()).collect();
    Ok(Some((head, cases)))
}

fn new_record(path: &Path, head: &Head, cases: &[Case]) -> std::io::Result<std::fs::File> {
    let part = path.with_extension("part");
    let mut file = std::fs::File::create(&part)?;
    write_line(&mut file, head)?;
    for case in cases {
        write_line(&mut file, case)?;
    }
    std::fs::rename(&part, path)?;
    Ok(file)
}

fn write_line(file: &mut std::fs::File, value: &impl Serialize) -> std::io::Result<()> {
    let mut line = serde_json::to_string(value).map_err(std::io::Error::other)?;
    line.push('\n');
    file.write_all(line.as_bytes())?;
    file.sync_data()
}
