//! From what was typed to a scene that can be run: every name resolved, every number checked.

use std::path::{Path, PathBuf};

use super::accuracy;
use super::automatic::{Placed, Placement, Unplaced};
use super::breaking::Breaking;
use super::check;
use super::conditions::{self, Condition};
use super::error::{SceneError, SceneErrorKind};
use super::follow::Follow;
use super::initial::Initial;
use super::materials::{self, Material};
use super::meshing;
use super::motion::RunOptions;
use super::peridynamics::{self, Peridynamics, Points};
use super::predict::{self, Prediction};
use super::region::Region;
use super::run;
use super::run_error::RunError;
use super::solve::Solve;
use super::source::Source;
use super::spec::{
    CouplingSpec, InfluenceSpec, KinematicsSpec, SceneSpec, UnprovenSpec, ZonesNeeded,
};
use super::unused::Parts;
use super::{
    agreement, automatic, bodies, breaking, budget, chosen, follow, initial, joined, obstacles,
    output, solve, zones,
};
use crate::coupling::Zone;
use crate::material::Kinematics;
use crate::mesh::Mesh;
use crate::observe::checkpoint::Fingerprint;
use crate::observe::report::number;
use crate::observe::summary::{Choice, RunSummary};
use crate::peridynamics::Influence;
use crate::progress::Progress;
use crate::regular_file;
use crate::shape::{Barrier, Shape};
use crate::solve::ordering::Ordering;
use crate::tensor::{Vector, padded};

/// A validated scene of dimension `D`.
#[derive(Clone, Debug)]
pub struct Scene<const D: usize> {
    /// What the scene says of itself; its name if it says nothing.
    pub title: String,
    /// How the body stands for a solid.
    pub kinematics: Kinematics,
    /// The mesh of the whole body.
    pub mesh: Mesh<D>,
    /// The model of each cell.
    pub zones: Vec<Zone>,
    /// The materials.
    pub materials: Vec<Material<D>>,
    /// The material of each cell.
    pub cell_material: Vec<u16>,
    /// The peridynamic choices; none if the scene is local throughout.
    pub peridynamics: Option<Peridynamics<D>>,
    /// How the models are joined.
    pub coupling: CouplingSpec,
    /// Why the coupling was chosen; none if the scene names it.
    pub coupling_why: Option<String>,
    /// How the nonlocal zone came about; none if the scene draws it.
    pub(crate) placement: Option<Placement<D>>,
    /// What was chosen for the accuracy that the scene wants, and for points that it does not place.
    pub choices: Vec<Choice>,
    /// Displacements, tractions, body forces.
    pub conditions: Vec<Condition<D>>,
    /// Empty regions: no point lies inside.
    pub voids: Vec<Shape<D>>,
    /// Voids and cracks that cut bonds.
    pub barriers: Vec<Barrier<D>>,
    /// What is computed.
    pub solve: Solve,
    /// Displacements and velocities at time zero.
    pub initial: Vec<Initial<D>>,
    /// How bonds deform and break.
    pub breaking: Breaking<D>,
    /// How the nonlocal zone follows the crack, if it does.
    pub follow: Option<Follow>,
    /// The linear solver.
    pub solver: Solver,
    /// What is written.
    pub output: Output<D>,
    /// The scene with the coupling to go on with, if this one was chosen and turns out not to hold.
    pub(crate) otherwise: Option<Box<Self>>,
    /// Warnings of parts that touch nothing.
    pub unused: Vec<String>,
    /// A number for the scene's text, by which a checkpoint knows that it belongs to it.
    pub fingerprint: Fingerprint,
}

/// The linear solver of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solver {
    /// Which solver.
    pub method: crate::solve::statics::Method,
    /// Elimination order of a direct one.
    pub ordering: Ordering,
    /// Relative residual.
    pub tolerance: f64,
    /// What becomes of a model whose proof refuses it.
    pub unproven: UnprovenSpec,
    /// Most iterations.
    pub max_iterations: usize,
}

