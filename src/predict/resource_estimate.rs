//! What a run of a scene will need: sites, bonds, non-zeros, memory and time, without solving it.
//!
//! The model is laid out as a run does it, so sites and bonds are exact, and what it occupies is read from the system.
//! Each row of the stiffness is computed and dropped at once; only its pattern stays, from which ordering and symbolic
//! factorisation follow. That costs the time of an assembly and a tenth of its memory, and no factorisation.

use std::time::Duration;

use serde::Serialize;

use super::error_prediction::ErrorPrediction;
use super::output_cost::{made_up, output_seconds};
use crate::assembly::Pattern;
use crate::coupling::zone_distance::Edge;
use crate::coupling::{Model, PointSource, SiteKind, Zone};
use crate::mesh::Mesh;
use crate::observe::proof::{Proof, Severity};
use crate::observe::summary::{
    Decision, Sizes, Stopwatch, Timings, bytes_text, grouped, peak_memory_bytes,
    resident_memory_bytes,
};
use crate::peridynamics::{
    BondWeights, LatticeFamily, PartialVolume, TIE_TOLERANCE, isotropic_shell_factors,
};
use crate::progress::Progress;
use crate::run::RunError;
use crate::run::budget::{Share, largest, memory_budget};
use crate::run::equilibrium;
use crate::run::loads;
use crate::run::proof::{self, Subject};
use crate::run::setup::{self, RunSettings};
use crate::run::solution::{self, Solved};
use crate::run::warnings::doubts;
use crate::scene::Scene;
use crate::scene::spec::{CouplingTraits, ZonesNeeded};
use crate::solve::FreeDofs;
use crate::solve::direct::Analysis;
use crate::solve::factor_time_estimate::{rehearse, seconds_per_scalar};
use crate::solve::ordering::SiteGraph;
use crate::solve::statics::{MethodUsed, StaticError, expected_method};
use crate::solve::symbolic::FactorCost;
use crate::system::Symmetry;
use crate::tensor::padded;

/// What a run will need.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Prediction {
    /// The scene's name or title.
    pub scene: String,
    /// Why the model was not laid out: sizes and memory are then counted from volumes, and nothing is proven; `run` proves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub counted: Option<String>,
    /// Space dimension.
    pub dimension: usize,
    /// Coupling method, as the scene names it.
    pub coupling: String,
    /// How large the model is; exact.
    pub sizes: Sizes,
    /// How it will be solved; none of a scene in time.
    pub method: Option<MethodUsed>,
    /// Whether the stiffness is symmetric.
    pub symmetry: Symmetry,
    /// Unknowns that no condition prescribes.
    pub unknowns: usize,
    /// Scalars in the factors; zero for an iterative method.
    pub factor_nonzeros: u64,
    /// Operations of the factorisation; zero for an iterative method.
    pub operations: f64,
    /// Most memory that a run will hold \[bytes\].
    pub peak_memory_bytes: u64,
    /// What holds memory; not all of it at the same time.
    pub memory: Vec<Share>,
    /// Seconds per stage: up to the ordering measured here, of the others from parts of them that were tried here.
    pub timings: Timings,
    /// Seconds of all stages.
    pub total_seconds: f64,
    /// What the scene asks for or leaves open.
    pub choices: Vec<Decision>,
    /// What was shown about the model before it was solved.
    #[serde(skip_serializing_if = "Proof::is_empty")]
    pub proof: Proof,
    /// What will be costly or inaccurate.
    pub warnings: Vec<String>,
    /// How far results will be from those of a finer model, where runs with other spacings tell; as `bondline check` finds out.
    pub error: Option<ErrorPrediction>,
    /// Why there is none, if it was looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_error: Option<String>,
    /// The steps of a scene in time; none of a static one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion: Option<MotionPrediction>,
}

/// The steps of a scene in time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MotionPrediction {
    /// The time step.
    pub step: f64,
    /// Steps to the end.
    pub steps: u64,
    /// The largest step that is taken to be stable.
    pub stable_step: f64,
    /// The step that row sums guarantee.
    pub certified_step: f64,
    /// Where the row with the largest sum is.
    pub certified_at: Vec<f64>,
    /// Seconds of a step, measured here.
    pub seconds_per_step: f64,
}

/// A factorisation is rehearsed for so long at most, and for no longer than a tenth of what it takes at [`OPERATIONS`].
const REHEARSED: f64 = 0.5;

/// Operations per second of one thread, to tell how long to rehearse; the prediction does not use it.
const OPERATIONS: f64 = 1e10;

/// Solves with the factors, each with a product and a residual: one or two refinements, and one that finds nothing to gain.
const SUBSTITUTIONS: f64 = 3.0;

