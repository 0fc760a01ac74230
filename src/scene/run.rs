//! From a validated scene to its solution: the only place where scene, core, solver and observers meet.

use std::sync::Arc;

use super::breaking::Breaking;
use super::budget;
use super::chosen::with_choice;
use super::conditions::Condition;
use super::definite::{self, Ratio};
use super::doubts::warnings;
use super::follow::Follow;
use super::initial::Initial;
use super::loads::{loads, supports};
use super::materials::{Law, Material};
use super::motion::{self, RunOptions};
use super::peridynamics::Points;
use super::proof::{self, Subject};
use super::rotation::Rotations;
use super::solve::Solve;
use super::spec::{Joining, SurfacesSpec, WeightsSpec};
use super::validate::{Output, Scene, Solver};
use crate::coupling::Surfaces;
use crate::coupling::motion::MotionError;
use crate::coupling::{
    self, CarryError, Coupling, Model, ModelError, Operator, PointSource, Problem, SiteKind, Zone,
};
use crate::observe::ObserveError;
use crate::observe::checkpoint::{CheckpointError, Fingerprint};
use crate::observe::proof::Proof;
use crate::observe::summary::{
    Applied, Choice, Reaction, Rotation, RunSummary, Sizes, Stopwatch, Timings, peak_memory_bytes,
};
use crate::peridynamics::FractureError;
use crate::peridynamics::{
    BondBased, BondLaw, BondWeights, Correspondence, Influence, LinearPeridynamicSolid,
    PartialVolume,
};
use crate::progress::Progress;
use crate::solve::explicit::ExplicitError;
use crate::solve::quasi_static::QuasiStaticError;
use crate::solve::stable_step::StepError;
use crate::solve::statics::{self, StaticError, StaticParams, StaticProblem, StaticSolution};
use crate::solve::sub_cycling::SubCyclingError;
use crate::system::{BlockCsr, Symmetry};
use crate::tensor::{Vector, padded};

/// Why a scene that is right could not be run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The model cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The system cannot be solved.
    #[error(transparent)]
    Solve(#[from] StaticError),
    /// A result cannot be written.
    #[error(transparent)]
    Observe(#[from] ObserveError),
    /// The motion cannot start or go on.
    #[error(transparent)]
    Explicit(#[from] ExplicitError),
    /// The run cannot go on from a checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A load step has no solution.
    #[error(transparent)]
    QuasiStatic(#[from] QuasiStaticError),
    /// The time step, or the model at any step, is not stable.
    #[error(transparent)]
    Step(#[from] StepError),
    /// A mode of the coupled model doubles the energy within the run, whatever the step.
    #[error(
        "this model is unstable in time at any step: a mode largest at ({}) grows as exp({rate:e} t), by exp({gain:.1}) over the run (eigenvalue {real:e} + {imaginary:e} i of M⁻¹K, which should be real and positive); {remedy}; or let it begin with solve.explicit.growing-modes = \"warn\"", place.iter().map(|x| format!("{x:.4e}")).collect::<Vec<_>>().join(", ")
    )]
    Grows {
        /// Where the mode is largest.
        place: Vec<f64>,
        /// σ \[1/s\].
        rate: f64,
        /// σ times the duration of the run.
        gain: f64,
        /// Real part of its eigenvalue \[1/s²\].
        real: f64,
        /// Imaginary part.
        imaginary: f64,
        /// What to do.
        remedy: &'static str,
    },
    /// The stiffest sites cannot take sub-steps.
    #[error(transparent)]
    SubCycling(#[from] SubCyclingError),
    /// The bonds cannot move.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// The fracture energy gives no critical stretch.
    #[error("the material of the points cannot break: {0}")]
    Fracture(#[from] FractureError),
    /// The seam may have a negative stiffness, and nothing shows that it has none.
    #[error(
        "Poisson's ratio {typed:.4} is below {pairwise:.4}, that of bonds that act alone, and the seam of coupling `truncated` then has dilatations of a negative stiffness: {what}; couple by splice or blending, or take a larger poisson-ratio"
    )]
    Indefinite {
        /// What was found.
        what: String,
        /// Poisson's ratio of the material.
        typed: f64,
        /// The ratio of a pairwise law.
        pairwise: f64,
    },
    /// No coupling that the program would choose holds.
    #[error(
        "no coupling holds of those that suit a scene that names none. `{first}`: {reason}. `{second}`: {error}"
    )]
    NoCoupling {
        /// The coupling tried first.
        first: &'static str,
        /// Why it does not hold.
        reason: Box<RunError>,
        /// The coupling tried next.
        second: &'static str,
        /// Why that does not hold either.
        error: Box<RunError>,
    },
    /// The state cannot be carried over to other zones.
    #[error(transparent)]
    Carry(#[from] CarryError),
    /// A check of the model failed, so that no result of it can be trusted.
    #[error("{0}")]
    Unproven(String),
    /// Something that is planned and not there yet.
    #[error("{what}: {remedy}")]
    Later {
        /// What was asked for.
        what: &'static str,
        /// What to do instead.
        remedy: &'static str,
    },
    /// The scene needs more memory than there is.
    #[error(
        "the scene needs about {needed} of memory, {there} are there: {largest} ({sizes}); {remedy}"
    )]
    Memory {
        /// What it needs.
        needed: String,
        /// The budget, [`memory_budget`](super::memory_budget).
        there: String,
        /// The three largest items.
        largest: String,
        /// What was counted.
        sizes: String,
        /// What to do.
        remedy: String,
    },
    /// A condition meets no site.
    #[error("the condition `{condition}` meets no site of the model; {remedy}")]
    Idle {
        /// Its name.
        condition: String,
        /// What to do.
        remedy: &'static str,
    },
}

