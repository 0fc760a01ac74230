//! The static problem: `K u = f` on free dofs, `u` given on the others.

use crate::progress::Progress;
use crate::solve::direct::{Analysis, DirectError, DirectInfo, DirectParams, Factor};
use crate::solve::krylov::{KrylovError, KrylovParams, conjugate_gradients, gmres};
use crate::solve::multigrid::{Multigrid, MultigridError, MultigridParams};
use crate::solve::ordering::{Ordering, OrderingError};
use crate::solve::singular::{self, FreeMotion};
use crate::solve::{FreeDofs, FreeOperator};
use crate::system::{BlockCsr, Symmetry};
use std::time::Instant;

/// A static problem; borrowed, so that assembling it is the caller's to time.
///
/// Shapes: `load` and `prescribed` have one entry per dof of `stiffness`, `positions` one per site. Units: whatever
/// `K u = f` holds in.
#[derive(Clone, Copy, Debug)]
pub struct StaticProblem<'a> {
    /// The stiffness `K`, rows of prescribed dofs included (reactions need them).
    pub stiffness: &'a BlockCsr,
    /// Whether `K = Kᵀ`.
    pub symmetry: Symmetry,
    /// Position of each site; unused components are zero.
    pub positions: &'a [[f64; 3]],
    /// Applied force `f` on each dof.
    pub load: &'a [f64],
    /// Prescribed displacement of each dof; `None` where it is unknown.
    pub prescribed: &'a [Option<f64>],
}

/// How to solve.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    serde::Serialize,
    serde::Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// By size and dimension: direct while it is the faster or the model is small.
    #[default]
    Auto,
    /// Cholesky or LU, by the symmetry of the system.
    Direct,
    /// Conjugate gradients or GMRES, by the symmetry of the system, preconditioned by multigrid.
    Krylov,
}

/// What a static solve may be asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticParams {
    /// How to solve.
    pub method: Method,
    /// Elimination order of a direct factorisation.
    pub ordering: Ordering,
    /// Relative residual `‖f − K u‖ / ‖f − K u_prescribed‖` on the free dofs to be reached.
    pub tolerance: f64,
    /// Limit of iterations.
    pub max_iterations: usize,
    /// Largest number of bytes that a factorisation may be predicted to need; `None` for no limit.
    pub memory_limit: Option<u64>,
}

impl Default for StaticParams {
    fn default() -> Self {
        StaticParams {
            method: Method::Auto,
            ordering: Ordering::default(),
            tolerance: 1e-10,
            max_iterations: 1000,
            memory_limit: None,
        }
    }
}

/// The method that solved the problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MethodUsed {
    /// Multifrontal Cholesky.
    Cholesky,
    /// Multifrontal LU.
    Lu,
    /// Conjugate gradients with multigrid.
    ConjugateGradients,
    /// Restarted GMRES with multigrid.
    Gmres,
    /// Nothing was free.
    None,
}

/// What a static solve did.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct StaticInfo {
    /// The method that was used.
    pub method: MethodUsed,
    /// The elimination order, for direct methods.
    pub ordering: Option<Ordering>,
    /// Number of unknowns.
    pub free_dofs: usize,
    /// Scalars stored in `K`.
    pub matrix_nnz: usize,
    /// Scalars stored in the factors; zero for iterative methods.
    pub factor_nnz: u64,
    /// Predicted peak bytes of the factorisation; zero for iterative methods.
    pub factor_bytes: u64,
    /// Seconds for the elimination order and symbolic analysis.
    pub ordering_seconds: f64,
    /// Seconds for the factorisation or the multigrid set-up.
    pub factor_seconds: f64,
    /// Seconds for substitution and refinement, or iteration.
    pub solve_seconds: f64,
    /// Refinement steps or Krylov iterations.
    pub iterations: usize,
    /// `‖f − K u‖₂ / ‖f − K u_prescribed‖₂` on the free dofs.
    pub relative_residual: f64,
}

