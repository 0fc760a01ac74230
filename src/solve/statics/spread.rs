//! The static problem whose rows are spread over ranks: the solver of [`crate::system::Ranks`] on the own rows, and refinement until the residual that
//! the rows themselves give is what was asked for, whatever norm that solver goes by.
//!
//! A long body has displacements that are off by (L/h)² times its residual. So the tolerance holds for both: refinement ends once the residual is within it, and
//! the last change of the displacements too.

use std::time::Instant;

use super::{
    Method, MethodUsed, StaticError, StaticInfo, StaticParams, StaticSolution,
    methods::{BACKWARD, SUSPECT, resisted_squared, scale},
    singular_error,
};
use crate::progress::Progress;
use crate::solve::FreeDofs;
use crate::solve::krylov::{self, LinearMap};
use crate::solve::singularity_diagnosis::{self, HeldRows};
use crate::system::{BlockCsr, RankRows, RankSolverKind, Spread, Symmetry};

/// Solves with the residual that is left, at most.
const REFINEMENTS: usize = 12;

/// No solve is asked for less: where the residual of one falls by this, the next goes on from there.
const TIGHTEST: f64 = 1e-12;

/// To this part of the residual that is left each solve goes that shows how far off the displacements still are.
const SETTLING: f64 = 1e-3;

/// The rows of the own sites, as a map of the numbers of all sites.
#[derive(Clone, Copy, Debug)]
pub struct SpreadRows<'a> {
    /// Rows of the own sites, ascending.
    pub matrix: &'a BlockCsr,
    /// Partition of the other sites over ranks.
    pub spread: Spread<'a>,
}

impl SpreadRows<'_> {
    /// The products of the own rows: a block of numbers per own site.
    fn own_products(&self, x: &[f64]) -> Vec<f64> {
        let mut own = vec![0.0; self.matrix.dofs()];
        self.matrix.multiply_into(x, &mut own);
        own
    }

    /// Collective: an estimate of `‖K − Kᵀ‖ / ‖K‖`, from `xᵀ K y − yᵀ K x` with two vectors without order; zero to round-off of a symmetric matrix.
    pub fn asymmetry(&self) -> f64 {
        let dofs = self.spread.partition.sites() * self.matrix.block;
        let vector = |seed: usize| -> Vec<f64> { (0..dofs).map(|k| noise(2 * k + seed)).collect() };
        let (x, y) = (vector(0), vector(1));
        let mut products = [vec![0.0; dofs], vec![0.0; dofs]];
        self.apply_into(&x, &mut products[0]);
        self.apply_into(&y, &mut products[1]);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let skew = (dot(&x, &products[1]) - dot(&y, &products[0])).abs();
        let own = (0..self.matrix.rows()).map(|i| {
            let blocks = self.matrix.row(i).1;
            blocks.iter().map(|k| k * k).sum::<f64>()
        });
        let squares = self.spread.sum(own.sum());
        // the numbers have variance 1/3: E (xᵀ (K − Kᵀ) y)² = ‖K − Kᵀ‖² / 9
        if squares > 0.0 {
            3.0 * skew / squares.sqrt()
        } else {
            0.0
        }
    }
}

/// A number in [−1, 1) that depends on its argument only.
fn noise(of: usize) -> f64 {
    let mut z = (of as u64)
        .wrapping_add(1)
        .wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

impl LinearMap for SpreadRows<'_> {
    /// Collective.
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        self.spread.gather_sites(&self.own_products(x), y);
    }
}

/// A static problem of which each rank has its rows.
///
/// Shapes: `load` and `prescribed` have one entry per dof of all sites, `positions` one per site; all ranks have all of them.
#[derive(Clone, Copy, Debug)]
pub struct SpreadProblem<'a> {
    /// The rows of the own sites, those of prescribed dofs included.
    pub rows: SpreadRows<'a>,
    /// Symmetry of `K`.
    pub symmetry: Symmetry,
    /// Position of each site; unused components are zero.
    pub positions: &'a [[f64; 3]],
    /// Applied force on each dof.
    pub load: &'a [f64],
    /// Prescribed displacement of each dof; `None` where it is unknown.
    pub prescribed: &'a [Option<f64>],
}

