//! Static equilibrium of a model under its conditions: assembly, loads, supports, solution.

use std::ops::ControlFlow;
use std::time::Instant;

use super::budget;
use super::condition_terms::ConditionTerms;
use super::loads::{loads, supports};
use crate::observe::summary::{ConditionForce, Decision, Stopwatch, Timings};
use crate::progress::Progress;
use crate::run::error::RunError;
use crate::run::thermal::Thermal;
use crate::scene::conditions::Condition;
use crate::scene::validated::Solver;
use crate::solve::FreeDofs;
use crate::solve::explicit::Drive;
use crate::solve::krylov::LinearMap;
use crate::solve::quasi_static::{
    self, Aids, LoadState, Pacing, QuasiStaticError, QuasiStaticParams, Refactor, TangentFactors,
};
use crate::solve::statics::{
    self, Method, MethodUsed, SpreadProblem, SpreadRows, StaticError, StaticInfo, StaticParams,
    StaticProblem, StaticSolution,
};
use crate::system::{BlockCsr, Ranks, SemiDiscrete, Spread, Symmetry, WithTerms};
use crate::tensor::padded;
use crate::{
    coupling::{Coupling, Operator},
    model::{Distribution, Model},
};

/// A model at rest under its conditions, about to be solved.
pub(crate) struct StaticInput<'a, const D: usize> {
    pub model: &'a Model<D>,
    pub coupling: &'a dyn Coupling<D>,
    pub operator: &'a Operator<'a, D>,
    pub conditions: &'a [Condition<D>],
    pub solver: &'a Solver,
    /// The time at which conditions are taken.
    pub time: f64,
    /// The processes that solve it together, if there are several.
    pub ranks: Option<&'a dyn Ranks>,
    /// Thermal expansion, if any material expands.
    pub thermal: Option<&'a Thermal<D>>,
}

/// Stiffness at hand for the proof: all rows, or those of one process.
pub(crate) enum Assembled<'a> {
    /// All rows.
    Whole(&'a BlockCsr),
    /// The rows of this process.
    Spread(&'a SpreadRows<'a>),
}

/// A model at rest, solved.
pub(crate) struct Equilibrium {
    /// All rows, or those of this process.
    pub stiffness: BlockCsr,
    pub symmetry: Symmetry,
    pub load: Vec<f64>,
    /// The force of each load.
    pub applied: Vec<ConditionForce>,
    /// The condition that holds each dof.
    pub holder: Vec<Option<usize>>,
    pub solution: StaticSolution,
    /// Internal force \[N\] at the solution.
    pub internal: Vec<f64>,
    /// Springs that hold the body.
    pub terms: ConditionTerms,
    /// Energy stored there and in springs \[J\]; none of a matrix that is not symmetric.
    pub energy: Option<f64>,
    /// Decisions that followed from the symmetry of the matrix.
    pub choices: Vec<Decision>,
    pub timings: Timings,
}

impl Equilibrium {
    /// Internal less external force \[N\] by dof.
    pub fn residual(&self) -> Vec<f64> {
        let forces = self.internal.iter().zip(&self.load);
        forces.map(|(k, f)| k - f).collect()
    }
}

