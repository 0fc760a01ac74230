//! Preconditioners of Newton's method in load steps: factors of one process, or of several, of which each holds its part, or multigrid.

use std::sync::{Mutex, PoisonError};

use super::newton_factors::{CoarsenedStiffness, NewtonFactors, RAISED};
use crate::observe::summary::{Decision, Stopwatch, Timings};
use crate::progress::Progress;
use crate::run::condition_terms::ConditionTerms;
use crate::run::error::RunError;
use crate::run::loads;
use crate::run::setup::RunSettings;
use crate::solve::krylov::LinearMap;
use crate::solve::quasi_static::{Equilibrium, TangentFactors};
use crate::solve::statics::{Method, StaticError};
use crate::system::{
    BlockCsr, Partition, RankRows, RankSolver, RankSolverKind, Ranks, Spread, SpringRows, Symmetry,
};
use crate::tensor::padded;
use crate::{
    coupling::Operator,
    model::{Distribution, Model},
};

/// Preconditioner of Newton's method: factors of this process, factors over all, multigrid, or nothing.
pub(super) struct Leads<'a> {
    own: Option<NewtonFactors>,
    spread: Option<SpreadStiffness<'a>>,
    coarsened: Option<CoarsenedStiffness>,
}

impl<'a> Leads<'a> {
    /// Nothing beside other methods than Newton's.
    ///
    /// # Errors
    /// Those of [`NewtonFactors::new`] and [`SpreadStiffness::new`].
    pub fn new<const D: usize>(
        (model, operator, terms): (&Model<D>, &Operator<'_, D>, &ConditionTerms),
        (symmetry, equilibrium): (Symmetry, Equilibrium),
        (rest, ranks): (&RunSettings<D>, Option<&'a dyn Ranks>),
        choices: &mut Vec<Decision>,
        progress: &dyn Progress,
    ) -> Result<Self, RunError> {
        let (mut own, mut spread, mut coarsened) = (None, None, None);
        if equilibrium == Equilibrium::Newton {
            let body = (model, operator, &terms.rows);
            spread = SpreadStiffness::new(body, symmetry, rest, ranks, choices, progress)?;
            if spread.is_none() {
                let body = (model, operator, terms);
                own = NewtonFactors::new(body, symmetry, rest, choices, progress)?;
                coarsened = CoarsenedStiffness::new(body, symmetry, rest, choices, progress)?;
            }
        }
        Ok(Self {
            own,
            spread,
            coarsened,
        })
    }

    /// Collective: makes the factors over all processes, or multigrid, which borrow from this.
    ///
    /// # Errors
    /// Those of the solver.
    pub fn made(
        &self,
        progress: &dyn Progress,
    ) -> Result<Option<Box<dyn LinearMap + '_>>, RunError> {
        if let Some(spread) = &self.spread {
            return Ok(Some(Box::new(spread.factorised()?)));
        }
        let coarsened = self.coarsened.as_ref();
        let made = coarsened.and_then(|coarsened| coarsened.multigrid(progress));
        Ok(made.map(|multigrid| Box::new(multigrid) as Box<dyn LinearMap + '_>))
    }

    /// Counts the time since the last lap as that of the factorisation, or of the hierarchy, if there was one.
    pub fn time(&self, watch: &mut Stopwatch, timings: &mut Timings) {
        if self.own.is_some() || self.spread.is_some() {
            watch.lap(timings, "factorisation");
        } else if self.coarsened.is_some() {
            watch.lap(timings, "multigrid set-up");
        }
    }

    /// Returns the approximate inverse that preconditions, if there is one; `made` is that of [`Leads::made`].
    pub fn lead<'b>(&'b self, made: Option<&'b dyn LinearMap>) -> Option<&'b dyn LinearMap> {
        let own = self.own.as_ref().map(|own| &own.factor as &dyn LinearMap);
        own.or(made)
    }

    /// Returns the factorisation of tangents at a displacement, of this process alone.
    pub fn of_present_tangents(&self) -> Option<TangentFactors<'_>> {
        self.own.as_ref()?.of_present_tangents()
    }
}

/// The rows of the stiffness, before bonds break, of a process's own sites.
struct SpreadStiffness<'a> {
    ranks: &'a dyn Ranks,
    partition: Partition,
    matrix: BlockCsr,
    symmetry: Symmetry,
    positions: Vec<[f64; 3]>,
    prescribed: Vec<bool>,
}

impl<'a> SpreadStiffness<'a> {
    /// None where one process computes alone, or factors are not asked for by `solver.method = "direct"`: without, all processes have the same factors, and the bits of one.
    ///
    /// # Errors
    /// [`RunError`] for supports that meet no site.
    fn new<const D: usize>(
        (model, operator, terms): (&Model<D>, &Operator<'_, D>, &SpringRows),
        symmetry: Symmetry,
        rest: &RunSettings<D>,
        ranks: Option<&'a dyn Ranks>,
        choices: &mut Vec<Decision>,
        progress: &dyn Progress,
    ) -> Result<Option<Self>, RunError> {
        let ranks = ranks.filter(|ranks| ranks.count() > 1 && rest.solver.method == Method::Direct);
        let Some(ranks) = ranks else {
            return Ok(None);
        };
        let Distribution { partition, why } = model.distribute(ranks.count(), false, Some(ranks));
        let own = partition.of(ranks.rank());
        let mut matrix = model.assemble_sites(operator, own, progress);
        if !terms.is_empty() {
            matrix = terms.added(&matrix, own);
        }
        matrix.raise_diagonal_of(|row| own[row], RAISED);
        let (prescribed, _) = loads::supports(model, &rest.conditions, 0.0)?;
        choices.push(Decision {
            choice: "factors of the stiffness before bonds break lead the iteration".to_owned(),
            why: format!("solver.method = \"direct\": each process has a part of them, its sites are distributed by {why}"),
        });
        Ok(Some(Self {
            ranks,
            matrix,
            symmetry,
            positions: model.sites.iter().map(|s| padded(&s.position)).collect(),
            prescribed: prescribed.iter().map(Option::is_some).collect(),
            partition,
        }))
    }

    /// Collective: the factors.
    ///
    /// # Errors
    /// [`StaticError::Ranks`].
    fn factorised(&self) -> Result<SpreadFactors<'_>, RunError> {
        let rows = RankRows {
            matrix: &self.matrix,
            partition: &self.partition,
            symmetry: self.symmetry,
            positions: &self.positions,
            prescribed: &self.prescribed,
        };
        let solver = self.ranks.solver(rows, RankSolverKind::Direct);
        let solver = solver.map_err(|message| StaticError::Ranks { message })?;
        Ok(SpreadFactors {
            spread: Spread {
                ranks: self.ranks,
                partition: &self.partition,
            },
            solver: Mutex::new(solver),
        })
    }
}

/// Factors of which each process has a part, as a map of the numbers of all sites.
struct SpreadFactors<'a> {
    spread: Spread<'a>,
    solver: Mutex<Box<dyn RankSolver + 'a>>,
}

impl LinearMap for SpreadFactors<'_> {
    /// Collective.
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        let own = self.spread.take_own(x);
        let mut solved = vec![0.0; own.len()];
        let mut solver = self.solver.lock().unwrap_or_else(PoisonError::into_inner);
        // factors take one substitution, whatever the tolerance
        let done = solver.solve_into(&own, &mut solved, 1e-12, 1);
        if done.failure.is_some() {
            // not a number: the iteration that they lead tells of it
            solved.fill(f64::NAN);
        }
        self.spread.gather_sites(&solved, y);
    }
}