/// Times that a whole iterative solve reads the stiffness, set-up and cycles included: `benches/solvers.rs` takes 0.8e-7 to
/// 2.5e-7 s of CPU per stored scalar, and [`seconds_per_scalar`] gives 1e-10 s there.
const PASSES: f64 = 1500.0;

/// Bytes per cell and point of the output while it is encoded: fields, their copy for the encoder, its text.
pub(crate) const OUTPUT_BYTES: u64 = 900;

/// Bytes of a factorisation on two threads over those on one: two subtrees hold contribution blocks. Measured on the scenes
/// of `tests/check.rs`: 1.23 to 1.36 for Cholesky, whose factors are the smaller part, 1.0 to 1.15 for LU.
const CHOLESKY: f64 = 1.26;

/// As [`CHOLESKY`].
const LU: f64 = 1.1;

/// Bytes of a multigrid hierarchy and of the vectors of an iteration over those of the stiffness; measured 2.1 to 2.2.
const HIERARCHY: f64 = 2.1;

/// Bytes of program and buffers that a run touches after its model is laid out; measured.
const PROGRAM: u64 = 3_700_000;

/// How a stiffness that is not assembled yet will be solved with.
pub(crate) struct Planned {
    pub analysis: Analysis,
    pub cost: FactorCost,
    pub method: MethodUsed,
    /// Bytes of the stiffness.
    pub stiffness: u64,
    /// Bytes of the factors, or of the multigrid hierarchy.
    pub solver: u64,
}

impl Planned {
    pub fn of<const D: usize>(
        model: &Model<D>,
        pattern: &Pattern,
        free: &FreeDofs,
        rest: &RunSettings<D>,
        symmetry: Symmetry,
    ) -> Result<Self, RunError> {
        let nonzeros = pattern.stored * D * D;
        let positions: Vec<[f64; 3]> = model.sites.iter().map(|s| padded(&s.position)).collect();
        let mut params = equilibrium::params(&rest.solver);
        let stored = pattern.distinct * D * D * 8 + pattern.stored * 4 + model.sites.len() * 8;
        // a run holds the stiffness by then
        params.memory_limit = params
            .memory_limit
            .map(|left| left.saturating_sub(stored as u64));
        let graph = SiteGraph::from_pattern(&pattern.row_offsets, &pattern.columns, free);
        let analysis =
            Analysis::of_graph(graph, &positions, params.ordering).map_err(StaticError::from)?;
        let cost = analysis.cost(symmetry);
        let method = expected_method(&params, symmetry, &cost, nonzeros);
        let solver = match method {
            MethodUsed::Cholesky => analysis.bytes() + (cost.bytes as f64 * CHOLESKY) as u64,
            MethodUsed::Lu => analysis.bytes() + (cost.bytes as f64 * LU) as u64,
            // coarse levels share no rows
            _ => analysis
                .bytes()
                .max((HIERARCHY * (nonzeros * 8 + pattern.stored * 4) as f64) as u64),
        };
        Ok(Self {
            analysis,
            cost,
            method,
            stiffness: stored as u64,
            solver,
        })
    }
}

