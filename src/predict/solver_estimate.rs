//! Estimate of the solution with a stiffness that is not assembled yet: method, factors, memory and time.

use std::time::Duration;

use crate::assembly::Pattern;
use crate::model::Model;
use crate::observe::summary::{Sizes, Timings};
use crate::run::RunError;
use crate::run::budget::Share;
use crate::run::equilibrium;
use crate::run::setup::RunSettings;
use crate::scene::Output;
use crate::scene::spec::PointOutputSpec;
use crate::solve::FreeDofs;
use crate::solve::direct::Analysis;
use crate::solve::factor_time_estimate::{rehearse, seconds_per_scalar};
use crate::solve::ordering::SiteGraph;
use crate::solve::statics::{MethodUsed, StaticError, expected_method};
use crate::solve::symbolic::FactorCost;
use crate::system::Symmetry;
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

/// Bytes per cell and point of the output while it is encoded: fields, their copy for the encoder, its text.
const OUTPUT_BYTES: u64 = 900;

/// Bytes per further corner of a point that is shown as a cell: its position and fields, their copy, its text.
const CORNER_BYTES: u64 = 250;

/// Bytes of the output while it is encoded.
pub(crate) fn output_bytes<const D: usize>(sizes: &Sizes, output: &Output<D>) -> u64 {
    let corners = match output.points {
        PointOutputSpec::Vertices => 0,
        PointOutputSpec::Cells => ((1 << D) - 1) * sizes.points as u64,
    };
    OUTPUT_BYTES * (sizes.cells + sizes.points) as u64 + CORNER_BYTES * corners
}

/// Bytes of a factorisation on two threads over those on one: two subtrees hold contribution blocks. Measured on the scenes
/// of `tests/check.rs`: 1.23 to 1.36 for Cholesky, whose factors are the smaller part, 1.0 to 1.15 for LU.
const CHOLESKY: f64 = 1.26;

/// As [`CHOLESKY`].
const LU: f64 = 1.1;

/// Bytes of a multigrid hierarchy and of the vectors of an iteration over those of the stiffness; measured 2.1 to 2.2.
const HIERARCHY: f64 = 2.1;

/// Bytes of program and buffers that a run touches after its model is laid out; measured.
pub(crate) const PROGRAM: u64 = 3_700_000;

/// Planned solution with a stiffness that is not assembled yet.
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
    /// Plans the solution of the system on free dofs of a pattern.
    ///
    /// # Errors
    /// [`RunError`] for a graph that cannot be ordered.
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

    /// Returns the items that hold memory beside the `laid_out` bytes of the model, and the most that is held at the same time.
    pub fn memory<const D: usize>(
        &self,
        laid_out: u64,
        sizes: &Sizes,
        output: &Output<D>,
    ) -> (Vec<Share>, u64) {
        let (stiffness, solver) = (self.stiffness, self.solver);
        let output_bytes = output_bytes(sizes, output);
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
        (memory, peak)
    }

    /// Returns true if the stiffness is factorised.
    fn is_factorised(&self) -> bool {
        matches!(self.method, MethodUsed::Cholesky | MethodUsed::Lu)
    }

    /// Adds the seconds of the solution: of a factorisation from parts of it that are tried here, of an iteration from what it reads.
    pub fn add_seconds(&self, symmetry: Symmetry, nonzeros: usize, timings: &mut Timings) {
        let cost = &self.cost;
        let threads = rayon::current_num_threads() as f64;
        if self.is_factorised() {
            let most = (0.1 * cost.flops / OPERATIONS / threads).clamp(0.01, REHEARSED);
            let told = rehearse(&self.analysis, symmetry, Duration::from_secs_f64(most));
            let product = nonzeros as f64 * seconds_per_scalar() / threads;
            timings.add("factorisation", told.factorisation);
            timings.add("solve", SUBSTITUTIONS * (told.substitution + product));
        } else {
            let pass = nonzeros as f64 * seconds_per_scalar() / threads;
            timings.add("iteration", PASSES * pass);
        }
    }

    /// Scalars in the factors; zero for an iterative method.
    pub fn factor_nonzeros(&self) -> u64 {
        if self.is_factorised() {
            self.cost.factor_nnz
        } else {
            0
        }
    }

    /// Operations of the factorisation; zero for an iterative method.
    pub fn operations(&self) -> f64 {
        if self.is_factorised() {
            self.cost.flops
        } else {
            0.0
        }
    }
}
