//! A scene of any dimension whose zone is placed: the input of a run.

use std::any::Any;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::budget;
use super::chosen::with_choice;
use super::error::RunError;
use super::fields;
use super::motion::{self, RunOptions};
use super::placed_scene::PlacedScene;
use super::statics;
use super::zone_placement::{self};
use crate::observe::checkpoint::Fingerprint;
use crate::observe::pieces::agreed;
use crate::observe::provenance::{self, Provenance};
use crate::observe::summary::{Decision, RunSummary};
use crate::observe::warning::{Policy, Warning};
use crate::progress::Progress;
use crate::scene::draft::Draft;
use crate::scene::expression::Expression;
use crate::scene::rim;
use crate::scene::source::read;
use crate::scene::validated::Output;
use crate::scene::{Scene, SceneError, SceneSpec, Solve, Source};
use crate::system::Ranks;

/// Validates a scene and places its zone, if it leaves that to the program.
fn placed<const D: usize>(
    spec: &SceneSpec,
    directory: &Path,
    name: &str,
    fingerprint: Fingerprint,
) -> Result<Box<PlacedScene<D>>, SceneError> {
    let draft = Draft::new(spec, directory, name, fingerprint)?;
    let Some(found) = zone_placement::placed(&draft)? else {
        return Ok(Box::new(rim::scene(&draft, None)?.into()));
    };
    let mut scene = rim::scene(&draft, Some(&found.zone))?;
    scene.placement = Some(found.placement);
    let kept = found.kept.map(Arc::new);
    Ok(Box::new(PlacedScene { scene, kept }))
}

/// Claims the files that a scene will write, runs it, at rest, in time or in load steps, and writes its provenance.
fn run<const D: usize>(
    scene: PlacedScene<D>,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    let is_static = scene.solve == Solve::Static;
    let processes = options.writers().map_or(1, Ranks::count);
    let of_stage = (scene.before.iter()).map(|stage| scene.output.of_stage(&stage.name));
    let outputs: Vec<_> = of_stage.chain([scene.output.clone()]).collect();
    let claim = || {
        let each = |output: &Output<D>| output.claim(&scene.title, !is_static, processes);
        outputs.iter().map(each).collect::<Result<Vec<_>, _>>()
    };
    let claimed = options.writes().then(claim).transpose();
    let _claim = agreed(options.ranks, claimed, &scene.output.directory)?;
    let (unused, policy) = (scene.unused(), scene.warnings.clone());
    let scene_hash = provenance::scene_hash(scene.fingerprint.value());
    let path = scene.output.provenance_path();
    let mut summary = match is_static {
        true => statics::run(scene, options, progress)?,
        false => with_choice(scene.scene, |scene| motion::run(scene, options, progress))?,
    };
    summary.warnings.extend(unused);
    policy.apply(&mut summary.warnings);
    (summary.version, summary.scene_hash) = (provenance::VERSION, scene_hash);
    // under the claim still: another run of the scene would take a file half written for a leftover
    if let Some(program) = options.program.filter(|_| options.writes())
        && !summary.files.is_empty()
    {
        let processes = options.ranks.map_or(1, Ranks::count);
        Provenance::new(&summary, program, processes).write(&path)?;
    }
    Ok(summary)
}

/// A validated scene of any dimension.
#[derive(Clone, Debug)]
pub enum AnyScene {
    /// One dimension.
    Bar(Box<PlacedScene<1>>),
    /// Two dimensions.
    Plane(Box<PlacedScene<2>>),
    /// Three dimensions.
    Solid(Box<PlacedScene<3>>),
}

/// Evaluates an expression of the scene, whatever its dimension.
macro_rules! each {
    ($any:expr, $scene:ident => $then:expr) => {
        match $any {
            $crate::run::AnyScene::Bar($scene) => $then,
            $crate::run::AnyScene::Plane($scene) => $then,
            $crate::run::AnyScene::Solid($scene) => $then,
        }
    };
}

pub(super) use each;

/// Refuses the name of a field that there is not.
fn known_fields(spec: &SceneSpec) -> Result<(), SceneError> {
    let known = fields::asked_by("output.fields");
    let unknown = |name: &&crate::scene::Text| !known.contains(&name.value.as_str());
    let Some(name) = spec.output.fields.iter().find(unknown) else {
        return Ok(());
    };
    Err(SceneError::wrong_value(format!("`output.fields` names `{name}`, which is no field to ask for"))
        .label(name.span.clone(), "not known")
        .help(format!(
            "known are {}; `bondline fields` lists all, and the keys of those that have one of their own",
            known.join(", ")
        )))
}