/// Predicts a static run.
///
/// # Errors
/// [`RunError`] if the model cannot be built or a condition meets no site, as a run would.
pub(crate) fn predict<const D: usize>(
    scene: Scene<D>,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    let mut timings = Timings::default();
    let mut watch = Stopwatch::start();
    let title = scene.title.clone();
    let joining = scene.coupling.joining();
    let (cells, nodes) = (scene.mesh.cell_count(), scene.mesh.nodes.len());
    let (problem, rest) = setup::problem(scene);
    let (model, coupling) = Model::new(problem, progress)?;
    let operator = coupling.operator(&model)?;
    watch.lap(&mut timings, "sites and bonds");
    let laid_out = resident_memory_bytes().unwrap_or(0);
    let layout_peak = peak_memory_bytes().unwrap_or(0);
    let fields = proof::affine_displacements(&model);
    let pattern = model.pattern(operator.as_ref(), &fields, progress);
    drop(fields);
    watch.lap(&mut timings, "assembly");

    loads::loads(&model, &rest.conditions, 0.0)?;
    let (prescribed, _) = loads::supports(&model, &rest.conditions, 0.0)?;
    let free = FreeDofs::from_prescribed(&prescribed, D);
    let proof = proof::prove(
        &Subject {
            model: &model,
            coupling: coupling.as_ref(),
            operator: operator.as_ref(),
            rest: &rest,
            stiffness: None,
            system: None,
            affine_forces: &pattern.products,
        },
        progress,
    )?;
    proof::hold(&proof)?;
    watch.lap(&mut timings, "proof");
    let mut choices = rest.choices.clone();
    choices.extend(rest.placed.iter().cloned());
    choices.push(rest.coupling(joining));
    let symmetry = equilibrium::symmetry(coupling.as_ref(), || pattern.asymmetry, &mut choices);
    let nonzeros = pattern.stored * D * D;
    let Planned {
        analysis,
        cost,
        method,
        stiffness,
        solver,
    } = Planned::of(&model, &pattern, &free, &rest, symmetry)?;
    watch.lap(&mut timings, "conditions and ordering");
    let factorised = matches!(method, MethodUsed::Cholesky | MethodUsed::Lu);
    progress.finish();

    let points = model
        .sites
        .iter()
        .filter(|s| matches!(s.kind, SiteKind::Point(_)))
        .count();
    let sizes = Sizes {
        nodes,
        cells,
        sites: model.sites.len(),
        points,
        bonds: model.body().map_or(0, |b| b.bond_count()) + operator.additional_bonds(),
        dofs: model.sites.len() * D,
        nonzeros,
    };
    let nonlinear = rest.nonlinear(&model);
    // led by the factors of the stiffness, where these are worth their cost
    let solver_name = match nonlinear {
        None => method.name(),
        Some(_) => MethodUsed::Newton.name(),
    };
    choices.extend(nonlinear);
    choices.push(Decision {
        choice: solver_name.to_owned(),
        why: format!("{} system of {} unknowns", symmetry.name(), free.count()),
    });
    if let Some(p) = &model.peridynamics {
        choices.push(Decision {
            choice: format!("{:?} bond weights", p.weights),
            why: match p.weights {
                BondWeights::Plain => {
                    "the papers' quadrature; its elastic tensor is not isotropic".to_owned()
                }
                BondWeights::Isotropic if model.is_lattice() => {
                    "the lattice carries the typed elastic constants".to_owned()
                }
                BondWeights::Isotropic => scattered(&model),
                BondWeights::Fitted => "each family carries the typed elastic constants".to_owned(),
            },
        });
        choices.extend(setup::volumes_choice(&model));
    }

    let output_bytes = OUTPUT_BYTES * (model.mesh.cell_count() + points) as u64;
    let memory = vec![
        Share {
            name: "model",
            bytes: laid_out,
        },
        Share {
            name: "program",
            bytes: PROGRAM,
        },
        Share {
            name: "stiffness",
            bytes: stiffness,
        },
        Share {
            name: "solver",
            bytes: solver,
        },
        Share {
            name: "output",
            bytes: output_bytes,
        },
    ];
    let peak = laid_out + PROGRAM + stiffness + solver.max(output_bytes);
    let threads = rayon::current_num_threads() as f64;
    if factorised {
        let most = (0.1 * cost.flops / OPERATIONS / threads).clamp(0.01, REHEARSED);
        let told = rehearse(&analysis, symmetry, Duration::from_secs_f64(most));
        let product = nonzeros as f64 * seconds_per_scalar() / threads;
        timings.add("factorisation", told.factorisation);
        timings.add("solve", SUBSTITUTIONS * (told.substitution + product));
    } else {
        let pass = nonzeros as f64 * seconds_per_scalar() / threads;
        timings.add("iteration", PASSES * pass);
    }
    let zones = solution::zone_of_site(&model);
    let displacement = made_up(model.sites.len() * D);
    let made_up = Solved {
        model: &model,
        operator: operator.as_ref(),
        displacement: &displacement,
        residual: &displacement,
        zone_of_site: &zones,
        system: None,
        broken: &[],
    };
    timings.add("output", output_seconds(&rest.output, &made_up)?);
    let mut prediction = Prediction {
        scene: title,
        counted: None,
        dimension: D,
        coupling: joining.name.to_owned(),
        sizes,
        method: Some(method),
        symmetry,
        unknowns: free.count(),
        factor_nonzeros: if factorised { cost.factor_nnz } else { 0 },
        operations: if factorised { cost.flops } else { 0.0 },
        peak_memory_bytes: peak.max(layout_peak),
        memory,
        total_seconds: timings.total(),
        timings,
        choices,
        proof,
        warnings: Vec::new(),
        error: None,
        no_error: None,
        motion: None,
    };
    prediction.warnings = warnings(&model, joining, &prediction);
    holds(&prediction)?;
    Ok(prediction)
}

/// Bonds beyond which a scene deserves a second thought.
const MANY_BONDS: usize = 100_000_000;

