//! The ways to solve for the free dofs, and the choice among them.

use crate::progress::Progress;
use crate::solve::direct::{Analysis, DirectInfo, Factor};
use crate::solve::direct_params::{DirectError, DirectParams};
use crate::solve::krylov::{KrylovError, KrylovParams, conjugate_gradients, gmres};
use crate::solve::multigrid::{Multigrid, MultigridParams};
use crate::solve::singularity_diagnosis;
use crate::solve::statics::{
    Method, MethodUsed, StaticError, StaticInfo, StaticParams, StaticProblem, singular_error,
};
use crate::solve::symbolic::FactorCost;
use crate::solve::{FreeDofs, FreeOperator};
use crate::system::{BlockCsr, Symmetry};
use std::time::Instant;

/// Refinement stops here: the residual is at round-off.
const REFINED: f64 = 1e-15;

/// Steps of iterative refinement; one or two suffice where the factors are any good.
const REFINEMENTS: usize = 4;

/// A direct solution whose residual is this small against `‖K‖ ‖u‖ + ‖f‖` solves a problem within round-off of the
/// one given, and no direct method does better: long slender models have `‖K‖ ‖u‖ ≫ ‖f‖`.
pub(super) const BACKWARD: f64 = 1e-14;

/// A refined direct solution with a larger relative residual than this comes of a matrix that is singular to
/// round-off: a pivot of `p` of its diagonal leaves about 1e-16 / `p`, and pivots below 1e-11 are refused before.
pub(super) const SUSPECT: f64 = 1e-6;

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

/// Scale of residuals: the first of them, at the displacement `u` of the supports, but no less than what leaves [`SUSPECT`] of it where it is [`BACKWARD`] of `‖|K| |u|‖` on free dofs.
///
/// Supports that shift the body as a rigid one leave a first residual of nothing but round-off, of which no solution leaves less.
pub(super) fn scale(first: f64, resisted: f64) -> f64 {
    first.max(BACKWARD / SUSPECT * resisted)
}

/// The square of `|K| |u|` in a block row, summed over its dofs that `is_free`.
pub(super) fn resisted_squared(
    matrix: &BlockCsr,
    row: usize,
    u: &[f64],
    is_free: impl Fn(usize) -> bool,
) -> f64 {
    let d = matrix.block;
    let (columns, blocks) = matrix.row(row);
    let of = |a: usize| -> f64 {
        let each = columns.iter().zip(blocks.chunks_exact(d * d));
        each.map(|(&column, block)| {
            let u = &u[column as usize * d..][..d];
            let scalars = block[a * d..][..d].iter().zip(u);
            scalars.map(|(k, u)| (k * u).abs()).sum::<f64>()
        })
        .sum()
    };
    (0..d).filter(|&a| is_free(a)).map(|a| of(a).powi(2)).sum()
}

