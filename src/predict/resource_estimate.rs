//! Prediction of the resources of a run: sites, bonds, non-zeros, memory and time, without solving the scene.
//!
//! The model is laid out, assembled and proved as a run does it, so sizes are exact and what it occupies is read from the system;
//! ordering and symbolic factorisation follow from the stiffness. That costs what a run takes before it solves, and no factorisation.

use serde::Serialize;

use super::error_prediction::ErrorPrediction;
use super::output_cost::{TrialFolder, output_bytes, output_seconds};
use super::solver_estimate::Planned;
use crate::mesh::Mesh;
use crate::model::zone_distance::Edge;
use crate::model::{Model, PointSource, Zone};
use crate::observe::proof::Proof;
use crate::observe::summary::{
    Decision, Sizes, Stopwatch, Timings, bytes_text, grouped, peak_memory_bytes,
    resident_memory_bytes,
};
use crate::observe::warning::{Code, Warning};
use crate::peridynamics::{
    BondWeights, LatticeFamily, PartialVolume, TIE_TOLERANCE, isotropic_shell_factors,
};
use crate::progress::Progress;
use crate::run::RunError;
use crate::run::budget::{Share, largest, memory_budget};
use crate::run::condition_terms::ConditionTerms;
use crate::run::equilibrium::{self, Assembled};
use crate::run::loads;
use crate::run::setup::{self, RunSettings};
use crate::run::statics::StaticBody;
use crate::run::warnings::{doubts, of_elements, unusual_stretch};
use crate::scene::Scene;
use crate::scene::spec::{CouplingTraits, ZonesNeeded};
use crate::solve::FreeDofs;
use crate::solve::statics::MethodUsed;
use crate::system::Symmetry;

/// Predicted resources of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Prediction {
    /// The scene's name or title.
    pub scene: String,
    /// Reason why the model was not laid out: sizes and memory are then counted from volumes, and nothing is proven; `run` proves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub counted: Option<String>,
    /// Space dimension.
    pub dimension: usize,
    /// Coupling method, as the scene names it.
    pub coupling: String,
    /// Sizes of the model; exact unless `counted`.
    pub sizes: Sizes,
    /// Solution method; none of a scene in time.
    pub method: Option<MethodUsed>,
    /// Symmetry of the stiffness.
    pub symmetry: Symmetry,
    /// Unknowns that no condition prescribes.
    pub unknowns: usize,
    /// Scalars in the factors; zero for an iterative method.
    pub factor_nonzeros: u64,
    /// Operations of the factorisation; zero for an iterative method.
    pub operations: f64,
    /// Most memory that a run will hold \[bytes\].
    pub peak_memory_bytes: u64,
    /// Items that hold memory; not all of them at the same time.
    pub memory: Vec<Share>,
    /// Part of the peak beside stiffness, solver and output \[bytes\].
    #[serde(skip)]
    pub base_bytes: u64,
    /// Seconds per stage: up to the ordering measured here, of the others from parts of them that were tried here.
    pub timings: Timings,
    /// Seconds of all stages.
    pub total_seconds: f64,
    /// Choices that the scene asks for or leaves open.
    pub choices: Vec<Decision>,
    /// Results of the checks of the model before it is solved.
    #[serde(skip_serializing_if = "Proof::is_empty")]
    pub proof: Proof,
    /// Properties of the model that make a run costly or inaccurate.
    pub warnings: Vec<Warning>,
    /// Predicted difference of the results from those of a finer model, where runs with other spacings tell; as `bondline check` finds out.
    pub error: Option<ErrorPrediction>,
    /// Reason why there is none, if it was looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_error: Option<String>,
    /// The steps of a scene in time; none of a static one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion: Option<MotionPrediction>,
    /// Share of each of several processes, if that was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub processes: Vec<ProcessShare>,
    /// Rule by which their sites are distributed, and its reason.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub distribution: String,
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
    /// Position of the row with the largest sum.
    pub certified_at: Vec<f64>,
    /// Seconds of a step, measured here.
    pub seconds_per_step: f64,
}