/// The outputs of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Output<const D: usize> {
    /// Folder of all files.
    pub directory: PathBuf,
    /// Beginning of all file names.
    pub name: String,
    /// Whether a VTU is written.
    pub vtu: bool,
    /// Lines of samples: name and positions.
    pub lines: Vec<(String, Vec<Vector<D>>)>,
    /// Probes: name and position.
    pub probes: Vec<(String, Vector<D>)>,
    /// Tips of cracks to follow.
    pub tips: Vec<Tip<D>>,
}

/// The tip of a crack: the farthest damaged point along a direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Tip<const D: usize> {
    /// Its name.
    pub name: String,
    /// The direction, of length 1.
    pub direction: Vector<D>,
    /// Where to look.
    pub inside: Region<D>,
    /// Damage from which a point counts.
    pub threshold: f64,
}

/// A validated scene of any dimension.
#[derive(Clone, Debug)]
pub enum AnyScene {
    /// One dimension.
    Bar(Box<Scene<1>>),
    /// Two dimensions.
    Plane(Box<Scene<2>>),
    /// Three dimensions.
    Solid(Box<Scene<3>>),
}

impl AnyScene {
    /// Reads and validates a scene file with overrides `key=value`.
    ///
    /// # Errors
    /// A [`SceneError`] with place, value and remedy.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, SceneError> {
        let (source, directory, name) = read(path, overrides)?;
        Self::from_source(&source, directory, &name)
    }

    /// Validates a scene whose relative paths start in `directory` and whose files are named `name` by default. What a scene with an
    /// `accuracy` leaves open is chosen, by small runs of it.
    ///
    /// # Errors
    /// A [`SceneError`] with place, value and remedy.
    pub fn from_source(source: &Source, directory: &Path, name: &str) -> Result<Self, SceneError> {
        let Some((complete, chosen)) = accuracy::completed(source, directory)? else {
            return Self::complete(source, directory, name);
        };
        let mut scene = Self::complete(&complete, directory, name)?;
        scene.chose(chosen.choices);
        Ok(scene)
    }

    /// Keeps what was chosen for an accuracy, to be told with the results.
    pub(super) fn chose(&mut self, choices: Vec<Choice>) {
        let known = match self {
            Self::Bar(s) => &mut s.choices,
            Self::Plane(s) => &mut s.choices,
            Self::Solid(s) => &mut s.choices,
        };
        known.splice(0..0, choices);
    }

    /// Validates a scene that leaves nothing open.
    pub(super) fn complete(
        source: &Source,
        directory: &Path,
        name: &str,
    ) -> Result<Self, SceneError> {
        let spec = SceneSpec::parse(source)?;
        let print = source.fingerprint()?;
        let found = match spec.kinematics.get_ref() {
            KinematicsSpec::Bar => {
                scene(&spec, Kinematics::Bar, directory, name, print).map(Self::bar)
            }
            KinematicsSpec::PlaneStress => {
                scene(&spec, Kinematics::PlaneStress, directory, name, print).map(Self::plane)
            }
            KinematicsSpec::PlaneStrain => {
                scene(&spec, Kinematics::PlaneStrain, directory, name, print).map(Self::plane)
            }
            KinematicsSpec::Solid => {
                scene(&spec, Kinematics::Solid, directory, name, print).map(Self::solid)
            }
        };
        found.map_err(|error| error.shown_in(source))
    }

    /// Writes all files into another folder than the scene's.
    pub fn set_output_directory(&mut self, directory: PathBuf) {
        match self {
            Self::Bar(s) => s.output.directory = directory,
            Self::Plane(s) => s.output.directory = directory,
            Self::Solid(s) => s.output.directory = directory,
        }
    }

    /// Whether the scene has a history, so that it can be interrupted and resumed.
    pub fn moves(&self) -> bool {
        let solve = match self {
            Self::Bar(s) => &s.solve,
            Self::Plane(s) => &s.solve,
            Self::Solid(s) => &s.solve,
        };
        *solve != Solve::Static
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
    /// # Errors
    /// [`RunError`], each with place and remedy.
    pub fn run_with(
        self,
        options: &RunOptions<'_>,
        progress: &dyn Progress,
    ) -> Result<RunSummary, RunError> {
        self.fits()?;
        let unused = self.unused().to_vec();
        let mut summary = match self {
            Self::Bar(s) => run::run(*s, options, progress),
            Self::Plane(s) => run::run(*s, options, progress),
            Self::Solid(s) => run::run(*s, options, progress),
        }?;
        summary.warnings.extend(unused);
        Ok(summary)
    }

    /// What a run will need, without solving; counted from volumes where laying the model out would take too long, see [`Prediction::counted`].
    ///
    /// # Errors
    /// [`RunError`], each with place and remedy.
    pub fn predict(self, progress: &dyn Progress) -> Result<Prediction, RunError> {
        self.fits()?;
        let unused = self.unused().to_vec();
        let counted = match &self {
            Self::Bar(s) => budget::counted(s),
            Self::Plane(s) => budget::counted(s),
            Self::Solid(s) => budget::counted(s),
        };
        if let Some(mut prediction) = counted {
            prediction.warnings.extend(unused);
            return Ok(prediction);
        }
        let mut prediction = match self {
            Self::Bar(s) => chosen::with_choice(*s, |s| predict::predict(s, progress)),
            Self::Plane(s) => chosen::with_choice(*s, |s| predict::predict(s, progress)),
            Self::Solid(s) => chosen::with_choice(*s, |s| predict::predict(s, progress)),
        }?;
        prediction.warnings.extend(unused);
        Ok(prediction)
    }

    /// The spacing of the scene's lattice of points, if it has one.
    pub(super) fn lattice_spacing(&self) -> Option<f64> {
        fn of<const D: usize>(scene: &Scene<D>) -> Option<f64> {
            match &scene.peridynamics.as_ref()?.points {
                Points::Lattice { spacing, .. } => Some(*spacing),
                Points::Cells | Points::Lattices { .. } => None,
            }
        }
        match self {
            Self::Bar(s) => of(s),
            Self::Plane(s) => of(s),
            Self::Solid(s) => of(s),
        }
    }

    /// Warnings of parts of the scene that touch nothing.
    pub fn unused(&self) -> &[String] {
        match self {
            Self::Bar(s) => &s.unused,
            Self::Plane(s) => &s.unused,
            Self::Solid(s) => &s.unused,
        }
    }

    /// Refuses what needs more memory than there is, before anything of it is laid out.
    fn fits(&self) -> Result<(), RunError> {
        match self {
            Self::Bar(s) => budget::fits(s),
            Self::Plane(s) => budget::fits(s),
            Self::Solid(s) => budget::fits(s),
        }
    }

    fn bar(scene: Scene<1>) -> Self {
        Self::Bar(Box::new(scene))
    }

    fn plane(scene: Scene<2>) -> Self {
        Self::Plane(Box::new(scene))
    }

    fn solid(scene: Scene<3>) -> Self {
        Self::Solid(Box::new(scene))
    }
}