/// The residual at the displacement of the supports, its norm, and the scale of residuals.
fn first_residual(problem: &StaticProblem<'_>, u: &[f64]) -> (Vec<f64>, f64, f64) {
    let matrix = problem.stiffness;
    let d = matrix.block;
    let of_row = |row: usize| {
        let is_free = |a: usize| problem.prescribed[row * d + a].is_none();
        resisted_squared(matrix, row, u, is_free)
    };
    let resisted = (0..matrix.rows()).map(of_row).sum::<f64>().sqrt();
    let (r, norm) = residual(problem, u);
    (r, norm, scale(norm, resisted))
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
pub(super) fn solve_free(
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
            if factorises(&cost, problem.stiffness.nonzeros(), params.memory_limit) {
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

/// Returns true if `Auto` factorises a matrix of `nonzeros` stored scalars whose factorisation costs `cost`.
fn factorises(cost: &FactorCost, nonzeros: usize, memory_limit: Option<u64>) -> bool {
    let fits = memory_limit.is_none_or(|limit| cost.bytes <= limit);
    nonzeros <= ANALYSED && fits && cost.flops <= DIRECT_OPERATIONS * nonzeros as f64
}

/// The method that [`solve`](super::solve) will take for a matrix of `nonzeros` stored scalars whose factorisation costs `cost`.
pub fn expected_method(
    params: &StaticParams,
    symmetry: Symmetry,
    cost: &FactorCost,
    nonzeros: usize,
) -> MethodUsed {
    let direct = match params.method {
        Method::Auto => factorises(cost, nonzeros, params.memory_limit),
        Method::Direct => true,
        Method::Krylov => false,
    };
    match (direct, symmetry) {
        (true, Symmetry::Symmetric) => MethodUsed::Cholesky,
        (true, Symmetry::Unsymmetric) => MethodUsed::Lu,
        (false, Symmetry::Symmetric) => MethodUsed::ConjugateGradients,
        (false, Symmetry::Unsymmetric) => MethodUsed::Gmres,
    }
}

/// Factors of `K` to lead an iteration whose operator is near it: where `params` ask for a factorisation, or `Auto` finds it cheap.
///
/// There are none of a symmetric `K` that has negative eigenvalues, for those of LU would not be symmetric.
///
/// # Errors
/// [`StaticError`] if the order cannot be computed, or factors that are asked for would not fit.
pub fn factors(
    problem: &StaticProblem<'_>,
    params: &StaticParams,
    progress: &dyn Progress,
) -> Result<Option<(Factor, DirectInfo)>, StaticError> {
    let matrix = problem.stiffness;
    let free = FreeDofs::from_prescribed(problem.prescribed, matrix.block.max(1));
    let is_auto = params.method == Method::Auto;
    if params.method == Method::Krylov || is_auto && matrix.nonzeros() > ANALYSED {
        return Ok(None);
    }
    progress.stage("ordering", None);
    let analysis = Analysis::new(matrix, &free, problem.positions, params.ordering)?;
    let cost = analysis.cost(problem.symmetry);
    if is_auto && !factorises(&cost, matrix.nonzeros(), params.memory_limit) {
        return Ok(None);
    }
    let params = DirectParams {
        symmetry: problem.symmetry,
        smallest_pivot: 0.0,
        memory_limit: params.memory_limit,
    };
    match Factor::new(matrix, &free, analysis, &params, progress) {
        Ok(done) => Ok(Some(done)),
        Err(error @ DirectError::TooLarge { .. }) => Err(StaticError::TooLarge(error)),
        Err(DirectError::NotPositive { .. } | DirectError::Singular { .. }) => Ok(None),
    }
}

/// Multigrid of the free part of `matrix`, to lead an iteration whose operator is near it; none where the matrix has none.
pub fn multigrid<'a>(
    matrix: &'a BlockCsr,
    free: &'a FreeDofs,
    positions: &[[f64; 3]],
    progress: &dyn Progress,
) -> Option<Multigrid<'a>> {
    progress.stage("multigrid set-up", None);
    let made = Multigrid::new(matrix, free, positions, &MultigridParams::default());
    made.ok().map(|(multigrid, _)| multigrid)
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
    let (mut r, mut norm, scale) = first_residual(problem, u);
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
            Err(KrylovError::Interrupted { iteration }) => {
                let iterations = info.iterations + iteration;
                return Err(StaticError::Interrupted { iterations });
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
    let enough = info.relative_residual <= params.tolerance
        || info.relative_residual <= SUSPECT && backward_error(problem, u, r) <= BACKWARD;
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
    let (mut r, mut norm, scale) = first_residual(problem, u);
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
    if info.relative_residual > SUSPECT
        && let Some(motion) = singularity_diagnosis::mechanism(
            problem.stiffness,
            free,
            problem.positions,
            params.ordering,
        )
    {
        return Err(singular_error(motion, problem.positions));
    }
    accept(problem, params, u, &r, info)
}

/// `‖r‖ / (‖K‖ ‖u‖ + ‖f‖)` in the largest-entry norm.
fn backward_error(problem: &StaticProblem<'_>, u: &[f64], r: &[f64]) -> f64 {
    let largest = |v: &[f64]| v.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let size = problem.stiffness.largest_row_sum() * largest(u) + largest(problem.load);
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
            // where no null vector is found, the site of the pivot is the answer of last resort
            let motion = singularity_diagnosis::mechanism(
                problem.stiffness,
                free,
                problem.positions,
                params.ordering,
            )
            .unwrap_or_else(|| singularity_diagnosis::moving(vec![site]));
            Err(singular_error(motion, problem.positions))
        }
    }
}