/// Assembles, hands the stiffness to `prove`, which returns the seconds that it took, and solves; `system` is the one with nonlinear forces, if they are nonlinear.
///
/// # Errors
/// [`RunError`] for a condition that meets no site, and for a system without a solution.
pub(crate) fn equilibrium<const D: usize>(
    at: &StaticInput<'_, D>,
    system: Option<&mut dyn SemiDiscrete>,
    mut timings: Timings,
    prove: impl FnOnce(&Assembled<'_>) -> Result<f64, RunError>,
    progress: &dyn Progress,
) -> Result<Equilibrium, RunError> {
    // forces that are not linear are solved for by every process, with all rows
    if let (Some(ranks), None) = (at.ranks, &system) {
        return spread(at, ranks, timings, prove, progress);
    }
    let mut watch = Stopwatch::start();
    let model = at.model;
    let terms = ConditionTerms::new(model, at.conditions)?;
    let mut stiffness = model.assemble(at.operator, progress);
    watch.lap(&mut timings, "assembly");
    let (mut load, applied) = loads(model, at.conditions, at.time)?;
    let expands = expansion(at, None, system.is_some())?;
    expand(&mut load, expands.as_deref());
    let (prescribed, holder) = supports(model, at.conditions, at.time)?;
    let positions: Vec<[f64; 3]> = model.sites.iter().map(|s| padded(&s.position)).collect();
    let mut choices = Vec::new();
    let symmetry = symmetry(at.coupling, || stiffness.asymmetry(), &mut choices);
    watch.lap(&mut timings, "conditions");
    timings.add("proof", prove(&Assembled::Whole(&stiffness))?);
    terms.rows.add_to(&mut stiffness);
    let static_problem = StaticProblem {
        stiffness: &stiffness,
        symmetry,
        positions: &positions,
        load: &load,
        prescribed: &prescribed,
    };
    let params = params(at.solver);
    let (solution, mut internal, mut energy) = match system {
        None => {
            let solution = statics::solve(&static_problem, &params, progress)?;
            let u = &solution.displacement;
            let internal = stiffness.multiply(u);
            let energy = (symmetry == Symmetry::Symmetric)
                .then(|| 0.5 * u.iter().zip(&internal).map(|(u, f)| u * f).sum::<f64>());
            (solution, internal, energy)
        }
        Some(system) => {
            let mut sprung = WithTerms::new(system, terms.all());
            nonlinear(&mut sprung, &static_problem, &params, model, progress)?
        }
    };
    // what springs take is no force within the body
    terms.take_from(&mut internal, &solution.displacement);
    if let Some(expands) = expands {
        take_expansion(&mut internal, &mut load, &expands);
        energy = None;
    }
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
        internal,
        energy,
        terms,
        choices,
        timings,
    })
}

/// That factors took over from an iteration, which took time; none where they did not.
fn given_up(solver: &Solver, info: &StaticInfo) -> Option<Decision> {
    let is_second = (solver.method, info.method) == (Method::Auto, MethodUsed::RankDirect);
    is_second.then(|| Decision {
        choice: "factors over the processes".to_owned(),
        why: format!(
            "the iteration did not come to its end; solver.method = \"direct\" leaves it out, which is most of {:.1} s",
            info.factor_seconds + info.solve_seconds
        ),
    })
}

/// The forces of free expansion on all sites, or on those of `own`; none where nothing expands.
fn expansion<const D: usize>(
    at: &StaticInput<'_, D>,
    own: Option<&[u32]>,
    knows_temperature: bool,
) -> Result<Option<Vec<f64>>, RunError> {
    let Some(thermal) = at.thermal else {
        return Ok(None);
    };
    let rows = (at.operator, own);
    let forces = thermal.forces_at(at.model, rows, knows_temperature, at.time)?;
    Ok(Some(forces))
}

/// Collective: the forces of free expansion on all sites, each process from the rows of its own; none where nothing expands.
fn spread_expansion<const D: usize>(
    at: &StaticInput<'_, D>,
    spread: Spread<'_>,
) -> Result<Option<Vec<f64>>, RunError> {
    let own = Some(spread.own());
    let Some(forces) = expansion(at, own, false)? else {
        return Ok(None);
    };
    let own = spread.own().iter().map(|&site| site as usize * D);
    let own: Vec<f64> = own.flat_map(|dof| forces[dof..dof + D].to_vec()).collect();
    let mut all = vec![0.0; forces.len()];
    spread.gather_sites(&own, &mut all);
    Ok(Some(all))
}

/// Adds the forces of free expansion to a load, if anything expands.
fn expand(load: &mut [f64], expands: Option<&[f64]>) {
    for (f, own) in load.iter_mut().zip(expands.unwrap_or_default()) {
        *f += own;
    }
}

/// Moves the forces of free expansion from the load to the internal forces, to which they belong.
fn take_expansion(internal: &mut [f64], load: &mut [f64], expands: &[f64]) {
    for ((f, load), own) in internal.iter_mut().zip(load).zip(expands) {
        *f -= own;
        *load -= own;
    }
}

