//! Set-up of every run in time or in load steps: the model, its rows and bonds, and the checkpoint that it goes on from.

use super::breaks::Breaks;
use super::contact::{ContactRecord, touching};
use super::dynamic_system::{DynamicSystem, LayoutStart, dynamic};
use super::guard::energies_are_apart;
use super::impact_record::ImpactRecord;
use super::saved::{Saved, Written};
use super::sharing::Sharing;
use super::writer::Recorder;
use super::{RunOptions, StartFrom};
use std::sync::Arc;

use crate::observe::ObserveError;
use crate::observe::checkpoint::{CheckpointError, CheckpointFile, Found, Pace};
use crate::observe::proof::Proof;
use crate::observe::summary::{Decision, Stopwatch, Timings, resident_memory_bytes};
use crate::progress::Progress;
use crate::run::bonds;
use crate::run::condition_terms::ConditionTerms;
use crate::run::conduction::heated_problem;
use crate::run::error::RunError;
use crate::run::proof::{self, Subject, growth};
use crate::run::setup::{self, RunSettings};
use crate::scene::spec::CouplingTraits;
use crate::scene::validated::Scene;
use crate::system::{Ranks, SemiDiscrete, WithTerms};
use crate::{
    contact::SurfaceContact,
    coupling::{Impact, Operator, Problem},
    model::{Model, Sampler},
};

/// A scene with all that it computes before its first step.
pub struct ModelSetup<'a, const D: usize> {
    /// The data that stay when zones change.
    pub(crate) setup: RunSetup,
    /// Evidence that no mode grows, if there is any.
    pub proved: Option<&'static str>,
    /// Sites, families and zones.
    pub model: &'a Model<D>,
    /// Rows of the stiffness.
    pub operator: &'a Operator<'a, D>,
    /// Settings that the run keeps of the scene.
    pub rest: &'a RunSettings<D>,
    /// The system that solvers see, with its properties.
    pub moving: DynamicSystem<'a>,
    /// Springs that hold the body; the system has them.
    pub(crate) terms: Arc<ConditionTerms>,
    /// Contact of surfaces, if there is any; the system has it.
    pub(crate) contact: Option<Arc<SurfaceContact<D>>>,
    /// Results of the proof of the model.
    pub proof: Proof,
    /// Memory that the program held when sites and bonds were there.
    pub bytes: u64,
}

/// A run before its zones are laid out: the data that stay when they change.
pub(crate) struct RunSetup {
    /// The title of the scene.
    pub title: String,
    /// Coupling of its bodies.
    pub traits: CouplingTraits,
    /// Change of the scene that helps where a mode may grow.
    pub remedy: &'static str,
    /// Choices of the program where the scene leaves them open.
    pub choices: Vec<Decision>,
    /// Seconds of each stage so far.
    pub timings: Timings,
    /// The clock of the stages.
    pub watch: Stopwatch,
}

impl RunSetup {
    /// Adds the seconds since the last lap to a stage.
    pub fn lap(&mut self, stage: &str) {
        self.watch.lap(&mut self.timings, stage);
    }
}

/// Takes a scene apart, once its temperature is solved for.
///
/// # Errors
/// Those of heat conduction.
pub(crate) fn begun<const D: usize>(
    scene: Scene<D>,
    progress: &dyn Progress,
) -> Result<(RunSetup, Problem<D>, RunSettings<D>), RunError> {
    let mut watch = Stopwatch::start();
    let title = scene.title.clone();
    let traits = scene.coupling.traits();
    let remedy = growth::remedy(&scene.coupling);
    let mut timings = Timings::default();
    if let Some(placement) = &scene.placement {
        timings.add("placing the zone", placement.seconds);
    }
    let (problem, rest) = heated_problem(scene, (&mut timings, &mut watch), progress)?;
    let begun = RunSetup {
        title,
        traits,
        remedy,
        choices: rest.made().cloned().collect(),
        timings,
        watch,
    };
    Ok((begun, problem, rest))
}