/// The source of a scene file with overrides, the folder that its paths are relative to, and the name of its files.
///
/// # Errors
/// A [`SceneError`] for a file that cannot be read or an override without `=`.
pub(super) fn read<'p>(
    path: &'p Path,
    overrides: &[String],
) -> Result<(Source, &'p Path, String), SceneError> {
    let text = regular_file::read_scene(path).map_err(|error| {
        SceneError::new(
            SceneErrorKind::File,
            format!("cannot read the scene {}: {error}", path.display()),
        )
        .help("check the path; `bondline new scene.toml` writes a template")
    })?;
    let mut source = Source::new(path.display().to_string(), text);
    for text in overrides {
        source.push_override(text)?;
    }
    let directory = path.parent().unwrap_or(Path::new(""));
    let name = path
        .file_stem()
        .map_or("scene".into(), |s| s.to_string_lossy().into_owned());
    Ok((source, directory, name))
}

fn scene<const D: usize>(
    spec: &SceneSpec,
    kinematics: Kinematics,
    directory: &Path,
    name: &str,
    mut fingerprint: Fingerprint,
) -> Result<Scene<D>, SceneError> {
    let solver = solver(spec)?;
    let mesh = meshing::build::<D>(&spec.mesh, directory, &spec.kinematics.span())?;
    let influence = match spec
        .peridynamics
        .as_ref()
        .and_then(|p| p.influence.as_ref())
    {
        Some(i) => peridynamics::influence("peridynamics.influence", i)?,
        None => default_influence()?,
    };
    let (found, cell_material) =
        materials::materials(&spec.materials, influence, kinematics, &mesh)?;
    let solve = solve::solve(spec.solve.as_ref())?;
    let clock = solve.clock();
    let conditions = conditions::conditions(&spec.conditions, &mesh, clock)?;
    let initial = initial::initial(&spec.initial, &mesh, clock)?;
    meshing::add_mesh(&mesh, &mut fingerprint);
    let lay_out_as = |placed: Option<&Placed>,
                      instead: Option<&CouplingSpec>|
     -> Result<(Scene<D>, Option<CouplingSpec>), SceneError> {
        let mut joined = joined::joined(spec, &found, &mesh, placed, instead)?;
        let joining = joined.joining;
        if spec.peridynamics.is_none()
            && !matches!(joining.zones, ZonesNeeded::Everywhere(Zone::Local))
        {
            return Err(SceneError::new(
                SceneErrorKind::Missing,
                format!("coupling `{}` needs [peridynamics]", joining.name),
            )
            .label(joined.span.clone(), "has a peridynamic side")
            .help("add [peridynamics] with horizon = ..., or use coupling = \"local\""));
        }
        let mut zones = zones::zones(spec, &joined, &mesh, placed)?;
        let peridynamics = (spec.peridynamics.as_ref())
            .map(|p| peridynamics::peridynamics(p, joining.lattice, &mesh, &zones))
            .transpose()?;
        let choices = peridynamics.as_ref().and_then(points_choice);
        let peridynamics = peridynamics
            .map(|p| bodies::bodies(spec, joining, p, &mesh, &mut zones))
            .transpose()?;
        agreement::one_peridynamic_material(spec, &found, &cell_material, &zones)?;
        if let Some(p) = &peridynamics {
            agreement::horizon(spec, p, &mesh, &zones)?;
        }
        let (voids, barriers) = obstacles::obstacles(spec, &mesh, &zones)?;
        if matches!(solve, Solve::Explicit(_)) {
            densities(spec, &found)?;
        }
        let peridynamic = cell_material
            .iter()
            .zip(&zones)
            .find(|(_, zone)| **zone != Zone::Local)
            .map_or(0, |(m, _)| *m);
        let breaking = breaking::breaking(spec, &found[peridynamic as usize], &mesh)?;
        let follow = follow::follow(
            spec,
            &mut joined,
            &solve,
            &breaking,
            (peridynamics.as_ref()).map(|p| (p, &found[peridynamic as usize].law)),
            &mesh,
            |c| cell_material[c] == peridynamic,
        )?;
        let output = output::output(spec, &mesh, &voids, name)?;
        let scene = Scene {
            title: spec.title.clone().unwrap_or_else(|| name.to_owned()),
            kinematics,
            mesh: mesh.clone(),
            zones,
            materials: found.clone(),
            cell_material: cell_material.clone(),
            peridynamics,
            coupling: joined.coupling,
            coupling_why: joined.why,
            placement: None,
            choices: choices.into_iter().collect(),
            conditions: conditions.clone(),
            voids,
            barriers,
            solve: solve.clone(),
            initial: initial.clone(),
            breaking,
            follow,
            solver,
            output,
            otherwise: None,
            unused: Vec::new(),
            fingerprint,
        };
        Ok((scene, joined.otherwise))
    };
    let lay_out = |placed: Option<&Placed>| Ok(lay_out_as(placed, None)?.0);
    let unplaced = Unplaced {
        spec,
        mesh: &mesh,
        materials: &found,
        cell_material: &cell_material,
        solve: &solve,
        conditions: &conditions,
        initial: &initial,
        solver: &solver,
    };
    let mut scene = match automatic::placed(&unplaced, &lay_out)? {
        Some((placed, placement)) => Scene {
            placement: Some(placement),
            ..lay_out(Some(&placed))?
        },
        None => {
            let (mut scene, otherwise) = lay_out_as(None, None)?;
            if let Some(coupling) = otherwise {
                // an alternative that is wrong itself is none
                let laid_out = lay_out_as(None, Some(&coupling)).ok();
                scene.otherwise = laid_out.map(|(other, _)| Box::new(other));
            }
            scene
        }
    };
    let unused = |scene: &Scene<D>| Parts { spec, scene }.unused();
    scene.unused = unused(&scene);
    if let Some(other) = &mut scene.otherwise {
        other.unused = unused(other);
    }
    Ok(scene)
}

