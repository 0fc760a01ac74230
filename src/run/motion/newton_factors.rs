//! The factors, or the multigrid, that precondition Newton's method in load steps.

use crate::observe::summary::Decision;
use crate::progress::Progress;
use crate::run::condition_terms::ConditionTerms;
use crate::run::error::RunError;
use crate::run::setup::RunSettings;
use crate::run::{equilibrium, loads};
use crate::solve::FreeDofs;
use crate::solve::direct::{DirectInfo, Factor};
use crate::solve::multigrid::Multigrid;
use crate::solve::quasi_static::TangentFactors;
use crate::solve::statics::{self, StaticParams, StaticProblem};
use crate::system::{BlockCsr, Symmetry};
use crate::tensor::padded;
use crate::{coupling::Operator, model::Model};

/// Relative increase of the diagonal of the stiffness, so that pieces that nothing holds have factors too: far above round-off, and too little to
/// cost an iteration.
pub(super) const RAISED: f64 = 1e-10;

/// The stiffness before bonds break, with its diagonal raised.
fn raised<const D: usize>(
    (model, operator, terms): (&Model<D>, &Operator<'_, D>, &ConditionTerms),
    progress: &dyn Progress,
) -> BlockCsr {
    let mut stiffness = model.assemble(operator, progress);
    terms.rows.add_to(&mut stiffness);
    stiffness.raise_diagonal(RAISED);
    stiffness
}

/// The stiffness before bonds break, to precondition Newton's method by multigrid.
pub(super) struct CoarsenedStiffness {
    matrix: BlockCsr,
    free: FreeDofs,
    positions: Vec<[f64; 3]>,
}

impl CoarsenedStiffness {
    /// None but where `[solver]` asks for an iteration.
    ///
    /// # Errors
    /// [`RunError`] for supports that meet no site.
    pub fn new<const D: usize>(
        body: (&Model<D>, &Operator<'_, D>, &ConditionTerms),
        symmetry: Symmetry,
        rest: &RunSettings<D>,
        choices: &mut Vec<Decision>,
        progress: &dyn Progress,
    ) -> Result<Option<Self>, RunError> {
        let model = body.0;
        if !equilibrium::may_coarsen(model, rest.solver.method, symmetry) {
            return Ok(None);
        }
        let (prescribed, _) = loads::supports(model, &rest.conditions, 0.0)?;
        choices.push(Decision {
            choice: "multigrid of the stiffness before bonds break leads the iteration".to_owned(),
            why: "solver.method = \"krylov\"".to_owned(),
        });
        Ok(Some(Self {
            matrix: raised(body, progress),
            free: FreeDofs::from_prescribed(&prescribed, D),
            positions: model.sites.iter().map(|s| padded(&s.position)).collect(),
        }))
    }

    /// Its hierarchy; none where it has none.
    pub fn multigrid(&self, progress: &dyn Progress) -> Option<Multigrid<'_>> {
        statics::multigrid(&self.matrix, &self.free, &self.positions, progress)
    }
}

/// Factors of the stiffness before bonds break.
pub(super) struct NewtonFactors {
    pub factor: Factor,
    info: DirectInfo,
    /// The stiffness, if elements know their tangent at a displacement, or bonds may break: other tangents are then factorised too.
    stiffness: Option<BlockCsr>,
    symmetry: Symmetry,
    positions: Vec<[f64; 3]>,
    prescribed: Vec<Option<f64>>,
    params: StaticParams,
}

impl NewtonFactors {
    /// None where `[solver]` asks for an iteration, or `"auto"` finds factors too costly.
    ///
    /// # Errors
    /// [`RunError`] for supports that meet no site, and for factors that are asked for and do not fit.
    pub fn new<const D: usize>(
        (model, operator, terms): (&Model<D>, &Operator<'_, D>, &ConditionTerms),
        symmetry: Symmetry,
        rest: &RunSettings<D>,
        choices: &mut Vec<Decision>,
        progress: &dyn Progress,
    ) -> Result<Option<Self>, RunError> {
        let params = equilibrium::params(&rest.solver);
        if !equilibrium::may_factorise(model, params.method, symmetry) {
            return Ok(None);
        }
        let (prescribed, _) = loads::supports(model, &rest.conditions, 0.0)?;
        let positions: Vec<[f64; 3]> = model.sites.iter().map(|s| padded(&s.position)).collect();
        let stiffness = raised((model, operator, terms), progress);
        let problem = StaticProblem {
            stiffness: &stiffness,
            symmetry,
            positions: &positions,
            load: &[],
            prescribed: &prescribed,
        };
        let Some((factor, info)) = statics::factors(&problem, &params, progress)? else {
            return Ok(None);
        };
        choices.push(Decision {
            choice: "factors of the stiffness before bonds break lead the iteration".to_owned(),
            why: format!(
                "{:.1} MB, {:.1e} operations once; solver.method = \"krylov\" takes multigrid instead",
                factor.bytes() as f64 * 1e-6,
                info.cost.flops
            ),
        });
        // impactors are no sites of the stiffness
        let touches = rest.breaking.contact.is_some();
        let changes = touches || rest.has_nonlinear_elements(model) || rest.breaking.breaks();
        let is_kept = changes && rest.impactors.is_empty();
        Ok(Some(Self {
            stiffness: is_kept.then_some(stiffness),
            factor,
            info,
            symmetry,
            positions,
            prescribed,
            params,
        }))
    }

    /// Returns the factorisation of tangents at a displacement and of those that broken bonds leave; none without nonlinear elements or breaking bonds, and none with impactors.
    pub fn of_present_tangents(&self) -> Option<TangentFactors<'_>> {
        let problem = StaticProblem {
            stiffness: self.stiffness.as_ref()?,
            symmetry: self.symmetry,
            positions: &self.positions,
            load: &[],
            prescribed: &self.prescribed,
        };
        Some(TangentFactors::new(problem, self.params, &self.info))
    }
}

#[cfg(test)]
#[path = "newton_factors_tests.rs"]
mod tests;
