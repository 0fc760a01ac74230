//! The static problem: `K u = f` on free dofs, `u` given on the others.

use crate::progress::Progress;
use crate::solve::FreeDofs;
use crate::solve::direct_params::DirectError;
use crate::solve::multigrid::MultigridError;
use crate::solve::ordering::{Ordering, OrderingError};
use crate::solve::singularity_diagnosis::{self, FreeMotion, HeldRows};
use crate::system::{BlockCsr, Symmetry};

mod methods;
mod spread;

pub use methods::{expected_method, factors, multigrid};
pub use spread::{SpreadProblem, SpreadRows, solve_spread};

/// A static problem; borrowed, so that assembling it is the caller's to time.
///
/// Shapes: `load` and `prescribed` have one entry per dof of `stiffness`, `positions` one per site. Units: whatever
/// `K u = f` holds in.
#[derive(Clone, Copy, Debug)]
pub struct StaticProblem<'a> {
    /// The stiffness `K`, rows of prescribed dofs included (reactions need them).
    pub stiffness: &'a BlockCsr,
    /// Symmetry of `K`.
    pub symmetry: Symmetry,
    /// Position of each site; unused components are zero.
    pub positions: &'a [[f64; 3]],
    /// Applied force `f` on each dof.
    pub load: &'a [f64],
    /// Prescribed displacement of each dof; `None` where it is unknown.
    pub prescribed: &'a [Option<f64>],
}

/// Method of solution.
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

/// Parameters of a static solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticParams {
    /// Method of solution.
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
    /// Conjugate gradients with algebraic multigrid, over ranks.
    RankConjugateGradients,
    /// Restarted GMRES with algebraic multigrid, over ranks.
    RankGmres,
    /// A factorisation over ranks.
    RankDirect,
    /// Newton's method, led by factors of the stiffness or by its row sums.
    Newton,
    /// Nothing was free.
    None,
}

impl MethodUsed {
    /// Its usual name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cholesky => "Cholesky factorisation",
            Self::Lu => "LU factorisation",
            Self::ConjugateGradients => "conjugate gradients with multigrid",
            Self::Gmres => "GMRES with multigrid",
            Self::RankConjugateGradients => "conjugate gradients with algebraic multigrid of PETSc",
            Self::RankGmres => "GMRES with algebraic multigrid of PETSc",
            Self::RankDirect => "factorisation by MUMPS",
            Self::Newton => "Newton's method",
            Self::None => "no solver",
        }
    }
}

/// Summary of a static solve.
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
    /// Summary of the solve.
    pub info: StaticInfo,
}

/// Failure of a static solve.
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
    /// The listener asked for the end.
    #[error("interrupted after {iterations} iterations")]
    Interrupted {
        /// Iterations done.
        iterations: usize,
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
        /// Their free motions.
        modes: Vec<String>,
        /// The remedy.
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
    /// The ranks have no solver for the problem.
    #[error("no solver over ranks: {message}")]
    Ranks {
        /// The message of the solver.
        message: String,
    },
    /// The residual of a solver over ranks stayed above the tolerance.
    #[error(
        "the residual stayed at {residual:.1e} of the load after {iterations} iterations over ranks ({why}), {tolerance:.1e} was asked for; \
         {remedy} other options in PETSC_OPTIONS, or check for near-mechanisms and extreme contrasts of stiffness"
    )]
    RanksNotConverged {
        /// Relative residual reached.
        residual: f64,
        /// Relative residual asked for.
        tolerance: f64,
        /// Iterations done.
        iterations: usize,
        /// The reason that the solver gives.
        why: String,
        /// The remedy to try first.
        remedy: &'static str,
    },
    /// Newton's method found no equilibrium of forces that are not linear.
    #[error(
        "no equilibrium was found: the residual is {residual:.1e} of the forces after {iterations} iterations, largest \
         at site {site} {position:?}; apply the loads in steps ([solve.quasi-static]), in which a body follows its path"
    )]
    NoEquilibrium {
        /// Relative residual.
        residual: f64,
        /// Iterations spent.
        iterations: usize,
        /// Site at which the residual is largest.
        site: usize,
        /// Its position.
        position: [f64; 3],
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

/// Number of positions that an error lists at most.
const LISTED: usize = 4;

/// Solves a static problem.
///
/// # Errors
/// [`StaticError`]; a singular system is reported with the sites that are free to move.
pub fn solve(
    problem: &StaticProblem<'_>,
    params: &StaticParams,
    progress: &dyn Progress,
) -> Result<StaticSolution, StaticError> {
    let free = well_posed(problem)?;
    let matrix = problem.stiffness;
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
        methods::solve_free(problem, &free, params, progress, &mut u, &mut info)?;
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

/// The free dofs of a problem whose numbers are finite and whose bodies cannot move as rigid ones.
///
/// # Errors
/// [`StaticError`] with the site; for free rigid-body motions with their names.
pub fn well_posed(problem: &StaticProblem<'_>) -> Result<FreeDofs, StaticError> {
    check(problem)?;
    let matrix = problem.stiffness;
    let free = FreeDofs::from_prescribed(problem.prescribed, matrix.block.max(1));
    let rows = HeldRows {
        matrix,
        spread: None,
    };
    match singularity_diagnosis::unheld_bodies(&rows, &free, problem.positions) {
        Some(motion) if free.count() > 0 => Err(singular_error(motion, problem.positions)),
        _ => Ok(free),
    }
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

#[cfg(test)]
mod tests;