/// Says where points lie that the scene does not place.
fn points_choice<const D: usize>(p: &Peridynamics<D>) -> Option<Choice> {
    let Points::Lattice { spacing, .. } = &p.points else {
        return None;
    };
    Some(Choice {
        choice: format!("points on a lattice of spacing {}", number(*spacing)),
        why: p.points_why.clone()?,
    })
}

/// Refuses a motion without inertia.
fn densities<const D: usize>(spec: &SceneSpec, found: &[Material<D>]) -> Result<(), SceneError> {
    let Some(light) = found.iter().find(|m| m.density <= 0.0) else {
        return Ok(());
    };
    let span = spec
        .materials
        .get_key_value(light.name.as_str())
        .map_or(0..0, |(k, _)| k.span.clone());
    Err(SceneError::new(
        SceneErrorKind::Missing,
        format!("the material `{}` has no density, which [solve.explicit] needs", light.name),
    )
    .label(span, "has no inertia")
    .help("add density = ..., in the units of the scene (kg/m³ beside N and m; t/mm³ beside N and mm)"))
}

fn default_influence() -> Result<Influence, SceneError> {
    peridynamics::influence(
        "peridynamics.influence",
        &InfluenceSpec::Polynomial(super::spec::PolynomialSpec {
            degree: super::Count {
                value: 3,
                span: 0..0,
            },
            alpha: super::Count::default(),
        }),
    )
}