/// As [`equilibrium`], of linear forces, each process with the rows of its own sites.
fn spread<const D: usize>(
    at: &StaticInput<'_, D>,
    ranks: &dyn Ranks,
    mut timings: Timings,
    prove: impl FnOnce(&Assembled<'_>) -> Result<f64, RunError>,
    progress: &dyn Progress,
) -> Result<Equilibrium, RunError> {
    if !ConditionTerms::new(at.model, at.conditions)?.is_empty() {
        return Err(RunError::Later {
            what: "springs in a static scene of several processes",
            remedy: "run it in one process, or in load steps: solve.quasi-static.steps = 1",
        });
    }
    let mut watch = Stopwatch::start();
    let model = at.model;
    let positions: Vec<[f64; 3]> = model.sites.iter().map(|s| padded(&s.position)).collect();
    let Distribution { partition, why } = model.distribute(ranks.count(), false, Some(ranks));
    watch.lap(&mut timings, "distribution");
    let spread = Spread {
        ranks,
        partition: &partition,
    };
    let stiffness = model.assemble_sites(at.operator, spread.own(), progress);
    watch.lap(&mut timings, "assembly");
    let (mut load, applied) = loads(model, at.conditions, at.time)?;
    let expands = spread_expansion(at, spread)?;
    expand(&mut load, expands.as_deref());
    let (prescribed, holder) = supports(model, at.conditions, at.time)?;
    let rows = SpreadRows {
        matrix: &stiffness,
        spread,
    };
    let mut choices = vec![Decision {
        choice: format!("{} processes", ranks.count()),
        why: format!("each has the rows of its own sites, by {why}"),
    }];
    let symmetry = symmetry(at.coupling, || rows.asymmetry(), &mut choices);
    watch.lap(&mut timings, "conditions");
    timings.add("proof", prove(&Assembled::Spread(&rows))?);
    let problem = SpreadProblem {
        rows,
        symmetry,
        positions: &positions,
        load: &load,
        prescribed: &prescribed,
    };
    let solution = statics::solve_spread(&problem, &params(at.solver), progress)?;
    let u = &solution.displacement;
    let mut internal = vec![0.0; u.len()];
    rows.apply_into(u, &mut internal);
    let energy = (symmetry == Symmetry::Symmetric && expands.is_none())
        .then(|| 0.5 * u.iter().zip(&internal).map(|(u, f)| u * f).sum::<f64>());
    if let Some(expands) = expands {
        take_expansion(&mut internal, &mut load, &expands);
    }
    let info = &solution.info;
    choices.extend(given_up(at.solver, info));
    timings.add("factorisation", info.factor_seconds);
    timings.add("solve", info.solve_seconds);
    Ok(Equilibrium {
        stiffness,
        symmetry,
        load,
        applied,
        holder,
        solution,
        internal,
        energy,
        terms: ConditionTerms::default(),
        choices,
        timings,
    })
}

/// Loads and supports that do not change.
struct Still<'a> {
    load: &'a [f64],
    prescribed: Vec<u32>,
    values: Vec<f64>,
}

impl Drive for Still<'_> {
    fn load_into(&self, _time: f64, load: &mut [f64]) {
        load.copy_from_slice(self.load);
    }

    fn prescribed(&self) -> &[u32] {
        &self.prescribed
    }

    fn displacement_into(&self, _time: f64, values: &mut [f64]) {
        values.copy_from_slice(&self.values);
    }

    fn velocity_into(&self, _time: f64, values: &mut [f64]) {
        values.fill(0.0);
    }
}

/// Equilibrium of forces that are not linear, by Newton's method: the solution, its internal forces and its energy.
fn nonlinear<const D: usize>(
    system: &mut dyn SemiDiscrete,
    problem: &StaticProblem<'_>,
    params: &StaticParams,
    model: &Model<D>,
    progress: &dyn Progress,
) -> Result<(StaticSolution, Vec<f64>, Option<f64>), RunError> {
    let clock = Instant::now();
    statics::well_posed(problem)?;
    let factors = match may_factorise(model, params.method, problem.symmetry) {
        true => statics::factors(problem, params, progress)?,
        false => None,
    };
    let refactor = (factors.as_ref()).map(|(_, info)| TangentFactors::new(*problem, *params, info));
    let near = (factors.as_ref()).map(|(factor, _)| factor as &dyn LinearMap);
    let free = FreeDofs::from_prescribed(problem.prescribed, D);
    let multigrid = match may_coarsen(model, params.method, problem.symmetry) {
        true => statics::multigrid(problem.stiffness, &free, problem.positions, progress),
        false => None,
    };
    let factor_seconds = clock.elapsed().as_secs_f64();
    progress.stage("Newton's method", None);
    let held = |value: &Option<f64>| value.is_some();
    let drive = Still {
        load: problem.load,
        prescribed: (0..problem.prescribed.len() as u32)
            .filter(|&dof| held(&problem.prescribed[dof as usize]))
            .collect(),
        values: problem.prescribed.iter().copied().flatten().collect(),
    };
    let mut state = LoadState::at_rest(problem.load.len());
    let (mut internal, mut energy, mut relative_residual) = (Vec::new(), 0.0, 0.0);
    let done = quasi_static::run(
        system,
        &drive,
        QuasiStaticParams {
            equilibrium: quasi_static::Equilibrium::Newton,
            tolerance: params.tolerance.max(quasi_static::TIGHTEST),
            ..QuasiStaticParams::default()
        },
        Aids {
            refactor: refactor.as_ref().map(|made| made as &dyn Refactor),
            near: near.or(multigrid.as_ref().map(|made| made as &dyn LinearMap)),
            progress,
        },
        Pacing::Listed(&|step| (step == 0).then_some(0.0)),
        &mut state,
        &mut |seen| {
            internal = seen.force.to_vec();
            energy = seen.system.stored_energy(&seen.state.u);
            relative_residual = seen.residual;
            ControlFlow::Break(())
        },
    )
    .map_err(|error| without_steps(error, problem.positions))?;
    let reactions = (internal.iter().zip(problem.load).zip(problem.prescribed))
        .map(|((f, load), held)| if held.is_some() { f - load } else { 0.0 })
        .collect();
    let solution = StaticSolution {
        displacement: state.u,
        reactions,
        info: StaticInfo {
            method: MethodUsed::Newton,
            ordering: None,
            free_dofs: problem.load.len() - drive.prescribed.len(),
            matrix_nnz: problem.stiffness.nonzeros(),
            factor_nnz: factors.map_or(0, |(_, info)| info.cost.factor_nnz),
            factor_bytes: 0,
            ordering_seconds: 0.0,
            factor_seconds,
            solve_seconds: clock.elapsed().as_secs_f64() - factor_seconds,
            iterations: done.iterations,
            relative_residual,
        },
    };
    let energy = (problem.symmetry == Symmetry::Symmetric).then_some(energy);
    Ok((solution, internal, energy))
}