impl SpreadProblem<'_> {
    /// `f − K u` on the own free dofs, zero on the others, and its 2-norm over all ranks.
    fn residual(&self, u: &[f64]) -> (Vec<f64>, f64) {
        let d = self.rows.matrix.block;
        let mut r = self.rows.own_products(u);
        for (r, &site) in r.chunks_exact_mut(d).zip(self.rows.spread.own()) {
            for (a, r) in r.iter_mut().enumerate() {
                let dof = site as usize * d + a;
                *r = match self.prescribed[dof] {
                    None => self.load[dof] - *r,
                    Some(_) => 0.0,
                };
            }
        }
        let own = r.iter().map(|x| x * x).sum::<f64>();
        (r, self.rows.spread.sum(own).sqrt())
    }

    /// Collective: the residual of the own dofs at the displacement of the supports, its norm over all ranks, and the scale of residuals.
    fn first_residual(&self, u: &[f64]) -> (Vec<f64>, f64, f64) {
        let (matrix, own) = (self.rows.matrix, self.rows.spread.own());
        let of_row = |row: usize| {
            let first = own[row] as usize * matrix.block;
            let is_free = |a: usize| self.prescribed[first + a].is_none();
            resisted_squared(matrix, row, u, is_free)
        };
        let resisted = (0..own.len()).map(of_row).sum::<f64>();
        let resisted = self.rows.spread.sum(resisted).sqrt();
        let (r, norm) = self.residual(u);
        (r, norm, scale(norm, resisted))
    }

    /// Collective: `‖r‖ / (‖K‖ ‖u‖ + ‖f‖)` in the largest-entry norm; `r` is that of the own dofs.
    fn backward_error(&self, u: &[f64], r: &[f64]) -> f64 {
        let largest = |v: &[f64]| v.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let own = [self.rows.matrix.largest_row_sum(), largest(r)].map(f64::to_bits);
        let all = self.rows.spread.ranks.gather_words(&own);
        let of_all = |k: usize| {
            let each = all.iter().map(|words| f64::from_bits(words[k]));
            each.fold(0.0, f64::max)
        };
        let size = of_all(0) * largest(u) + largest(self.load);
        if size > 0.0 { of_all(1) / size } else { 0.0 }
    }

    /// Collective: refuses numbers that are not finite, with the first site of any rank.
    fn check(&self) -> Result<(), StaticError> {
        let d = self.rows.matrix.block;
        let finite = |values: &[f64]| values.iter().all(|x| x.is_finite());
        let own = self.rows.spread.own();
        let mut bad = (0..own.len()).filter(|&r| !finite(self.rows.matrix.row(r).1));
        let mine: Vec<u64> = bad.next().map(|r| u64::from(own[r])).into_iter().collect();
        let all = self.rows.spread.ranks.gather_words(&mine);
        let stiffness = all.into_iter().flatten().min().map(|s| s as usize);
        let site_of = |dof: usize| dof / d;
        let load = self.load.iter().position(|f| !f.is_finite()).map(site_of);
        let held = |u: &Option<f64>| u.is_some_and(|u| !u.is_finite());
        let prescribed = self.prescribed.iter().position(held).map(site_of);
        let found = [
            ("stiffness", stiffness),
            ("load", load),
            ("prescribed displacement", prescribed),
        ];
        match found.into_iter().find_map(|(what, s)| Some((what, s?))) {
            Some((what, site)) => Err(StaticError::NotFinite {
                what,
                site,
                position: self.positions[site],
            }),
            None => Ok(()),
        }
    }
}

/// Solves a static problem of which each rank has its rows; all ranks get all of the solution.
///
/// [`Method::Auto`] iterates, and factorises where the iteration does not come to its end.
///
/// # Errors
/// [`StaticError`], the same on every rank.
pub fn solve_spread(
    problem: &SpreadProblem<'_>,
    params: &StaticParams,
    progress: &dyn Progress,
) -> Result<StaticSolution, StaticError> {
    let (matrix, spread) = (problem.rows.matrix, problem.rows.spread);
    problem.check()?;
    let free = FreeDofs::from_prescribed(problem.prescribed, matrix.block.max(1));
    let held = HeldRows {
        matrix,
        spread: Some(spread),
    };
    if free.count() > 0
        && let Some(motion) = singularity_diagnosis::unheld_bodies(&held, &free, problem.positions)
    {
        return Err(singular_error(motion, problem.positions));
    }
    let mut info = StaticInfo {
        method: MethodUsed::None,
        ordering: None,
        free_dofs: free.count(),
        matrix_nnz: spread.sum(matrix.nonzeros() as f64) as usize,
        factor_nnz: 0,
        factor_bytes: 0,
        ordering_seconds: 0.0,
        factor_seconds: 0.0,
        solve_seconds: 0.0,
        iterations: 0,
        relative_residual: 0.0,
    };
    let given = problem.prescribed.iter();
    let mut u: Vec<f64> = given.map(|p| p.unwrap_or(0.0)).collect();
    if info.free_dofs > 0 {
        let kinds: &[RankSolverKind] = match params.method {
            Method::Krylov => &[RankSolverKind::Krylov],
            Method::Direct => &[RankSolverKind::Direct],
            Method::Auto => &[RankSolverKind::Krylov, RankSolverKind::Direct],
        };
        let start = u.clone();
        let mut result = Ok(());
        for &kind in kinds {
            u.copy_from_slice(&start);
            result = refine(problem, kind, params, progress, &mut u, &mut info);
            if result.is_ok() {
                break;
            }
        }
        result?;
    }
    let mut reactions = vec![0.0; u.len()];
    problem.rows.apply_into(&u, &mut reactions);
    for (k, r) in reactions.iter_mut().enumerate() {
        *r = match problem.prescribed[k] {
            Some(_) => *r - problem.load[k],
            None => 0.0,
        };
    }
    progress.finish();
    Ok(StaticSolution {
        displacement: u,
        reactions,
        info,
    })
}