/// Lays a problem out and hands it on, and gives it back afterwards.
pub(crate) fn lay_out<const D: usize, T>(
    mut run: RunSetup,
    problem: Problem<D>,
    rest: &RunSettings<D>,
    start: LayoutStart<'_, D>,
    progress: &dyn Progress,
    then: impl FnOnce(ModelSetup<'_, D>) -> Result<T, RunError>,
) -> Result<(T, Problem<D>), RunError> {
    let holders = (start.ranks).filter(|_| start.sharing == Sharing::Families);
    let (model, coupling) = setup::shared_model(problem, rest, holders, progress)?;
    bonds::check(&model, &rest.output, start.ranks)?;
    run.choices.extend(setup::model_choices(&model));
    run.choices.extend(bonds::told(&model, &rest.output));
    run.lap("sites and bonds");
    let bytes = resident_memory_bytes().unwrap_or(0);
    let operator = coupling.operator(&model)?;
    let terms = Arc::new(ConditionTerms::new(&model, &rest.conditions)?);
    let mut moving = dynamic(
        &model,
        coupling.as_ref(),
        &operator,
        rest,
        start,
        &mut run.choices,
        progress,
    )?;
    (run.choices).extend(without_balance(&model, rest, moving.is_linear));
    let of = (start.ranks, moving.system.as_ref());
    let proved = growth::proved(&model, &operator, of, progress);
    run.lap("rows and bonds");
    let proof = proof::prove(
        &Subject {
            model: &model,
            coupling: coupling.as_ref(),
            operator: &operator,
            rest,
            stiffness: None,
            product: &|u, force| moving.system.tangent_into(u, force),
            system: Some(moving.system.as_ref()),
            ranks: start.ranks,
        },
        progress,
    )?;
    proof::hold(&proof)?;
    run.lap("proof");
    if !terms.is_empty() {
        moving.system = Box::new(WithTerms::new(moving.system, terms.all()));
    }
    let (moving, contact) = touching(&model, rest, moving, &mut run.choices)?;
    let done = then(ModelSetup {
        setup: run,
        proved,
        model: &model,
        operator: &operator,
        rest,
        moving,
        terms: Arc::clone(&terms),
        contact,
        proof,
        bytes,
    })?;
    drop(operator);
    Ok((
        done,
        Problem {
            body: model.into_body(),
            coupling,
        },
    ))
}

/// Lays a scene out and hands it on; `first` has a say before anything is computed.
pub fn laid_out<const D: usize, S, T>(
    scene: Scene<D>,
    ranks: Option<&dyn Ranks>,
    progress: &dyn Progress,
    first: impl FnOnce(&RunSettings<D>, &mut Vec<Decision>) -> Result<S, RunError>,
    then: impl FnOnce(ModelSetup<'_, D>, S) -> Result<T, RunError>,
) -> Result<T, RunError> {
    let (mut begun, problem, rest) = begun(scene, progress)?;
    let ready = first(&rest, &mut begun.choices)?;
    let start = LayoutStart {
        broken: None,
        ranks,
        sharing: Sharing::Nothing,
    };
    let done = lay_out(begun, problem, &rest, start, progress, |laid_out| {
        then(laid_out, ready)
    })?;
    Ok(done.0)
}

/// The checkpoint file of a run, and what it holds if the run goes on from it.
///
/// # Errors
/// [`RunError::Checkpoint`] for one that cannot be used: at once, not after the model is there.
pub(crate) fn opened<const D: usize>(
    rest: &RunSettings<D>,
    options: &RunOptions<'_>,
    choices: &mut Vec<Decision>,
) -> Result<(CheckpointFile, Option<Saved>), RunError> {
    let name = format!("{}.checkpoint", rest.output.name);
    let path = rest.output.directory.join(name);
    let file = CheckpointFile::new(path, rest.fingerprint.clone());
    let saved = match options.start {
        StartFrom::Beginning => None,
        StartFrom::Checkpoint => read(&file, choices)?,
    };
    // each has read the file for itself
    let step = saved.as_ref().map_or(u64::MAX, |saved| saved.state.step);
    setup::same_everywhere(rest, step, options.ranks)?;
    Ok((file, saved))
}

/// The files of a run, from its beginning or cut back to what was `written` at a checkpoint; the interval between checkpoints is that of the options, or else the one that the scene types.
///
/// # Errors
/// [`ObserveError`] for files that cannot be made or cut.
pub(crate) fn recorder<'a, const D: usize>(
    (model, rest): (&Model<D>, &'a RunSettings<D>),
    (options, typed): (RunOptions<'a>, Option<Pace>),
    (impact, contact): (Option<Arc<Impact<D>>>, Option<Arc<SurfaceContact<D>>>),
    (breaks, is_linear): (Breaks, bool),
    file: CheckpointFile,
    written: Option<&Written>,
) -> Result<Recorder<'a, D>, ObserveError> {
    let peaks = written.map(|written| &written.peaks[..]);
    Recorder::new(
        &rest.output,
        &rest.conditions,
        &Sampler::new(model),
        impact.map(|impact| ImpactRecord::new(impact, &rest.impactors, peaks)),
        contact.map(ContactRecord::new),
        breaks,
        is_linear,
        file,
        RunOptions {
            checkpoint_every: options.checkpoint_every.or(typed),
            ..options
        },
        written,
    )
}

/// Puts the damage of a checkpoint back.
///
/// # Errors
/// [`CheckpointError::Content`] if it is that of another model.
pub(crate) fn restore(
    system: &mut dyn SemiDiscrete,
    saved: Option<&Saved>,
    file: &CheckpointFile,
) -> Result<(), CheckpointError> {
    match saved {
        Some(saved) if !system.restore_damage(&saved.damage) => Err(CheckpointError::Content {
            path: file.path().to_path_buf(),
            message: "its bonds are not those of this model".to_owned(),
        }),
        _ => Ok(()),
    }
}

/// The last checkpoint, if there is one.
///
/// # Errors
/// [`CheckpointError`] for one that cannot be used.
fn read(
    file: &CheckpointFile,
    choices: &mut Vec<Decision>,
) -> Result<Option<Saved>, CheckpointError> {
    let (saved, found): (Saved, Found) = match file.read() {
        Err(CheckpointError::None { path }) => {
            choices.push(Decision {
                choice: "from the beginning".to_owned(),
                why: format!("there is no checkpoint {} yet", path.display()),
            });
            return Ok(None);
        }
        other => other?,
    };
    choices.push(Decision {
        choice: format!(
            "resumed after step {} of {}",
            saved.state.step, saved.pace.steps
        ),
        why: match found {
            Found::Current => "the last checkpoint".to_owned(),
            Found::Previous(why) => format!("the last checkpoint but one, for {why}"),
        },
    });
    Ok(Some(saved))
}

/// Energies of a scene with a temperature that do not add up, if any do not.
fn without_balance<const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
    is_linear: bool,
) -> Option<Decision> {
    energies_are_apart(model, rest, is_linear).then(|| Decision {
        choice: "energies that do not add up to a balance".to_owned(),
        why: "temperature: its forces on linear elements do work as loads do, bonds and laws that know it store mechanical energy alone".to_owned(),
    })
}
