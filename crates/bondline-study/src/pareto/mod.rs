//! Cost against accuracy: a scene run with its knobs turned, each case measured against a reference.
//!
//! | file | what |
//! |---|---|
//! | `parameters.rs` | parameters, cases and end of a study |
//! | `trial.rs` | one case in a process of its own: its cost, its outcome |
//! | `surrogate.rs` | guesses of cost and error for cases that were not run; the Pareto front |
//! | `study.rs` | which case runs next |
//! | `reference.rs` | what errors are measured against, and its own error |
//! | `record.rs` | records of a study, so that it can go on |
//! | `report.rs` | table, CSV, JSON, plot, and the scene for a wanted error |
//!
//! The knobs of a scene, and the differences between outputs, are in `crates/bondline-study/src/variants`.
//!
//! First the reference runs, then the scene as it is, then every setting alone. From these, cost and error of every combination are guessed. Combinations run that promise to be the cheapest of their coupling with the errors that are
//! wanted, then those that promise the largest gain over the front so far, until none promises any or the time is used up. Every outcome is written as soon as it is known, and a study that was interrupted goes on from there.

pub(crate) mod parameters;
mod record;
mod reference;
mod report;
mod study;
mod surrogate;
mod trial;

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

pub use crate::variants::{KNOBS, Knob, Quantity, Setting, distance_from_path, typed};
pub use parameters::{
    Case, Cost, CostBy, Outcome, OwnError, Reference, ReferenceRun, Trade, TradeEnd, TradeError,
    TradeParams, Want,
};
pub use surrogate::front;

use crate::accuracy;
use crate::variants::{Base, Measured, measured_keys};
use bondline::observe::claim::{Claim, Files};
use bondline::progress::Progress;
use bondline::regular_file;
use bondline::run::AnyScene;
use bondline::scene::spec::PeridynamicsSpec;
use bondline::scene::{SceneError, SceneSpec, Source};
use record::{Head, kept, new_record, read_record};
use reference::ChosenReference;
use study::Study;
use trial::{Attempt, Ran, Runner};

/// A case that takes longer than so many times the reference is of no use to anyone.
const PATIENCE: f64 = 4.0;

/// A scene whose knobs are turned, as every case finds it.
struct Prepared {
    text: String,
    plain: Source,
    base: Base,
    knobs: Vec<Knob>,
    /// Keys that all cases have.
    common: Vec<String>,
    reference: ChosenReference,
    /// Names of the probes, in the order of their rows.
    probes: Vec<String>,
}

impl Prepared {
    /// Reads the scene and chooses what it leaves open.
    fn of(params: &TradeParams) -> Result<Self, TradeError> {
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
        let mut spec = SceneSpec::parse(complete).map_err(scene_error)?;
        let mut base = Base::of(&spec);
        let typed = horizon_of_cells(&base, &spec, complete, directory).map_err(scene_error)?;
        if let Some(key) = &typed {
            let mut complete = complete.clone();
            complete.push_override(key).map_err(scene_error)?;
            spec = SceneSpec::parse(&complete).map_err(scene_error)?;
            base = Base::of(&spec);
        }
        let knobs = chosen_knobs(&base, params)?;
        let settings: Vec<Setting> = knobs.iter().flat_map(|k| k.settings.clone()).collect();
        let mut common = params.overrides.clone();
        common.extend(chosen.into_iter().flat_map(|c| c.1.overrides));
        common.extend(typed);
        common.extend(measured_keys(&spec));
        let runs = |keys: &[String]| {
            let mut source = plain.clone();
            let mut all = common.iter().chain(keys);
            all.all(|key| source.push_override(key).is_ok())
                && AnyScene::from_source(&source, directory, "trade").is_ok()
        };
        let reference = ChosenReference::of(&params.reference, &base, &settings, runs)?;
        let probes = spec.output.probes.keys().map(|name| name.value.clone());
        let probes = probes.collect();
        Ok(Self {
            text,
            plain,
            base,
            knobs,
            common,
            reference,
            probes,
        })
    }

    /// The reference and the cases so far: those of a study that goes on, or a new one.
    ///
    /// # Errors
    /// [`TradeError`] if the folder holds another study, or the reference does not run.
    fn reference(
        &self,
        runner: &Runner<'_>,
        params: &TradeParams,
        record_path: &Path,
        progress: &dyn Progress,
    ) -> Result<(Measured, Head, Vec<Case>), TradeError> {
        let directory = params.scene.parent().unwrap_or(Path::new(""));
        let program = record::program(runner.program)?;
        let ChosenReference { keys, other, .. } = &self.reference;
        let all: Vec<String> = self.common.iter().chain(keys).cloned().collect();
        let mesh = record::mesh(&self.plain, directory, &all);
        let head_of = |quantities: Vec<Quantity>, cost| Head {
            program: program.clone(),
            scene: self.text.clone(),
            mesh,
            overrides: self.common.clone(),
            reference: keys.clone(),
            other: other.as_ref().map(|(_, text)| text.clone()),
            quantities,
            cost,
        };
        let folder = params.output.join("reference");
        let old = read_record(record_path)?;
        match old {
            Some((head, cases)) => {
                let reference = kept(&folder, &self.probes)?;
                let quantities = quantities_of(&reference, params)?;
                if head != head_of(quantities, head.cost) {
                    return Err(TradeError::Another {
                        path: record_path.to_path_buf(),
                    });
                }
                Ok((reference, head, cases))
            }
            None => {
                progress.stage("reference", None);
                let ran = match other {
                    Some((scene, _)) => {
                        let other = Runner {
                            scene,
                            probes: self.probes.clone(),
                            ..*runner
                        };
                        self.measure(&other, &[], &folder, params)?
                    }
                    None => self.measure(runner, &all, &folder, params)?,
                };
                let quantities = quantities_of(&ran.measured, params)?;
                let head = head_of(quantities, ran.cost);
                Ok((ran.measured, head, Vec::new()))
            }
        }
    }