/// Share of one of several processes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProcessShare {
    /// Sites whose rows it computes.
    pub sites: usize,
    /// Sites of other processes whose displacements these rows need, or the forces of these sites where each process moves its own; all where forces are gathered.
    pub ghosts: usize,
    /// Blocks of these rows: bonds, and pairs of nodes of an element; of a scene in time about.
    pub blocks: usize,
    /// Bonds whose families it holds: those of all points, or of its own, and of these points' neighbours where a law asks for them.
    pub bonds: usize,
    /// Memory of its part of the stiffness in PETSc \[bytes\], or of the springs that precondition it where rows are shared, without factors or coarse levels; zero of a scene in time or with forces that are not linear.
    pub stiffness_bytes: u64,
    /// Data received for each product with the stiffness, or for each step in time \[bytes\]: the numbers of its ghosts.
    pub received_bytes: u64,
    /// Most memory that it will hold \[bytes\].
    pub memory_bytes: u64,
}

/// Bytes of program and buffers that a run touches after its model is laid out; measured.
const PROGRAM: u64 = 3_700_000;

/// Predicts a static run.
///
/// # Errors
/// [`RunError`] if the model cannot be built or a condition meets no site, as a run would.
pub(crate) fn predict<const D: usize>(
    mut scene: Scene<D>,
    progress: &dyn Progress,
) -> Result<Prediction, RunError> {
    let folder = TrialFolder::new(&scene.output.directory);
    scene.output.directory = folder.path().to_path_buf();
    let (mut timings, mut watch) = (Timings::default(), Stopwatch::start());
    let (title, traits) = (scene.title.clone(), scene.coupling.traits());
    let counts = [scene.mesh.nodes.len(), scene.mesh.cell_count()];
    let (problem, rest) = setup::problem(scene);
    let (model, coupling) = setup::model(problem, &rest, progress)?;
    let operator = coupling.operator(&model)?;
    watch.lap(&mut timings, "sites and bonds");
    let laid_out = resident_memory_bytes().unwrap_or(0);
    let layout_peak = peak_memory_bytes().unwrap_or(0);
    let terms = ConditionTerms::new(&model, &rest.conditions)?;
    let mut stiffness = model.assemble(&operator, progress);
    watch.lap(&mut timings, "assembly");
    let body = StaticBody {
        model: &model,
        coupling: coupling.as_ref(),
        operator: &operator,
        rest: &rest,
        ranks: None,
        has_exact_seam: false,
    };
    loads::loads(&model, &rest.conditions, 0.0)?;
    let (prescribed, _) = loads::supports(&model, &rest.conditions, 0.0)?;
    let (proof, _) = body.prove(&Assembled::Whole(&stiffness), progress)?;
    watch.lap(&mut timings, "proof");
    let mut choices: Vec<_> = rest.choices.iter().chain(&rest.placed).cloned().collect();
    choices.push(rest.coupling(traits));
    let symmetry = equilibrium::symmetry(coupling.as_ref(), || stiffness.asymmetry(), &mut choices);
    terms.rows.add_to(&mut stiffness);
    let free = FreeDofs::from_prescribed(&prescribed, D);
    let plan = Planned::of(&model, &stiffness, &free, &rest, symmetry)?;
    watch.lap(&mut timings, "conditions and ordering");
    progress.finish();
    // led by the factors of the stiffness, where these are worth their cost
    let nonlinear = rest.nonlinear(&model);
    let method = nonlinear.map_or(plan.method, |_| MethodUsed::Newton);
    choices.extend(body.decisions(method, symmetry, free.count()));
    choices.extend(weights_decision(&model));
    let sizes = body.sizes(counts, stiffness.nonzeros());
    plan.add_seconds(&mut timings);
    let output = output_seconds(&model, &operator, &rest, false)?;
    timings.add("output", output.iter().sum());
    let output = output_bytes(&model, &sizes, &rest.output);
    let base_bytes = laid_out + PROGRAM;
    let peak = base_bytes + plan.stiffness + plan.solver.max(output);
    let items = [
        ("model", laid_out),
        ("program", PROGRAM),
        ("stiffness", plan.stiffness),
        ("solver", plan.solver),
        ("output", output),
    ];
    let mut prediction = Prediction {
        scene: title,
        dimension: D,
        coupling: traits.name.to_owned(),
        sizes,
        method: Some(plan.method),
        symmetry,
        unknowns: free.count(),
        factor_nonzeros: plan.cost.factor_nnz,
        operations: plan.cost.flops,
        peak_memory_bytes: peak.max(layout_peak),
        memory: items.map(|(name, bytes)| Share::new(name, bytes)).to_vec(),
        base_bytes,
        total_seconds: timings.total(),
        timings,
        choices,
        proof,
        ..Prediction::default()
    };
    prediction.warnings = warnings(&model, &rest, traits, &prediction)?;
    holds(&prediction)?;
    Ok(prediction)
}