fn solver(spec: &SceneSpec) -> Result<Solver, SceneError> {
    let s = &spec.solver;
    let tolerance = match &s.tolerance {
        Some(t) => check::within(
            "solver.tolerance",
            t,
            t.value > 0.0 && t.value < 1.0,
            "must lie between 0 and 1",
            "1e-10 suits most scenes",
        )?,
        None => 1e-10,
    };
    let max_iterations = match &s.max_iterations {
        Some(n) if n.value == 0 => {
            return Err(SceneError::new(
                SceneErrorKind::WrongValue,
                "`solver.max-iterations` is 0",
            )
            .label(n.span.clone(), "no iteration")
            .help("allow at least 1; 500 suits most scenes"));
        }
        Some(n) => n.value,
        None => 500,
    };
    Ok(Solver {
        method: s.method,
        ordering: s.ordering,
        unproven: s.unproven,
        tolerance,
        max_iterations,
    })
}

impl<const D: usize> Scene<D> {
    /// Whether the horizon varies in space.
    pub fn horizon_varies(&self) -> bool {
        self.peridynamics
            .as_ref()
            .is_some_and(|p| p.horizon.as_constant().is_none())
    }

    /// The horizon at a position; zero without peridynamics.
    pub fn horizon_at(&self, x: &Vector<D>) -> f64 {
        self.peridynamics
            .as_ref()
            .map_or(0.0, |p| p.horizon.eval(&padded(x)))
    }

    /// A region that is the whole space.
    pub fn everywhere() -> Region<D> {
        Region::Shape {
            shape: Shape::Everywhere,
            margin: 0.0,
        }
    }
}
