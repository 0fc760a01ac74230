//! Static equilibrium of a model under its conditions: assembly, loads, supports, solution.

use super::budget;
use super::loads::{loads, supports};
use crate::coupling::{Coupling, Model, Operator};
use crate::observe::summary::{Applied, Choice, Stopwatch, Timings};
use crate::progress::Progress;
use crate::run::error::RunError;
use crate::scene::conditions::Condition;
use crate::scene::validated::Solver;
use crate::solve::statics::{self, StaticParams, StaticProblem, StaticSolution};
use crate::system::{BlockCsr, Symmetry};
use crate::tensor::padded;

/// A model at rest under its conditions, about to be solved.
pub(crate) struct At<'a, const D: usize> {
    pub model: &'a Model<D>,
    pub coupling: &'a dyn Coupling<D>,
    pub operator: &'a dyn Operator<D>,
    pub conditions: &'a [Condition<D>],
    pub solver: &'a Solver,
    /// The time at which conditions are taken.
    pub time: f64,
}

/// A model at rest, solved.
pub(crate) struct Equilibrium {
    pub stiffness: BlockCsr,
    pub symmetry: Symmetry,
    pub load: Vec<f64>,
    /// The force of each load.
    pub applied: Vec<Applied>,
    /// The condition that holds each dof.
    pub holder: Vec<Option<usize>>,
    pub solution: StaticSolution,
    /// What the symmetry of the matrix decided.
    pub choices: Vec<Choice>,
    pub timings: Timings,
}

/// Assembles, hands the stiffness to `prove`, which tells the seconds that it took, and solves.
///
/// # Errors
/// [`RunError`] for a condition that meets no site, and for a system without a solution.
pub(crate) fn equilibrium<const D: usize>(
    at: &At<'_, D>,
    mut timings: Timings,
    prove: impl FnOnce(&BlockCsr) -> Result<f64, RunError>,
    progress: &dyn Progress,
) -> Result<Equilibrium, RunError> {
    let mut watch = Stopwatch::start();
    let model = at.model;
    let stiffness = model.assemble(at.operator, progress);
    watch.lap(&mut timings, "assembly");
    let (load, applied) = loads(model, at.conditions, at.time)?;
    let (prescribed, holder) = supports(model, at.conditions, at.time)?;
    let positions: Vec<[f64; 3]> = model.sites.iter().map(|s| padded(&s.position)).collect();
    let mut choices = Vec::new();
    let symmetry = symmetry(at.coupling, || stiffness.asymmetry(), &mut choices);
    watch.lap(&mut timings, "conditions");
    timings.add("proof", prove(&stiffness)?);
    let solution = statics::solve(
        &StaticProblem {
            stiffness: &stiffness,
            symmetry,
            positions: &positions,
            load: &load,
            prescribed: &prescribed,
        },
        &params(at.solver),
        progress,
    )?;
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
        choices,
        timings,
    })
}

/// What the solver is asked for, with the memory that is left to it.
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
    choices: &mut Vec<Choice>,
) -> Symmetry {
    const ROUND_OFF: f64 = 1e-12;
    if coupling.symmetry() == Symmetry::Symmetric {
        let asymmetry = asymmetry();
        if asymmetry <= ROUND_OFF {
            return Symmetry::Symmetric;
        }
        choices.push(Choice {
            choice: "unsymmetric solver".to_owned(),
            why: format!("the stiffness differs from its transpose by {asymmetry:.1e}"),
        });
    }
    Symmetry::Unsymmetric
}