/// A solved scene.
pub struct Solved<'a, const D: usize> {
    /// The model.
    pub model: &'a Model<D>,
    /// Its rows.
    pub operator: &'a dyn Operator<D>,
    /// Displacement, `D` numbers per site.
    pub displacement: &'a [f64],
    /// Residual `K u − f` of each dof; on prescribed dofs the reaction.
    pub residual: &'a [f64],
    /// Which zone each site lies in.
    pub zone_of_site: &'a [Zone],
    /// Bonds that broke in motion, by the sites of their ends, each once for each direction.
    pub broken: &'a [(u32, u32)],
}

/// Runs a scene and writes its outputs.
///
/// # Errors
/// [`RunError`], each with place and remedy.
pub fn run<const D: usize>(
    scene: Scene<D>,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    let moves = scene.solve != Solve::Static;
    let _claim = scene.output.claim(&scene.title, moves)?;
    if moves {
        return with_choice(scene, |scene| motion::run(scene, options, progress));
    }
    solve_with(scene, progress, |output, solved| {
        super::write::write(output, solved)
    })
}

/// Solves a static scene and hands the solution to `visit`, which returns the files that it wrote.
///
/// # Errors
/// [`RunError`], each with place and remedy.
pub fn solve_with<const D: usize>(
    scene: Scene<D>,
    progress: &dyn Progress,
    visit: impl FnOnce(&Output<D>, &Solved<'_, D>) -> Result<Vec<std::path::PathBuf>, ObserveError>,
) -> Result<RunSummary, RunError> {
    let mut visit = Some(visit);
    with_choice(scene, |scene| {
        solve_chosen(scene, progress, |output, solved| match visit.take() {
            Some(visit) => visit(output, solved),
            // a solved scene is not solved again
            None => Ok(Vec::new()),
        })
    })
}

fn solve_chosen<const D: usize>(
    mut scene: Scene<D>,
    progress: &dyn Progress,
    visit: impl FnOnce(&Output<D>, &Solved<'_, D>) -> Result<Vec<std::path::PathBuf>, ObserveError>,
) -> Result<RunSummary, RunError> {
    let mut timings = Timings::default();
    let mut watch = Stopwatch::start();
    let name = scene.title.clone();
    let joining = scene.coupling.joining();
    let (cells, nodes) = (scene.mesh.cell_count(), scene.mesh.nodes.len());
    let placement = scene.placement.take();
    let (problem, mut rest) = problem(scene);
    let kept = placement.and_then(|p| {
        timings.add("placing the zone", p.seconds);
        rest.placed = Some(p.choice);
        p.kept
    });
    let fresh;
    let (model, coupling) = match &kept {
        Some(k) => (&k.model, k.coupling.as_ref()),
        None => {
            fresh = Model::new(problem, progress)?;
            (&fresh.0, fresh.1.as_ref())
        }
    };
    watch.lap(&mut timings, "sites and bonds");
    let operator = coupling.operator(model)?;
    let mut choices: Vec<Choice> = rest.made().cloned().collect();
    definite::check(model, operator.as_ref(), rest.ratio, &mut choices, progress)?;
    watch.lap(&mut timings, "assembly");
    let mut proof = Proof::default();
    let mut prove = |stiffness: &BlockCsr| -> Result<f64, RunError> {
        let mut clock = Stopwatch::start();
        let mut taken = Timings::default();
        proof = proof::prove(
            &Subject {
                model,
                coupling,
                operator: operator.as_ref(),
                rest: &rest,
                stiffness: Some(stiffness),
                system: None,
                affine_forces: &[],
            },
            progress,
        )?;
        proof::hold(&proof)?;
        clock.lap(&mut taken, "proof");
        Ok(taken.total())
    };
    let computed;
    let equilibrium = match &kept {
        Some(k) => {
            let seconds = prove(&k.equilibrium.stiffness)?;
            k.equilibrium.timings.add_to(&mut timings);
            timings.add("proof", seconds);
            &k.equilibrium
        }
        None => {
            computed = equilibrium(
                &At {
                    model,
                    coupling,
                    operator: operator.as_ref(),
                    conditions: &rest.conditions,
                    solver: &rest.solver,
                    time: 0.0,
                },
                Timings::default(),
                prove,
                progress,
            )?;
            computed.timings.add_to(&mut timings);
            &computed
        }
    };
    let Equilibrium {
        stiffness,
        symmetry,
        load,
        applied,
        holder,
        solution,
        ..
    } = equilibrium;
    let symmetry = *symmetry;
    let info = &solution.info;
    watch = Stopwatch::start();
    choices.extend(equilibrium.choices.iter().cloned());
    choices.push(Choice {
        choice: info.method.name().to_owned(),
        why: format!("{} system of {} unknowns", symmetry.name(), info.free_dofs),
    });
    choices.extend(volumes_choice(model));

    let u = &solution.displacement;
    let internal = stiffness.multiply(u);
    let residual: Vec<f64> = internal.iter().zip(load).map(|(k, f)| k - f).collect();
    let mut reactions = vec![Vector::<D>::zeros(); rest.conditions.len()];
    for (dof, holder) in holder.iter().enumerate() {
        if let Some(condition) = holder {
            reactions[*condition][dof % D] += solution.reactions[dof];
        }
    }
    let mut balance = Vector::<D>::zeros();
    internal
        .iter()
        .enumerate()
        .for_each(|(dof, f)| balance[dof % D] += f);
    // the sizes of nodal forces: their sum vanishes where pressure or two faces pull against each other
    let size = |forces: &[f64]| -> f64 {
        let nodal = forces.chunks_exact(D);
        nodal
            .map(|f| Vector::<D>::from_column_slice(f).norm())
            .sum()
    };
    let scale = size(load) + size(&solution.reactions);
    let zone_of_site = zone_of_site(model);
    let solved = Solved {
        model,
        operator: operator.as_ref(),
        displacement: u,
        residual: &residual,
        zone_of_site: &zone_of_site,
        broken: &[],
    };
    let files = visit(&rest.output, &solved)?;
    watch.lap(&mut timings, "output");
    progress.finish();
    let rotations = Rotations::new(model, true);
    let rotation = rotations
        .largest(u)
        .and_then(|r| rotations.told(r.degrees, r.place, 0.0, 0.0, None));
    let mut told = warnings(model, joining, &proof);
    told.extend(rotation.as_ref().map(Rotation::warning));
    let summary = RunSummary {
        scene: name,
        dimension: D,
        coupling: joining.name.to_owned(),
        sizes: Sizes {
            nodes,
            cells,
            sites: model.sites.len(),
            points: model
                .sites
                .iter()
                .filter(|s| matches!(s.kind, SiteKind::Point(_)))
                .count(),
            bonds: model.body().map_or(0, |b| b.bond_count()) + operator.additional_bonds(),
            dofs: stiffness.dofs(),
            nonzeros: stiffness.nonzeros(),
        },
        choices,
        total_seconds: timings.total(),
        timings,
        peak_memory_bytes: peak_memory_bytes(),
        warnings: told,
        proof,
        rotation,
        iterations: info.iterations,
        factor_nonzeros: info.factor_nnz,
        residual: info.relative_residual,
        out_of_balance_force: balance.iter().copied().collect(),
        out_of_balance_relative: if scale > 0.0 {
            balance.norm() / scale
        } else {
            0.0
        },
        applied: applied.clone(),
        reactions: rest
            .conditions
            .iter()
            .zip(&reactions)
            .filter(|(c, _)| c.holds())
            .map(|(c, r)| Reaction {
                condition: c.name.clone(),
                force: r.iter().copied().collect(),
            })
            .collect(),
        energy: (symmetry == Symmetry::Symmetric)
            .then(|| 0.5 * u.iter().zip(&internal).map(|(u, f)| u * f).sum::<f64>()),
        motion: None,
        files,
    };
    Ok(summary)
}

/// A model at rest under its conditions, about to be solved.
pub(super) struct At<'a, const D: usize> {
    pub model: &'a Model<D>,
    pub coupling: &'a dyn Coupling<D>,
    pub operator: &'a dyn Operator<D>,
    pub conditions: &'a [Condition<D>],
    pub solver: &'a Solver,
    /// The time at which conditions are taken.
    pub time: f64,
}

/// A model at rest, solved.
pub(crate) struct Equilibrium {
    pub stiffness: BlockCsr,
    pub symmetry: Symmetry,
    pub load: Vec<f64>,
    /// The force of each load.
    pub applied: Vec<Applied>,
    /// The condition that holds each dof.
    pub holder: Vec<Option<usize>>,
    pub solution: StaticSolution,
    /// What the symmetry of the matrix decided.
    pub choices: Vec<Choice>,
    pub timings: Timings,
}

/// Assembles, hands the stiffness to `prove`, which tells the seconds that it took, and solves.
///
/// # Errors
/// [`RunError`] for a condition that meets no site, and for a system without a solution.
pub(super) fn equilibrium<const D: usize>(
    at: &At<'_, D>,
    mut timings: Timings,
    prove: impl FnOnce(&BlockCsr) -> Result<f64, RunError>,
    progress: &dyn Progress,
) -> Result<Equilibrium, RunError> {
    let mut watch = Stopwatch::start();
    let model = at.model;
    let stiffness = model.assemble(at.operator, progress);
    watch.lap(&mut timings, "assembly");
    let (load, applied) = loads(model, at.conditions, at.time)?;
    let (prescribed, holder) = supports(model, at.conditions, at.time)?;
    let positions: Vec<[f64; 3]> = model.sites.iter().map(|s| padded(&s.position)).collect();
    let mut choices = Vec::new();
    let symmetry = symmetry(at.coupling, || stiffness.asymmetry(), &mut choices);
    watch.lap(&mut timings, "conditions");
    timings.add("proof", prove(&stiffness)?);
    let solution = statics::solve(
        &StaticProblem {
            stiffness: &stiffness,
            symmetry,
            positions: &positions,
            load: &load,
            prescribed: &prescribed,
        },
        &params(at.solver),
        progress,
    )?;
    let info = &solution.info;
    timings.add("ordering", info.ordering_seconds);
    timings.add("factorisation", info.factor_seconds);
    timings.add("solve", info.solve_seconds);
    Ok(Equilibrium {
        stiffness,
        symmetry,
        load,
        applied,
        holder,
        solution,
        choices,
        timings,
    })
}

/// What of a scene remains once its problem is built.
pub(super) struct Rest<const D: usize> {
    pub conditions: Vec<Condition<D>>,
    pub solver: Solver,
    pub output: Output<D>,
    pub initial: Vec<Initial<D>>,
    pub breaking: Breaking<D>,
    /// Poisson's ratio of the points.
    pub ratio: Ratio,
    pub follow: Option<Follow>,
    pub fingerprint: Fingerprint,
    /// Density of each material.
    pub density: Vec<f64>,
    /// The coupling, where the scene names none.
    pub chosen: Option<Choice>,
    /// How the zone was placed, where the scene draws none.
    pub placed: Option<Choice>,
    /// What was chosen for the accuracy that the scene wants.
    pub choices: Vec<Choice>,
}

impl<const D: usize> Rest<D> {
    /// What was chosen for the accuracy, the zone and the coupling, in this order.
    pub fn made(&self) -> impl Iterator<Item = &Choice> {
        self.choices.iter().chain(&self.placed).chain(&self.chosen)
    }

    /// The coupling as a choice: why it was made, or what it does if the scene names it.
    pub fn coupling(&self, joining: Joining) -> Choice {
        self.chosen.clone().unwrap_or_else(|| Choice {
            choice: format!("coupling {}", joining.name),
            why: joining.about.to_owned(),
        })
    }
}

/// The law of the bonds of a material.
pub(super) fn law<const D: usize>(material: &Material<D>) -> Box<dyn BondLaw<D>> {
    let (lambda, mu) = material.lame;
    match material.law {
        Law::BondBased(micromodulus) => Box::new(BondBased::new(micromodulus, mu)),
        Law::Lps(influence) => Box::new(LinearPeridynamicSolid::new(influence, lambda, mu)),
        Law::Correspondence(influence, stabilisation) => {
            Box::new(Correspondence::new(influence, lambda, mu, stabilisation))
        }
    }
}

pub(super) fn problem<const D: usize>(scene: Scene<D>) -> (Problem<D>, Rest<D>) {
    let material = scene
        .zones
        .iter()
        .zip(&scene.cell_material)
        .find(|(zone, _)| **zone != Zone::Local)
        .map_or(0, |(_, m)| *m);
    let stuff = &scene.materials[material as usize];
    let influence = match stuff.law {
        Law::Lps(i) | Law::Correspondence(i, _) => i,
        Law::BondBased(_) => Influence::Gaussian,
    };
    let law = law(stuff);
    let ratio = Ratio::new(stuff.lame, scene.kinematics);
    let method = scene.coupling.build(influence);
    let chosen = scene.coupling_why.map(|why| Choice {
        choice: format!("coupling {}", scene.coupling.joining().name),
        why,
    });
    let tensors = scene.materials.iter().map(|m| m.stiffness()).collect();
    let density = scene.materials.iter().map(|m| m.density).collect();
    let (voids, barriers) = (scene.voids, scene.barriers);
    let peridynamics = scene.peridynamics.map(|p| {
        let horizon = p.horizon;
        coupling::Peridynamics {
            law,
            horizon: Arc::new(move |x: &Vector<D>| horizon.eval(&padded(x))),
            points: match p.points {
                Points::Cells => PointSource::Cells,
                Points::Lattice { spacing, origin } => PointSource::Lattice { spacing, origin },
                Points::Lattices { lattices, of_cell } => {
                    PointSource::Lattices { lattices, of_cell }
                }
            },
            weights: match p.weights {
                WeightsSpec::Isotropic => BondWeights::Isotropic,
                WeightsSpec::Plain => BondWeights::Plain,
                WeightsSpec::Fitted => BondWeights::Fitted,
            },
            volumes: p.volumes,
            barriers,
            voids,
            surfaces: match p.surfaces {
                SurfacesSpec::Cut => Surfaces::Cut,
                SurfacesSpec::Uncut => Surfaces::Uncut,
            },
        }
    });
    (
        Problem {
            mesh: scene.mesh,
            zones: scene.zones,
            tensors,
            cell_material: scene.cell_material,
            peridynamic_material: material,
            peridynamics,
            coupling: method,
        },
        Rest {
            conditions: scene.conditions,
            solver: scene.solver,
            output: scene.output,
            initial: scene.initial,
            breaking: scene.breaking,
            ratio,
            follow: scene.follow,
            fingerprint: scene.fingerprint,
            density,
            chosen,
            placed: scene.placement.map(|p| p.choice),
            choices: scene.choices,
        },
    )
}

pub(super) fn params(solver: &Solver) -> StaticParams {
    StaticParams {
        method: solver.method,
        ordering: solver.ordering,
        tolerance: solver.tolerance,
        max_iterations: solver.max_iterations,
        memory_limit: budget::memory_left(),
    }
}

/// Says which partial volumes are in use, if not full ones.
pub(super) fn volumes_choice<const D: usize>(model: &Model<D>) -> Option<Choice> {
    let volumes = model.peridynamics.as_ref()?.volumes;
    let why = match volumes {
        PartialVolume::Full => return None,
        PartialVolume::PdLammps => "a ramp over the last half spacing within the horizon",
        PartialVolume::Hhb => "a ramp over the spacing about the horizon",
        PartialVolume::Exact => "what the horizon cuts from each cell of the lattice",
    };
    Some(Choice {
        choice: format!("{volumes:?} partial volumes"),
        why: why.to_owned(),
    })
}

/// The symmetry that the coupling promises, if the matrix keeps it: a horizon that varies breaks it.
pub(super) fn symmetry<const D: usize>(
    coupling: &dyn Coupling<D>,
    asymmetry: impl FnOnce() -> f64,
    choices: &mut Vec<Choice>,
) -> Symmetry {
    const ROUND_OFF: f64 = 1e-12;
    if coupling.symmetry() == Symmetry::Symmetric {
        let asymmetry = asymmetry();
        if asymmetry <= ROUND_OFF {
            return Symmetry::Symmetric;
        }
        choices.push(Choice {
            choice: "unsymmetric solver".to_owned(),
            why: format!("the stiffness differs from its transpose by {asymmetry:.1e}"),
        });
    }
    Symmetry::Unsymmetric
}

pub(super) fn zone_of_site<const D: usize>(model: &Model<D>) -> Vec<Zone> {
    let node_zone = |site: usize| {
        model
            .cells_of_site(site)
            .map(|(c, _)| c)
            .filter(|&c| model.is_element(c))
            .map(|c| model.zones[c])
            .max()
            .unwrap_or(Zone::Local)
    };
    (0..model.sites.len())
        .map(|site| match model.sites[site].kind {
            SiteKind::Point(p) => model.zone_of_point(p as usize),
            SiteKind::Node(_) => node_zone(site),
        })
        .collect()
}