/// Converts the error of an incremental solution to that of a static scene, which knows of no load steps.
fn without_steps(error: QuasiStaticError, positions: &[[f64; 3]]) -> RunError {
    match error {
        QuasiStaticError::NoEquilibrium {
            residual,
            iterations,
            site,
            ..
        } => StaticError::NoEquilibrium {
            residual,
            iterations,
            site,
            position: positions[site],
        }
        .into(),
        QuasiStaticError::NotFinite { site, .. } => StaticError::NotFinite {
            what: "internal force",
            site,
            position: positions[site],
        }
        .into(),
        other => other.into(),
    }
}

/// Returns true if a body has points alone, whose condition is that of L/δ and not of L/h: conjugate gradients without a matrix then take less time and an eighth of the memory.
fn has_points_alone<const D: usize>(model: &Model<D>, symmetry: Symmetry) -> bool {
    let is_point = |site: usize| model.point_of(site).is_some();
    symmetry == Symmetry::Symmetric && (0..model.sites.len()).all(is_point)
}

/// Returns true if factors of the stiffness may precondition Newton's method: not where `[solver]` asks for an iteration, nor, by `"auto"`, where there are points alone.
pub fn may_factorise<const D: usize>(model: &Model<D>, method: Method, symmetry: Symmetry) -> bool {
    match method {
        Method::Krylov => false,
        Method::Direct => true,
        Method::Auto => !has_points_alone(model, symmetry),
    }
}

/// Returns true if multigrid of the stiffness preconditions Newton's method: where `[solver]` asks for an iteration, and there are not points alone.
pub fn may_coarsen<const D: usize>(model: &Model<D>, method: Method, symmetry: Symmetry) -> bool {
    method == Method::Krylov && !has_points_alone(model, symmetry)
}

/// Parameters of the linear solver, with the memory that is left to it.
pub fn params(solver: &Solver) -> StaticParams {
    StaticParams {
        method: solver.method,
        ordering: solver.ordering,
        tolerance: solver.tolerance,
        max_iterations: solver.max_iterations,
        memory_limit: budget::memory_left(),
    }
}

/// The symmetry that the coupling promises, if the matrix keeps it: a horizon that varies breaks it.
pub fn symmetry<const D: usize>(
    coupling: &dyn Coupling<D>,
    asymmetry: impl FnOnce() -> f64,
    choices: &mut Vec<Decision>,
) -> Symmetry {
    const ROUND_OFF: f64 = 1e-12;
    if coupling.symmetry() == Symmetry::Symmetric {
        let asymmetry = asymmetry();
        if asymmetry <= ROUND_OFF {
            return Symmetry::Symmetric;
        }
        choices.push(Decision {
            choice: "unsymmetric solver".to_owned(),
            why: format!("the stiffness differs from its transpose by {asymmetry:.1e}"),
        });
    }
    Symmetry::Unsymmetric
}