/// The decision on bond weights; none of a model without bonds.
fn weights_decision<const D: usize>(model: &Model<D>) -> Option<Decision> {
    let weights = model.peridynamics.as_ref()?.weights;
    Some(Decision {
        choice: format!("{weights:?} bond weights"),
        why: match weights {
            BondWeights::Plain => {
                "the papers' quadrature; its elastic tensor is not isotropic".to_owned()
            }
            BondWeights::Isotropic if model.is_lattice() => {
                "the lattice carries the typed elastic constants".to_owned()
            }
            BondWeights::Isotropic => scattered(model),
            BondWeights::Fitted => "each family carries the typed elastic constants".to_owned(),
        },
    })
}

/// Bonds beyond which a scene deserves a second thought.
const MANY_BONDS: usize = 100_000_000;

/// Warnings of `check`.
///
/// # Errors
/// [`RunError`] for a fracture energy that gives no stretch.
pub(crate) fn warnings<const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
    traits: CouplingTraits,
    prediction: &Prediction,
) -> Result<Vec<Warning>, RunError> {
    let mut list = Vec::new();
    // families are judged by the one spacing of a model
    let alone =
        |p: &&crate::model::Peridynamics<D>| !matches!(p.points, PointSource::Lattices { .. });
    if let (Some(body), Some(p)) = (model.body(), model.peridynamics.as_ref().filter(alone)) {
        let h = model.spacing();
        let horizons = body.cloud.horizon.values().iter();
        let smallest = horizons.copied().fold(f64::INFINITY, f64::min);
        if smallest < 2.0 * h * (1.0 - 1e-9) {
            list.push(Warning::new(Code::SparseFamily, format!(
                "the horizon {smallest} is {:.2} spacings: families are sparse and directions distorted; 3 to 6 are usual",
                smallest / h
            )));
        }
        if p.weights == BondWeights::Isotropic
            && p.volumes == PartialVolume::Full
            && let Some((low, high)) = shell_factors(model, smallest)
            && (low < 0.5 || high > 2.0)
        {
            list.push(Warning::new(Code::SparseFamily, format!(
                "isotropic weights change shells of bonds by factors from {low:.2} to {high:.2}: choose another horizon over spacing, or weights = \"plain\""
            )).remedy(["peridynamics.weights=plain"]));
        }
        if let Some(width) = transition_width(&model.mesh, &model.zones) {
            let largest = body.cloud.horizon.largest();
            let (wanted, why) = match traits.zones {
                ZonesNeeded::Transition { width, why } => (width, why),
                _ => (0.0, ""),
            };
            if width < (wanted - 0.01) * largest {
                list.push(Warning::new(Code::NarrowTransition, format!(
                    "the transition zone is {width:.3e} wide, {:.2} horizons, less than {wanted}: {why}",
                    width / largest
                )));
            }
        }
    }
    list.extend(doubts(model, traits));
    list.extend(of_elements(model, &model.local_laws(&rest.local_laws)));
    list.extend(unusual_stretch(model, rest)?);
    let proof = &prediction.proof;
    list.extend(proof.warnings().cloned());
    if prediction.sizes.bonds > MANY_BONDS {
        list.push(Warning::new(
            Code::Cost,
            format!(
                "{} bonds: shrink the nonlocal zone or the horizon over spacing",
                grouped(prediction.sizes.bonds)
            ),
        ));
    }
    Ok(list)
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

/// Effect of isotropic weights on points that are no lattice: none, and by how much families then miss the typed constants.
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
