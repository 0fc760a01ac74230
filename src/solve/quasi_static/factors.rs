//! Factors of the tangent within a load step.

use std::sync::OnceLock;

use super::params::Refactor;
use crate::{
    progress::Silent,
    solve::{
        FreeDofs,
        direct::{Analysis, DirectInfo, DirectParams, Factor},
        krylov::LinearMap,
        ordering::SiteGraph,
        probes::Probes,
        statics::{StaticParams, StaticProblem},
    },
    system::{BlockCsr, ElementTangent, Symmetry},
};

/// Operations of a factorisation that take as long as one scalar of the factors takes in an iteration: dense kernels have 3e-11 s for each, and a substitution reads each scalar twice from memory.
const OPERATIONS: f64 = 60.0;

/// Factors of the sum of a stiffness and of what elements have beyond it at a displacement; all have one pattern, which is analysed once.
#[derive(Debug)]
pub struct TangentFactors<'a> {
    problem: StaticProblem<'a>,
    free: FreeDofs,
    params: StaticParams,
    analysis: OnceLock<Option<Analysis>>,
    probes: OnceLock<Probes>,
    worth: usize,
    /// The time of a product with the stiffness over that of an iteration.
    product: f64,
}

/// Relative increase of the diagonal of a tangent that broken bonds leave, so that pieces which nothing holds have factors too.
const RAISED: f64 = 1e-10;

impl<'a> TangentFactors<'a> {
    /// Of the stiffness of a problem, whose own factors are there: what they cost, `info` knows.
    pub fn new(problem: StaticProblem<'a>, params: StaticParams, info: &DirectInfo) -> Self {
        let scalars = (info.cost.factor_nnz as f64).max(1.0);
        let product = problem.stiffness.nonzeros() as f64;
        Self {
            free: FreeDofs::from_prescribed(problem.prescribed, problem.stiffness.block.max(1)),
            problem,
            params,
            analysis: OnceLock::new(),
            probes: OnceLock::new(),
            product: product / (product + 2.0 * scalars),
            worth: (info.cost.flops / (OPERATIONS * scalars)).round().max(1.0) as usize,
        }
    }
}

impl Refactor for TangentFactors<'_> {
    fn factors(&self, elements: &ElementTangent, symmetry: Symmetry) -> Option<Box<dyn LinearMap>> {
        self.factorised(&elements.added_to(self.problem.stiffness), symmetry)
    }

    fn worth(&self) -> usize {
        self.worth
    }

    fn factors_of(
        &self,
        tangent: &dyn LinearMap,
        symmetry: Symmetry,
    ) -> Option<Box<dyn LinearMap>> {
        let mut matrix = self.probes().matrix(self.problem.stiffness, tangent);
        matrix.raise_diagonal(RAISED);
        self.factorised(&matrix, symmetry)
    }

    fn worth_of_products(&self) -> usize {
        let products = self.probes().products(self.problem.stiffness.block);
        self.worth + (products as f64 * self.product).round() as usize
    }
}

impl TangentFactors<'_> {
    fn probes(&self) -> &Probes {
        (self.probes).get_or_init(|| Probes::new(self.problem.stiffness))
    }

    fn factorised(&self, matrix: &BlockCsr, symmetry: Symmetry) -> Option<Box<dyn LinearMap>> {
        let analysis = self.analysis.get_or_init(|| {
            let graph = SiteGraph::from_pattern(&matrix.row_offsets, &matrix.columns, &self.free);
            Analysis::of_graph(graph, self.problem.positions, self.params.ordering).ok()
        });
        let params = DirectParams {
            symmetry,
            smallest_pivot: 0.0,
            memory_limit: self.params.memory_limit,
        };
        let done = Factor::new(matrix, &self.free, analysis.clone()?, &params, &Silent);
        done.ok()
            .map(|(factor, _)| Box::new(factor) as Box<dyn LinearMap>)
    }
}