pub(crate) fn warnings<const D: usize>(
    model: &Model<D>,
    joining: CouplingTraits,
    prediction: &Prediction,
) -> Vec<String> {
    let mut list = Vec::new();
    // families are judged by the one spacing of a model
    let alone =
        |p: &&crate::coupling::Peridynamics<D>| !matches!(p.points, PointSource::Lattices { .. });
    if let (Some(body), Some(p)) = (model.body(), model.peridynamics.as_ref().filter(alone)) {
        let h = model.spacing();
        let smallest = body
            .cloud
            .horizon
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min);
        if smallest < 2.0 * h * (1.0 - 1e-9) {
            list.push(format!(
                "the horizon {smallest} is {:.2} spacings: families are sparse and directions distorted; 3 to 6 are usual",
                smallest / h
            ));
        }
        if p.weights == BondWeights::Isotropic
            && p.volumes == PartialVolume::Full
            && let Some((low, high)) = shell_factors(model, smallest)
            && (low < 0.5 || high > 2.0)
        {
            list.push(format!(
                "isotropic weights change shells of bonds by factors from {low:.2} to {high:.2}: choose another horizon over spacing, or weights = \"plain\""
            ));
        }
        if let Some(width) = transition_width(&model.mesh, &model.zones) {
            let largest = body.cloud.horizon.iter().copied().fold(0.0, f64::max);
            let (wanted, why) = match joining.zones {
                ZonesNeeded::Transition { width, why } => (width, why),
                _ => (0.0, ""),
            };
            if width < (wanted - 0.01) * largest {
                list.push(format!(
                    "the transition zone is {width:.3e} wide, {:.2} horizons, less than {wanted}: {why}",
                    width / largest
                ));
            }
        }
    }
    list.extend(doubts(model, joining));
    let proof = &prediction.proof;
    list.extend(proof.messages(Severity::Warning).map(str::to_owned));
    if prediction.sizes.bonds > MANY_BONDS {
        list.push(format!(
            "{} bonds: shrink the nonlocal zone or the horizon over spacing",
            grouped(prediction.sizes.bonds)
        ));
    }
    list
}

/// Smallest and largest factor of a shell of the lattice; none where the points are no lattice or no factors exist.
fn shell_factors<const D: usize>(model: &Model<D>, horizon: f64) -> Option<(f64, f64)> {
    let law = model.peridynamics.as_ref()?.law.linearised();
    let h = model.spacing();
    let target = law.shell_target()?;
    let lattice = LatticeFamily::<D>::new(horizon / h, TIE_TOLERANCE).ok()?;
    let base: Vec<f64> = lattice
        .shells
        .iter()
        .map(|s| law.kernel(s.length(h), horizon))
        .collect();
    let factors = isotropic_shell_factors(&lattice, h, &base, target).ok()?;
    let least = factors.iter().copied().fold(f64::INFINITY, f64::min);
    Some((least, factors.iter().copied().fold(0.0, f64::max)))
}

/// What isotropic weights do for points that are no lattice: nothing, and by how much families then miss the typed constants.
fn scattered<const D: usize>(model: &Model<D>) -> String {
    let missed = model
        .tensor_deviation()
        .map_or(String::new(), |[mean, worst]| {
            format!(
                ": C_1111 of their full families is {:+.1} % off in the mean and {:.0} % at most",
                100.0 * mean,
                100.0 * worst
            )
        });
    format!("the points are no lattice, so bonds keep plain weights{missed}")
}

/// Greatest distance of a node of the transition zone from the nonlocal zone; none without either.
fn transition_width<const D: usize>(mesh: &Mesh<D>, zones: &[Zone]) -> Option<f64> {
    if !(zones.contains(&Zone::Transition) && zones.contains(&Zone::Nonlocal)) {
        return None;
    }
    let edge = Edge::of(mesh, |c| zones[c] == Zone::Nonlocal);
    // to the local zone, from the nonlocal one: the narrowest place
    let mut narrowest = f64::INFINITY;
    for c in (0..mesh.cell_count()).filter(|&c| zones[c] == Zone::Local) {
        for &n in mesh.cell(c) {
            if edge.within(&mesh.nodes[n as usize], narrowest) {
                narrowest = edge.distance(&mesh.nodes[n as usize]);
            }
        }
    }
    narrowest.is_finite().then_some(narrowest)
}

/// Refuses a run whose model, laid out, shows that it needs more memory than there is.
///
/// # Errors
/// [`RunError::Memory`], as [`fits`].
pub(crate) fn holds(prediction: &Prediction) -> Result<(), RunError> {
    let Some(there) = memory_budget().filter(|b| prediction.peak_memory_bytes > *b) else {
        return Ok(());
    };
    let s = &prediction.sizes;
    Err(RunError::Memory {
        needed: bytes_text(prediction.peak_memory_bytes),
        there: bytes_text(there),
        largest: largest(&prediction.memory),
        sizes: format!(
            "{} cells, {} points, {} bonds",
            grouped(s.cells),
            grouped(s.points),
            grouped(s.bonds)
        ),
        remedy: match prediction.method {
            Some(MethodUsed::Cholesky | MethodUsed::Lu) => {
                "use solver.method = \"krylov\", coarsen the model, or give more by --memory"
            }
            _ => "coarsen the model, make the nonlocal zone smaller, or give more by --memory",
        }
        .to_owned(),
    })
}