/// A solved static problem.
#[derive(Clone, Debug, PartialEq)]
pub struct StaticSolution {
    /// Displacement of every dof.
    pub displacement: Vec<f64>,
    /// `K u − f` on prescribed dofs, zero elsewhere: the force that the support exerts.
    pub reactions: Vec<f64>,
    /// What was done.
    pub info: StaticInfo,
}

/// Why a static problem was not solved.
#[derive(Debug, thiserror::Error)]
pub enum StaticError {
    /// An input has the wrong length.
    #[error("{what} has {found} entries, the stiffness needs {expected}")]
    Shape {
        /// Name of the input.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length needed.
        expected: usize,
    },
    /// An input is not a finite number.
    #[error(
        "the {what} of site {site} at {position:?} is not a finite number; check its expression and materials"
    )]
    NotFinite {
        /// Stiffness, load or prescribed displacement.
        what: &'static str,
        /// The site.
        site: usize,
        /// Its position.
        position: [f64; 3],
    },
    /// Some sites are free to move.
    #[error(
        "the system is singular: {} sites are free to move, first at {}; free motions: {}; {remedy}",
        sites.len(), first_places(sites, positions), modes.join(", ")
    )]
    Singular {
        /// The sites that can move.
        sites: Vec<usize>,
        /// Positions of the first few of them.
        positions: Vec<[f64; 3]>,
        /// How they move.
        modes: Vec<String>,
        /// What to do.
        remedy: String,
    },
    /// The residual stayed above the tolerance.
    #[error(
        "the residual stayed at {residual:.1e} of the load after {iterations} iterations, {tolerance:.1e} was asked \
         for; use the direct method, or check for near-mechanisms and extreme contrasts of stiffness"
    )]
    NotConverged {
        /// Relative residual reached.
        residual: f64,
        /// Relative residual asked for.
        tolerance: f64,
        /// Iterations or refinement steps done.
        iterations: usize,
    },
    /// The elimination order could not be computed.
    #[error(transparent)]
    Ordering(#[from] OrderingError),
    /// The factors would not fit into the memory allowed.
    #[error(transparent)]
    TooLarge(DirectError),
    /// The multigrid hierarchy could not be built.
    #[error(transparent)]
    Multigrid(#[from] MultigridError),
}

fn first_places(sites: &[usize], positions: &[[f64; 3]]) -> String {
    sites
        .iter()
        .zip(positions)
        .map(|(i, x)| format!("site {i} {x:?}"))
        .collect::<Vec<_>>()
        .join(", ")
}

/// How many positions an error lists.
const LISTED: usize = 4;

/// Refinement stops here: the residual is at round-off.
const REFINED: f64 = 1e-15;

/// Steps of iterative refinement; one or two suffice where the factors are any good.
const REFINEMENTS: usize = 4;

/// A direct solution whose residual is this small against `‖K‖ ‖u‖ + ‖f‖` solves a problem within round-off of the
/// one given, and no direct method does better: long slender models have `‖K‖ ‖u‖ ≫ ‖f‖`.
const BACKWARD: f64 = 1e-14;

/// Solves a static problem.
///
/// # Errors
/// [`StaticError`]; a singular system is reported with the sites that are free to move.
pub fn solve(
    problem: &StaticProblem<'_>,
    params: &StaticParams,
    progress: &dyn Progress,
) -> Result<StaticSolution, StaticError> {
    check(problem)?;
    let matrix = problem.stiffness;
    let free = FreeDofs::from_prescribed(problem.prescribed, matrix.block.max(1));
    let mut info = StaticInfo {
        method: MethodUsed::None,
        ordering: None,
        free_dofs: free.count(),
        matrix_nnz: matrix.nonzeros(),
        factor_nnz: 0,
        factor_bytes: 0,
        ordering_seconds: 0.0,
        factor_seconds: 0.0,
        solve_seconds: 0.0,
        iterations: 0,
        relative_residual: 0.0,
    };
    let mut u: Vec<f64> = problem
        .prescribed
        .iter()
        .map(|p| p.unwrap_or(0.0))
        .collect();
    if info.free_dofs > 0 {
        if let Some(motion) = singular::unheld_bodies(matrix, &free, problem.positions) {
            return Err(singular_error(motion, problem.positions));
        }
        solve_free(problem, &free, params, progress, &mut u, &mut info)?;
    }
    let mut reactions = matrix.multiply(&u);
    for (k, r) in reactions.iter_mut().enumerate() {
        *r = if problem.prescribed[k].is_some() {
            *r - problem.load[k]
        } else {
            0.0
        };
    }
    progress.finish();
    Ok(StaticSolution {
        displacement: u,
        reactions,
        info,
    })
}

fn check(problem: &StaticProblem<'_>) -> Result<(), StaticError> {
    let dofs = problem.stiffness.dofs();
    for (what, found, expected) in [
        ("the load", problem.load.len(), dofs),
        (
            "the prescribed displacement",
            problem.prescribed.len(),
            dofs,
        ),
        (
            "the list of positions",
            problem.positions.len(),
            problem.stiffness.rows(),
        ),
    ] {
        if found != expected {
            return Err(StaticError::Shape {
                what,
                found,
                expected,
            });
        }
    }
    let d = problem.stiffness.block;
    for i in 0..problem.stiffness.rows() {
        let dofs = i * d..(i + 1) * d;
        let bad = if problem.stiffness.row(i).1.iter().any(|k| !k.is_finite()) {
            "stiffness"
        } else if problem.load[dofs.clone()].iter().any(|f| !f.is_finite()) {
            "load"
        } else if problem.prescribed[dofs]
            .iter()
            .flatten()
            .any(|u| !u.is_finite())
        {
            "prescribed displacement"
        } else if problem.positions[i].iter().any(|x| !x.is_finite()) {
            "position"
        } else {
            continue;
        };
        return Err(StaticError::NotFinite {
            what: bad,
            site: i,
            position: problem.positions[i],
        });
    }
    Ok(())
}

fn singular_error(motion: FreeMotion, positions: &[[f64; 3]]) -> StaticError {
    let FreeMotion {
        sites,
        modes,
        remedy,
    } = motion;
    let positions = sites.iter().take(LISTED).map(|&i| positions[i]).collect();
    StaticError::Singular {
        sites,
        positions,
        modes,
        remedy,
    }
}

/// `f − K u` on free dofs, zero elsewhere, and its 2-norm.
fn residual(problem: &StaticProblem<'_>, u: &[f64]) -> (Vec<f64>, f64) {
    let mut r = problem.stiffness.multiply(u);
    for (k, r) in r.iter_mut().enumerate() {
        *r = if problem.prescribed[k].is_none() {
            problem.load[k] - *r
        } else {
            0.0
        };
    }
    let norm = r.iter().map(|x| x * x).sum::<f64>().sqrt();
    (r, norm)
}

/// `Auto` factorises while that takes at most this many operations per stored scalar of `K`.
///
/// On the cases of `benches/solvers.rs` an iterative solve takes 0.8e-7 to 2.5e-7 s of CPU per stored scalar and a
/// factorisation 3e-11 s per operation, which balances at 3e3 to 8e3; a little more is allowed, because a direct
/// solution is exact to round-off. `cargo bench --bench solvers -- crossover` prints both times over a range of sizes:
/// the choice changes over at about 30 000 dofs for 2D bonds and splices, 6000 for 3D bonds, 25 000 for 3D
/// elements, and beyond 300 000 for 2D elements.
const DIRECT_OPERATIONS: f64 = 1e4;

/// Beyond this many stored scalars `Auto` iterates without asking what a factorisation would cost: a bandwidth of
/// peridynamic bonds never factorises faster there, and finding that out takes seconds.
const ANALYSED: usize = 40_000_000;

/// Chooses, and falls back where the choice was `Auto`'s and failed.
fn solve_free(
    problem: &StaticProblem<'_>,
    free: &FreeDofs,
    params: &StaticParams,
    progress: &dyn Progress,
    u: &mut [f64],
    info: &mut StaticInfo,
) -> Result<(), StaticError> {
    let analyse = || {
        progress.stage("ordering", None);
        Analysis::new(problem.stiffness, free, problem.positions, params.ordering)
    };
    match params.method {
        Method::Krylov => return krylov(problem, free, params, progress, u, info),
        Method::Direct => {}
        Method::Auto if problem.stiffness.nonzeros() <= ANALYSED => {
            let analysis = analyse()?;
            let cost = analysis.cost(problem.symmetry);
            let fits = params.memory_limit.is_none_or(|limit| cost.bytes <= limit);
            if fits && cost.flops <= DIRECT_OPERATIONS * problem.stiffness.nonzeros() as f64 {
                return direct(problem, free, analysis, params, progress, u, info);
            }
            // not kept: its memory is better spent on the hierarchy
        }
        Method::Auto => {}
    }
    if params.method == Method::Auto {
        let (start, before) = (u.to_vec(), *info);
        if krylov(problem, free, params, progress, u, info).is_ok() {
            return Ok(());
        }
        u.copy_from_slice(&start);
        *info = before;
    }
    direct(problem, free, analyse()?, params, progress, u, info)
}

fn krylov(
    problem: &StaticProblem<'_>,
    free: &FreeDofs,
    params: &StaticParams,
    progress: &dyn Progress,
    u: &mut [f64],
    info: &mut StaticInfo,
) -> Result<(), StaticError> {
    let start = Instant::now();
    progress.stage("multigrid set-up", None);
    let (multigrid, _) = Multigrid::new(
        problem.stiffness,
        free,
        problem.positions,
        &MultigridParams::default(),
    )?;
    info.factor_seconds = start.elapsed().as_secs_f64();
    let start = Instant::now();
    progress.stage("iteration", None);
    let operator = FreeOperator::new(problem.stiffness, free);
    let (mut r, scale) = residual(problem, u);
    let mut norm = scale;
    info.method = MethodUsed::ConjugateGradients;
    if problem.symmetry == Symmetry::Unsymmetric {
        info.method = MethodUsed::Gmres;
    }
    // the recurrence of conjugate gradients drifts from the true residual; starting over from it mends that
    while norm > params.tolerance * scale && info.iterations < params.max_iterations {
        let limits = KrylovParams {
            tolerance: 0.9 * params.tolerance * scale / norm,
            max_iterations: params.max_iterations - info.iterations,
            ..KrylovParams::default()
        };
        let result = match info.method {
            MethodUsed::Gmres => gmres(&operator, &multigrid, &r, &limits, progress),
            _ => conjugate_gradients(&operator, &multigrid, &r, &limits, progress),
        };
        match result {
            Ok((step, done)) => {
                info.iterations += done.iterations;
                u.iter_mut().zip(&step).for_each(|(u, s)| *u += s);
            }
            Err(KrylovError::Indefinite { iteration }) => {
                info.iterations += iteration;
                info.method = MethodUsed::Gmres;
                continue;
            }
            Err(KrylovError::NotConverged {
                residual,
                iterations,
            }) => {
                return Err(StaticError::NotConverged {
                    residual: residual * norm / scale,
                    tolerance: params.tolerance,
                    iterations: info.iterations + iterations,
                });
            }
        }
        let before = norm;
        (r, norm) = residual(problem, u);
        if norm.is_nan() || norm > 0.5 * before {
            break;
        }
    }
    info.relative_residual = if scale > 0.0 { norm / scale } else { 0.0 };
    info.solve_seconds = start.elapsed().as_secs_f64();
    accept(problem, params, u, &r, info)
}

/// Refuses a solution whose residual is above the tolerance and above round-off.
fn accept(
    problem: &StaticProblem<'_>,
    params: &StaticParams,
    u: &[f64],
    r: &[f64],
    info: &StaticInfo,
) -> Result<(), StaticError> {
    let enough =
        info.relative_residual <= params.tolerance || backward_error(problem, u, r) <= BACKWARD;
    if enough {
        return Ok(());
    }
    Err(StaticError::NotConverged {
        residual: info.relative_residual,
        tolerance: params.tolerance,
        iterations: info.iterations,
    })
}

fn direct(
    problem: &StaticProblem<'_>,
    free: &FreeDofs,
    analysis: Analysis,
    params: &StaticParams,
    progress: &dyn Progress,
    u: &mut [f64],
    info: &mut StaticInfo,
) -> Result<(), StaticError> {
    let (factor, symmetry, done) = factorise(problem, free, analysis, params, progress)?;
    info.method = match symmetry {
        Symmetry::Symmetric => MethodUsed::Cholesky,
        Symmetry::Unsymmetric => MethodUsed::Lu,
    };
    info.ordering = Some(done.ordering);
    info.factor_nnz = done.cost.factor_nnz;
    info.factor_bytes = done.cost.bytes;
    info.ordering_seconds = done.ordering_seconds;
    info.factor_seconds = done.factor_seconds;
    let start = Instant::now();
    progress.stage("solve", None);
    let (mut r, scale) = residual(problem, u);
    let mut norm = scale;
    while norm > REFINED * scale && info.iterations <= REFINEMENTS {
        let step = factor.solve(&r);
        let trial: Vec<f64> = u.iter().zip(&step).map(|(u, s)| u + s).collect();
        let (new, size) = residual(problem, &trial);
        if size.is_nan() || size >= norm {
            break;
        }
        let stalled = size > 0.5 * norm;
        u.copy_from_slice(&trial);
        (r, norm) = (new, size);
        info.iterations += 1;
        if stalled {
            break;
        }
    }
    info.relative_residual = if scale > 0.0 { norm / scale } else { 0.0 };
    info.solve_seconds = start.elapsed().as_secs_f64();
    accept(problem, params, u, &r, info)
}

/// `‖r‖ / (‖K‖ ‖u‖ + ‖f‖)` in the largest-entry norm.
fn backward_error(problem: &StaticProblem<'_>, u: &[f64], r: &[f64]) -> f64 {
    let largest = |v: &[f64]| v.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let d = problem.stiffness.block;
    let mut norm = 0.0_f64;
    for i in 0..problem.stiffness.rows() {
        let (_, blocks) = problem.stiffness.row(i);
        for a in 0..d {
            norm = norm.max(
                blocks
                    .chunks(d * d)
                    .flat_map(|k| &k[a * d..(a + 1) * d])
                    .map(|k| k.abs())
                    .sum(),
            );
        }
    }
    let size = norm * largest(u) + largest(problem.load);
    if size > 0.0 { largest(r) / size } else { 0.0 }
}

/// Cholesky where the system is symmetric, and LU where it is not, or is not positive definite.
fn factorise(
    problem: &StaticProblem<'_>,
    free: &FreeDofs,
    analysis: Analysis,
    params: &StaticParams,
    progress: &dyn Progress,
) -> Result<(Factor, Symmetry, DirectInfo), StaticError> {
    let attempt = |analysis, symmetry| {
        let params = DirectParams {
            symmetry,
            memory_limit: params.memory_limit,
            ..DirectParams::default()
        };
        Factor::new(problem.stiffness, free, analysis, &params, progress)
            .map(|(factor, info)| (factor, symmetry, info))
    };
    let mut result = attempt(analysis, problem.symmetry);
    if let Err(DirectError::NotPositive { .. }) = result {
        let analysis = Analysis::new(problem.stiffness, free, problem.positions, params.ordering)?;
        result = attempt(analysis, Symmetry::Unsymmetric);
    }
    match result {
        Ok(done) => Ok(done),
        Err(error @ DirectError::TooLarge { .. }) => Err(StaticError::TooLarge(error)),
        Err(DirectError::NotPositive { site } | DirectError::Singular { site, .. }) => {
            let motion = singular::mechanism(
                problem.stiffness,
                free,
                problem.positions,
                params.ordering,
                site,
            );
            Err(singular_error(motion, problem.positions))
        }
    }
}

#[cfg(test)]
mod tests;