impl AnyScene {
    /// Reads and validates a scene file with overrides `key=value`.
    ///
    /// # Errors
    /// A [`SceneError`] with place, value and remedy; for a scene with an `accuracy`, which `bondline_study::load` takes.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, SceneError> {
        let (source, directory, name) = read(path, overrides)?;
        Self::from_source(&source, directory, &name)
    }

    /// Validates a scene whose relative paths start in `directory` and whose files are named `name` by default.
    ///
    /// # Errors
    /// A [`SceneError`] with place, value and remedy; for a scene with an `accuracy`, which `bondline_study::from_source` takes.
    pub fn from_source(source: &Source, directory: &Path, name: &str) -> Result<Self, SceneError> {
        if source.table()?.contains_key("accuracy") {
            return Err(SceneError::conflict("`accuracy` leaves open what only trial runs of the scene can choose")
                .help("load it by `bondline_study::load`, which makes them; or type mesh, horizon and points, and leave `accuracy` out")
                .shown_in(source));
        }
        Self::complete(source, directory, name)
    }

    /// Keeps the choices made for an accuracy, to be reported with the results.
    pub fn chose(&mut self, choices: Vec<Decision>) {
        each!(self, s => drop(s.choices.splice(0..0, choices)));
    }

    /// Validates a scene that leaves nothing open, whether or not it has an `accuracy`.
    ///
    /// # Errors
    /// A [`SceneError`] with place, value and remedy.
    pub fn complete(source: &Source, directory: &Path, name: &str) -> Result<Self, SceneError> {
        let spec = SceneSpec::parse(source)?;
        known_fields(&spec).map_err(|error| error.shown_in(source))?;
        let print = source.fingerprint()?;
        let found = match spec.dimension() {
            1 => placed(&spec, directory, name, print).map(Self::Bar),
            2 => placed(&spec, directory, name, print).map(Self::Plane),
            _ => placed(&spec, directory, name, print).map(Self::Solid),
        };
        found.map_err(|error| error.shown_in(source))
    }

    /// The scene, if it is of `D` dimensions.
    pub fn of_dimension<const D: usize>(self) -> Option<Scene<D>> {
        let found: Box<dyn Any> = each!(self, scene => scene);
        let scene = found.downcast::<PlacedScene<D>>().ok()?;
        Some(scene.scene)
    }

    /// Writes all files into another folder than the scene's.
    pub fn set_output_directory(&mut self, directory: PathBuf) {
        each!(self, s => s.output.directory = directory);
    }

    /// Returns true if the scene runs in steps, so that it can be interrupted and resumed.
    pub fn moves(&self) -> bool {
        each!(self, s => s.solve != Solve::Static)
    }

    /// The horizon \[m\], typed or chosen; none without points, and of one that varies in space.
    pub fn horizon(&self) -> Option<f64> {
        let points = each!(self, s => s.peridynamics.as_ref().map(|p| &p.horizon));
        points.and_then(Expression::as_constant)
    }

    /// Runs the scene from its beginning and writes its outputs.
    ///
    /// # Errors
    /// [`RunError`], each with place and remedy.
    pub fn run(self, progress: &dyn Progress) -> Result<RunSummary, RunError> {
        self.run_with(&RunOptions::default(), progress)
    }

    /// Runs the scene and writes its outputs.
    ///
    /// Parallel loops run on rayon's threads. A loop that is begun on another thread puts that to sleep and wakes it again, which counts where loops are short:
    /// begin the run on one of rayon's, by `rayon::scope(|_| scene.run_with(&options, progress))`, as the program does.
    ///
    /// # Errors
    /// [`RunError`], each with place and remedy.
    pub fn run_with(
        self,
        options: &RunOptions<'_>,
        progress: &dyn Progress,
    ) -> Result<RunSummary, RunError> {
        // what a process of several needs is not known beforehand
        if options.ranks.is_none() {
            self.fits()?;
        }
        each!(self, s => run(*s, options, progress))
    }

    /// Fingerprint of all of the scene that determines its results: 16 hexadecimal digits.
    pub fn scene_hash(&self) -> String {
        provenance::scene_hash(each!(self, s => s.fingerprint.value()))
    }

    /// Warnings of parts of the scene that touch nothing.
    pub fn unused(&self) -> Vec<Warning> {
        each!(self, s => s.unused())
    }

    /// Kinds of warnings that the scene leaves out or does not accept.
    pub fn warning_policy(&self) -> &Policy {
        each!(self, s => &s.warnings)
    }

    /// Refuses what needs more memory than there is, before anything of it is laid out.
    pub fn fits(&self) -> Result<(), RunError> {
        each!(self, s => budget::fits(s))
    }
}