    /// Runs the reference.
    fn measure(
        &self,
        runner: &Runner<'_>,
        keys: &[String],
        folder: &Path,
        params: &TradeParams,
    ) -> Result<Ran, TradeError> {
        match runner.run(keys, folder, params.budget)? {
            Attempt::Ran(ran) => Ok(ran),
            Attempt::Refused(why) => Err(TradeError::Base {
                what: "the reference",
                why,
                remedy: "choose another one with --reference",
            }),
            Attempt::OverTime | Attempt::Interrupted => Err(TradeError::Base {
                what: "the reference",
                why: "it used up the time".to_owned(),
                remedy: "give more with --budget, or another one with --reference",
            }),
        }
    }
}

/// The horizon that a scene on the mesh of a file leaves to the program, as a key: knobs turn what is typed.
///
/// # Errors
/// [`SceneError`] of a scene that cannot be run.
fn horizon_of_cells(
    base: &Base,
    spec: &SceneSpec,
    source: &Source,
    directory: &Path,
) -> Result<Option<String>, SceneError> {
    let is_left_out = |pd: &PeridynamicsSpec| pd.horizon.is_none();
    if !base.lacks_horizon() || !spec.peridynamics.as_ref().is_some_and(is_left_out) {
        return Ok(None);
    }
    let found = AnyScene::from_source(source, directory, "trade")?.horizon();
    Ok(found.map(|horizon| format!("peridynamics.horizon={horizon:e}")))
}

/// The quantities to compare: those asked for, and where errors are asked for without one, all that suit the outputs.
fn quantities_of(measured: &Measured, params: &TradeParams) -> Result<Vec<Quantity>, TradeError> {
    let mut quantities: Vec<Quantity> = Vec::new();
    let suits = params.wants.iter().any(|want| want.quantity.is_none());
    let suiting = if suits {
        measured.quantities()
    } else {
        Vec::new()
    };
    let typed = params.wants.iter().filter_map(|want| want.quantity.clone());
    for quantity in typed.chain(suiting) {
        if measured.error(measured, &quantity).is_none() {
            return Err(TradeError::Quantity {
                quantity: quantity.name(),
            });
        }
        if !quantities.contains(&quantity) {
            quantities.push(quantity);
        }
    }
    Ok(quantities)
}

/// The error that is wanted of a quantity: its own, or the one of all others.
fn wanted(quantity: &Quantity, wants: &[Want]) -> f64 {
    let of = |quantity: Option<&Quantity>| {
        let mut own = wants.iter().filter(|w| w.quantity.as_ref() == quantity);
        own.next_back().map(|want| want.error)
    };
    of(Some(quantity))
        .or_else(|| of(None))
        .expect("a quantity is asked for, or suits those who ask for none")
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
    let prepared = Prepared::of(params)?;
    let directory = params.scene.parent().unwrap_or(Path::new(""));
    let runner = Runner {
        program,
        scene: &params.scene,
        probes: prepared.probes.clone(),
        interrupt,
    };
    let start = Instant::now();
    let _claim = Claim::take(
        &params.output,
        &params.scene.display().to_string(),
        &files(),
    )?;
    let record_path = params.output.join("cases.jsonl");
    let (measured, head, cases) = prepared.reference(&runner, params, &record_path, progress)?;
    let Prepared {
        plain,
        base,
        knobs,
        common,
        reference,
        ..
    } = prepared;
    let with = |keys: &[String]| -> Vec<String> { common.iter().chain(keys).cloned().collect() };
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
        settings: (knobs.into_iter().enumerate())
            .flat_map(|(k, knob)| knob.settings.into_iter().map(move |s| (k, s)))
            .collect(),
        common,
        reference: measured,
        reference_keys: (reference.other.is_none()).then(|| reference.keys.clone()),
        wanted: (head.quantities.iter())
            .map(|quantity| wanted(quantity, &params.wants))
            .collect(),
        quantities: head.quantities,
        cases,
        skipped: Vec::new(),
        record,
        record_path,
        deadline: start + params.budget,
        patience: Duration::from_secs_f64(PATIENCE * head.cost.seconds + 10.0),
    };
    let ended = study.all(reference.own_error.case(), progress)?;
    progress.finish();
    let left = study.combinations().len();
    Ok(Trade {
        scene: params.scene.clone(),
        wants: study.quantities.into_iter().zip(study.wanted).collect(),
        reference: reference.with(head.cost),
        cases: study.cases,
        by: params.cost,
        left,
        ended,
    })
}

/// Names of the files that a study writes into its folder, and of its cases below it.
fn files() -> Files {
    Files {
        name: "trade".to_owned(),
        files: ["cases.jsonl", "reference", "case"]
            .map(str::to_owned)
            .into(),
        series: false,
        others: Vec::new(),
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
