//! Estimate of the solution with a stiffness: method, factors, memory and time.

use std::time::Duration;

use crate::model::Model;
use crate::observe::summary::Timings;
use crate::run::RunError;
use crate::run::equilibrium;
use crate::run::setup::RunSettings;
use crate::solve::FreeDofs;
use crate::solve::direct::Analysis;
use crate::solve::factor_time_estimate::{rehearse, seconds_per_scalar};
use crate::solve::statics::{MethodUsed, StaticError, expected_method};
use crate::solve::symbolic::FactorCost;
use crate::system::{BlockCsr, Symmetry};
use crate::tensor::padded;

/// A factorisation is rehearsed for so long at most, and for no longer than a tenth of what it takes at [`OPERATIONS`].
const REHEARSED: f64 = 0.5;

/// Operations per second of one thread, to tell how long to rehearse; the prediction does not use it.
const OPERATIONS: f64 = 1e10;

/// Solves with the factors, each with a product and a residual: one or two refinements, and one that finds nothing to gain.
const SUBSTITUTIONS: f64 = 3.0;

/// Times that a whole iterative solve reads the stiffness, set-up and cycles included: `benches/solvers.rs` takes 0.8e-7 to
/// 2.5e-7 s of CPU per stored scalar, and [`seconds_per_scalar`] gives 1e-10 s there.
const PASSES: f64 = 1500.0;

/// Bytes of a factorisation on two threads over those on one: two subtrees hold contribution blocks. Measured on the scenes
/// of `tests/check.rs`: 1.23 to 1.36 for Cholesky, whose factors are the smaller part, 1.0 to 1.15 for LU.
const CHOLESKY: f64 = 1.26;

/// As [`CHOLESKY`].
const LU: f64 = 1.1;

/// Bytes of a multigrid hierarchy and of the vectors of an iteration over those of the stiffness; measured 2.1 to 2.2.
const HIERARCHY: f64 = 2.1;

/// Planned solution with a stiffness.
pub(crate) struct Planned {
    analysis: Analysis,
    symmetry: Symmetry,
    nonzeros: usize,
    pub method: MethodUsed,
    /// Cost of the factors; nothing of an iterative method.
    pub cost: FactorCost,
    /// Bytes of the stiffness.
    pub stiffness: u64,
    /// Bytes of the factors, or of the multigrid hierarchy.
    pub solver: u64,
}

impl Planned {
    /// Plans the solution on the free dofs of a stiffness.
    ///
    /// # Errors
    /// [`RunError`] for a graph that cannot be ordered.
    pub fn of<const D: usize>(
        model: &Model<D>,
        stiffness: &BlockCsr,
        free: &FreeDofs,
        rest: &RunSettings<D>,
        symmetry: Symmetry,
    ) -> Result<Self, RunError> {
        let positions: Vec<[f64; 3]> = model.sites.iter().map(|s| padded(&s.position)).collect();
        let params = equilibrium::params(&rest.solver);
        let analysis = Analysis::new(stiffness, free, &positions, params.ordering)
            .map_err(StaticError::from)?;
        let (cost, nonzeros) = (analysis.cost(symmetry), stiffness.nonzeros());
        let method = expected_method(&params, symmetry, &cost, nonzeros);
        let columns = 4 * stiffness.columns.len();
        let stored = 8 * (stiffness.values.len() + model.sites.len()) + columns;
        let (cost, solver) = match method {
            MethodUsed::Cholesky => (cost, analysis.bytes() as f64 + CHOLESKY * cost.bytes as f64),
            MethodUsed::Lu => (cost, analysis.bytes() as f64 + LU * cost.bytes as f64),
            // coarse levels share no rows
            _ => {
                let hierarchy = HIERARCHY * (8 * nonzeros + columns) as f64;
                (
                    FactorCost::default(),
                    hierarchy.max(analysis.bytes() as f64),
                )
            }
        };
        Ok(Self {
            analysis,
            symmetry,
            nonzeros,
            method,
            cost,
            stiffness: stored as u64,
            solver: solver as u64,
        })
    }

    /// Returns true if the stiffness is factorised.
    pub fn is_factorised(&self) -> bool {
        matches!(self.method, MethodUsed::Cholesky | MethodUsed::Lu)
    }

    /// Adds the seconds of the solution: of a factorisation from parts of it that are tried here, of an iteration from what it reads.
    pub fn add_seconds(&self, timings: &mut Timings) {
        let threads = rayon::current_num_threads() as f64;
        let product = self.nonzeros as f64 * seconds_per_scalar() / threads;
        if self.is_factorised() {
            let most = (0.1 * self.cost.flops / OPERATIONS / threads).clamp(0.01, REHEARSED);
            let told = rehearse(&self.analysis, self.symmetry, Duration::from_secs_f64(most));
            timings.add("factorisation", told.factorisation);
            timings.add("solve", SUBSTITUTIONS * (told.substitution + product));
        } else {
            timings.add("iteration", PASSES * product);
        }
    }
}