/// Collective: whether factors leave no more than round-off.
fn is_round_off(
    problem: &SpreadProblem<'_>,
    kind: RankSolverKind,
    u: &[f64],
    r: &[f64],
    info: &StaticInfo,
) -> bool {
    kind == RankSolverKind::Direct
        && info.relative_residual <= SUSPECT
        && problem.backward_error(u, r) <= BACKWARD
}

/// Solves by one kind of solver with what is left of the residual until that is small enough.
fn refine(
    problem: &SpreadProblem<'_>,
    kind: RankSolverKind,
    params: &StaticParams,
    progress: &dyn Progress,
    u: &mut [f64],
    info: &mut StaticInfo,
) -> Result<(), StaticError> {
    let (matrix, spread) = (problem.rows.matrix, problem.rows.spread);
    let prescribed: Vec<bool> = problem.prescribed.iter().map(Option::is_some).collect();
    info.method = match (kind, problem.symmetry) {
        (RankSolverKind::Direct, _) => MethodUsed::RankDirect,
        (RankSolverKind::Krylov, Symmetry::Symmetric) => MethodUsed::RankConjugateGradients,
        (RankSolverKind::Krylov, Symmetry::Unsymmetric) => MethodUsed::RankGmres,
    };
    info.iterations = 0;
    progress.stage("solver of the ranks", None);
    let clock = Instant::now();
    let rows = RankRows {
        matrix,
        partition: spread.partition,
        symmetry: problem.symmetry,
        positions: problem.positions,
        prescribed: &prescribed,
    };
    let mut solver =
        (spread.ranks.solver(rows, kind)).map_err(|message| StaticError::Ranks { message })?;
    info.factor_seconds += clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    progress.stage("solve", None);
    let (mut r, mut norm, scale) = problem.first_residual(u);
    let mut step = vec![0.0; r.len()];
    let mut all = vec![0.0; u.len()];
    let mut failure = None;
    let mut is_settled = false;
    for _ in 0..REFINEMENTS {
        let is_small = norm <= params.tolerance * scale;
        if norm == 0.0 || (is_small && is_settled) || info.iterations >= params.max_iterations {
            break;
        }
        let tolerance = match is_small {
            true => SETTLING,
            false => (0.5 * params.tolerance * scale / norm).clamp(TIGHTEST, 0.1),
        };
        let left = params.max_iterations - info.iterations;
        let done = solver.solve_into(&r, &mut step, tolerance, left);
        info.iterations += done.iterations;
        failure = done.failure.or(failure);
        spread.gather_sites(&step, &mut all);
        let trial: Vec<f64> = u.iter().zip(&all).map(|(u, s)| u + s).collect();
        let (new, size) = problem.residual(&trial);
        if size.is_nan() || size >= norm {
            break;
        }
        let stalled = size > 0.5 * norm;
        u.copy_from_slice(&trial);
        (r, norm) = (new, size);
        is_settled = krylov::norm(&all) <= params.tolerance * krylov::norm(u);
        if stalled {
            break;
        }
    }
    info.relative_residual = if scale > 0.0 { norm / scale } else { 0.0 };
    info.solve_seconds += clock.elapsed().as_secs_f64();
    if info.relative_residual <= params.tolerance || is_round_off(problem, kind, u, &r, info) {
        return Ok(());
    }
    Err(StaticError::RanksNotConverged {
        residual: info.relative_residual,
        tolerance: params.tolerance,
        iterations: info.iterations,
        why: failure.unwrap_or_else(|| "the residual falls no further".to_owned()),
        remedy: match kind {
            RankSolverKind::Krylov => "factorise instead (solver.method = \"direct\"), give",
            RankSolverKind::Direct => "ask for a larger solver.tolerance, give",
        },
    })
}
