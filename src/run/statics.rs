//! From a static scene to its solution.

use super::bonds;
use super::chosen::with_choice;
use super::conduction::heated_problem;
use super::equilibrium::{Assembled, Equilibrium, StaticInput, equilibrium};
use super::motion::{self, RunOptions};
use super::proof::{self, Subject};
use super::rotation::Rotations;
use super::sections::Sections;
use super::setup::{RunSettings, model_choices, same_everywhere, shared_model, sizes};
use super::solution::{Moved, Solved, zone_of_site};
use super::static_contact::with_contact;
use super::zone_placement::{CachedSolution, difference_from_elements};
use crate::run::placed_scene::PlacedScene;
use std::path::PathBuf;
use std::sync::Arc;

use crate::coupling::semidiscrete::CoupledSystem;
use crate::dimension;
use crate::observe::ObserveError;
use crate::observe::proof::Proof;
use crate::observe::summary::{
    ConditionForce, Decision, Rotation, RunSummary, SectionForce, Sizes, Stopwatch, Timings,
    peak_memory_bytes,
};
use crate::observe::warning::Warning;
use crate::progress::Progress;
use crate::run::balance::{Balance, furthest, round_off};
use crate::run::definiteness;
use crate::run::energy_release;
use crate::run::error::RunError;
use crate::run::linear_parts::{LinearParts, Passed, RunKind};
use crate::run::surface_gradient::{Asked, steep_stresses};
use crate::run::warnings::{Imbalance, indefinite, of_elements, out_of_balance, warnings};
use crate::scene::spec::{CouplingTraits, ElementsSpec, UnprovenSpec};
use crate::scene::validated::{Output, Scene};
use crate::solve::krylov::LinearMap;
use crate::solve::statics::MethodUsed;
use crate::system::{Ranks, SemiDiscrete, Symmetry};
use crate::tensor::Vector;
use crate::{
    coupling::{Coupling, Operator, Problem},
    model::Model,
};

/// Solves a static scene and writes its outputs.
///
/// # Errors
/// [`RunError`], each with place and remedy.
pub(super) fn run<const D: usize>(
    scene: PlacedScene<D>,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    solve_over(scene, options.ranks, progress, &mut |output, solved| {
        super::write::write_for(output, solved, options)
    })
}

/// Solves a static scene and hands the solution to `visit`, which returns the files that it wrote.
///
/// # Errors
/// [`RunError`], each with place and remedy.
pub fn solve_with<const D: usize>(
    scene: impl Into<PlacedScene<D>>,
    progress: &dyn Progress,
    visit: impl FnOnce(&Output<D>, &Solved<'_, D>) -> Result<Vec<PathBuf>, ObserveError>,
) -> Result<RunSummary, RunError> {
    let mut visit = Some(visit);
    let mut visit = |output: &Output<D>, solved: &Solved<'_, D>| match visit.take() {
        Some(visit) => visit(output, solved),
        // a solved scene is not solved again
        None => Ok(Vec::new()),
    };
    dimension::of::<Solver<D>>(&SOLVERS)(scene.into(), None, progress, &mut visit)
}

/// Consumer of a solution; returns the files that it wrote.
type Visit<'a, const D: usize> =
    &'a mut dyn FnMut(&Output<D>, &Solved<'_, D>) -> Result<Vec<PathBuf>, ObserveError>;

type Solver<const D: usize> = fn(
    PlacedScene<D>,
    Option<&dyn Ranks>,
    &dyn Progress,
    Visit<'_, D>,
) -> Result<RunSummary, RunError>;

static SOLVERS: (Solver<1>, Solver<2>, Solver<3>) = (solve_over, solve_over, solve_over);

/// As [`solve_with`], by several processes, if there are.
fn solve_over<const D: usize>(
    scene: PlacedScene<D>,
    ranks: Option<&dyn Ranks>,
    progress: &dyn Progress,
    visit: Visit<'_, D>,
) -> Result<RunSummary, RunError> {
    let PlacedScene { scene, mut kept } = scene;
    with_choice(scene, |scene| {
        // what placed the zone knows of linear elements only
        let kept = kept
            .take()
            .filter(|_| scene.elements == ElementsSpec::Linear)
            // whose stiffness has the springs in it, and is not that of the body
            .filter(|k| k.equilibrium.terms.is_empty());
        solve_chosen(scene, kept, ranks, progress, &mut *visit)
    })
}

/// Lays out, proves, solves and summarises a static scene whose mesh and zones are known.
// One function: the stages of a static scene, in the order in which it passes them.
fn solve_chosen<const D: usize>(
    scene: Scene<D>,
    kept: Option<Arc<CachedSolution<D>>>,
    ranks: Option<&dyn Ranks>,
    progress: &dyn Progress,
    visit: Visit<'_, D>,
) -> Result<RunSummary, RunError> {
    let (mut timings, mut watch) = (Timings::default(), Stopwatch::start());
    let (name, traits) = (scene.title.clone(), scene.coupling.traits());
    let counts = [scene.mesh.nodes.len(), scene.mesh.cell_count()];
    if let Some(placement) = &scene.placement {
        timings.add("placing the zone", placement.seconds);
    }
    let (problem, rest) = heated_problem(scene, (&mut timings, &mut watch), progress)?;
    same_everywhere(&rest, 0, ranks)?;
    let fresh;
    let (model, coupling) = match &kept {
        Some(k) => (&k.model, k.coupling.as_ref()),
        None => {
            fresh = laid_out(problem, &rest, ranks, progress)?;
            (&fresh.0, fresh.1.as_ref())
        }
    };
    bonds::check(model, &rest.output, ranks)?;
    watch.lap(&mut timings, "sites and bonds");
    let operator = coupling.operator(model)?;
    let mut choices: Vec<Decision> = rest.made().cloned().collect();
    let rows = (model, &operator, ranks);
    definiteness::check(rows, rest.ratio, &mut choices, progress)?;
    watch.lap(&mut timings, "assembly");
    let mut system = motion::dynamic_system::still(model, &operator, &rest, false)?;
    let body = StaticBody {
        model,
        coupling,
        operator: &operator,
        rest: &rest,
        ranks,
        has_exact_seam: system.as_ref().is_some_and(CoupledSystem::has_seam_bonds),
    };
    // what placed the zone was solved with linear forces
    let cached = kept.as_ref().filter(|_| system.is_none());
    let moving = system.as_mut().map(|s| s as &mut dyn SemiDiscrete);
    let computed;
    let (equilibrium, proof) = match cached.map(|known| &known.equilibrium) {
        Some(known) => (known, body.prove_cached(known, &mut timings, progress)?),
        None => {
            let (solved, proof) = body.solve(moving, &mut timings, progress)?;
            computed = solved;
            (&computed, proof)
        }
    };
    let told = (&mut timings, &mut choices);
    let apart = with_contact((&body.input(), &rest), equilibrium, told, progress)?;
    let equilibrium = apart.equilibrium.as_ref().unwrap_or(equilibrium);
    let system = match apart.equilibrium {
        Some(_) => system.and(apart.system),
        None => system,
    };
    watch = Stopwatch::start();
    choices.extend(body.told(equilibrium));
    let residual = equilibrium.residual();
    let sections = body.section_forces(&residual, &equilibrium.solution.displacement)?;
    let solved = Solved {
        model,
        operator: &operator,
        displacement: &equilibrium.solution.displacement,
        residual: &residual,
        zone_of_site: &zone_of_site(model),
        system: system.as_ref().map(|s| s as &dyn SemiDiscrete),
        moved: Moved::default(),
        sections: &sections,
        stresses: (&rest.stresses, 0.0),
    };
    let told = body.summary(equilibrium, traits, proof)?;
    let tips = energy_release::at_rest(&solved, &rest.output, ranks)?;
    let files = visit(&rest.output, &solved)?;
    watch.lap(&mut timings, "output");
    progress.finish();
    let mut summary = RunSummary {
        tips,
        scene: name,
        sizes: body.sizes(counts, equilibrium.solution.info.matrix_nnz),
        choices,
        total_seconds: timings.total(),
        timings,
        peak_memory_bytes: peak_memory_bytes(),
        files,
        sections,
        ..told
    };
    summary.warnings.extend(apart.warning);
    Ok(summary)
}

/// The model of a static scene; collective, with its families spread over processes where they can be.
///
/// # Errors
/// [`RunError::Model`] for one that cannot be laid out.
fn laid_out<const D: usize>(
    problem: Problem<D>,
    rest: &RunSettings<D>,
    ranks: Option<&dyn Ranks>,
    progress: &dyn Progress,
) -> Result<(Model<D>, Box<dyn Coupling<D>>), RunError> {
    let holders = motion::holders_at_rest(ranks, &problem, rest);
    shared_model(problem, rest, holders, progress)
}

/// A model with its rows and conditions, about to be solved.
pub(crate) struct StaticBody<'a, const D: usize> {
    pub model: &'a Model<D>,
    pub coupling: &'a dyn Coupling<D>,
    pub operator: &'a Operator<'a, D>,
    pub rest: &'a RunSettings<D>,
    pub ranks: Option<&'a dyn Ranks>,
    /// True if bonds of the seam are geometrically exact like others.
    pub has_exact_seam: bool,
}

impl<'a, const D: usize> StaticBody<'a, D> {
    /// Proves a model by its stiffness before it is solved; returns the proof, and its seconds.
    ///
    /// # Errors
    /// [`RunError::Unproven`] for a proof that refuses the model.
    pub fn prove(
        &self,
        assembled: &Assembled<'_>,
        progress: &dyn Progress,
    ) -> Result<(Proof, f64), RunError> {
        let mut clock = Stopwatch::start();
        let mut taken = Timings::default();
        let proof = proof::prove(
            &Subject {
                model: self.model,
                coupling: self.coupling,
                operator: self.operator,
                rest: self.rest,
                stiffness: match assembled {
                    Assembled::Whole(stiffness) => Some(stiffness),
                    Assembled::Spread(_) => None,
                },
                product: &|u, force| match assembled {
                    Assembled::Whole(stiffness) => stiffness.multiply_into(u, force),
                    Assembled::Spread(rows) => rows.apply_into(u, force),
                },
                system: None,
                ranks: self.ranks,
            },
            progress,
        )?;
        proof::hold(&proof)?;
        clock.lap(&mut taken, "proof");
        Ok((proof, taken.total()))
    }

    /// Proves an equilibrium that is known already.
    fn prove_cached(
        &self,
        known: &Equilibrium,
        timings: &mut Timings,
        progress: &dyn Progress,
    ) -> Result<Proof, RunError> {
        let (proof, seconds) = self.prove(&Assembled::Whole(&known.stiffness), progress)?;
        known.timings.add_to(timings);
        timings.add("proof", seconds);
        Ok(proof)
    }

    /// The model under its conditions.
    fn input(&self) -> StaticInput<'a, D> {
        StaticInput {
            model: self.model,
            coupling: self.coupling,
            operator: self.operator,
            conditions: &self.rest.conditions,
            solver: &self.rest.solver,
            time: 0.0,
            ranks: self.ranks,
            thermal: self.rest.stresses.thermal.as_ref(),
        }
    }

    /// Assembles, proves and solves; `system` has the forces that are not linear, if any are not.
    ///
    /// # Errors
    /// [`RunError`] for a condition that meets no site, a proof that refuses the model, a system without a solution.
    fn solve(
        &self,
        system: Option<&mut dyn SemiDiscrete>,
        timings: &mut Timings,
        progress: &dyn Progress,
    ) -> Result<(Equilibrium, Proof), RunError> {
        let mut proof = Proof::default();
        let prove = |assembled: &Assembled<'_>| {
            let (found, seconds) = self.prove(assembled, progress)?;
            proof = found;
            Ok(seconds)
        };
        let solved = equilibrium(&self.input(), system, Timings::default(), prove, progress)?;
        solved.timings.add_to(timings);
        Ok((solved, proof))
    }

    /// Decisions made up to an equilibrium, and the properties of the model.
    fn told(&self, equilibrium: &Equilibrium) -> Vec<Decision> {
        let info = &equilibrium.solution.info;
        let made = self.decisions(info.method, equilibrium.symmetry, info.free_dofs);
        equilibrium.choices.iter().cloned().chain(made).collect()
    }

    /// Decisions made for the solution, and the properties of the model.
    pub fn decisions(
        &self,
        method: MethodUsed,
        symmetry: Symmetry,
        unknowns: usize,
    ) -> Vec<Decision> {
        let mut choices: Vec<_> = self.rest.nonlinear(self.model).into_iter().collect();
        choices.push(Decision {
            choice: method.name().to_owned(),
            why: format!("{} system of {unknowns} unknowns", symmetry.name()),
        });
        choices.extend(model_choices(self.model));
        choices.extend(bonds::told(self.model, &self.rest.output));
        choices
    }

    /// Summary of the solution: forces, energy, rotation, warnings.
    ///
    /// # Errors
    /// [`RunError::Fracture`] for a fracture energy that gives no stretch, [`RunError::Unproven`] for a seam out of balance whose displacements are wrong by more than themselves.
    fn summary(
        &self,
        equilibrium: &Equilibrium,
        traits: CouplingTraits,
        proof: Proof,
    ) -> Result<RunSummary, RunError> {
        let solution = &equilibrium.solution;
        let info = &solution.info;
        let rotations = Rotations::new(self.model, self.rest, None, self.ranks);
        let rotation = rotations
            .largest(&solution.displacement)
            .and_then(|r| rotations.told(r.degrees, r.place, 0.0, 0.0, None));
        let reactions = &equilibrium.solution.reactions;
        let balance = Balance::<D>::of(&equilibrium.internal, &equilibrium.load, reactions);
        let (force, relative) = (balance.force.as_slice(), balance.relative());
        let mut told = warnings(self.model, traits, &proof);
        told.extend(of_elements(
            self.model,
            &self.model.local_laws(&self.rest.local_laws),
        ));
        told.extend(indefinite(equilibrium.symmetry, info.method));
        told.extend(rotation.as_ref().map(Rotation::warning));
        told.extend(self.passed(&solution.displacement)?);
        // what is left of the forces of a body that only turns is round-off
        let least = round_off(self.model, furthest(&solution.displacement));
        if balance.scale > least {
            let known = self.imbalance(&balance, &solution.displacement);
            let warning = out_of_balance(&known, traits);
            let is_hopeless = known.difference.is_some_and(|part| part > 1.0);
            if let Some(warning) = warning.clone().filter(|_| is_hopeless)
                && self.rest.solver.unproven == UnprovenSpec::Refuse
            {
                return Err(RunError::Unproven {
                    message: warning.message,
                    place: Vec::new(),
                });
            }
            told.extend(warning);
        }
        let stresses = &self.rest.stresses;
        // strains of free expansion are no stress
        if stresses.thermal.is_none() {
            let asked = Asked {
                stresses,
                displacement: &solution.displacement,
                uniform: proof.largest("stress error"),
            };
            told.extend(steep_stresses(self.model, self.ranks, &asked));
        }
        Ok(RunSummary {
            dimension: D,
            coupling: traits.name.to_owned(),
            warnings: told,
            proof,
            rotation,
            iterations: info.iterations,
            factor_nonzeros: info.factor_nnz,
            residual: info.relative_residual,
            out_of_balance_force: force.to_vec(),
            out_of_balance_relative: relative,
            applied: equilibrium.applied.clone(),
            reactions: self.reactions(equilibrium),
            energy: equilibrium.energy,
            ..RunSummary::default()
        })
    }

    /// Returns the imbalance of forces; with the difference from a solution by elements alone where the imbalance is warned of.
    fn imbalance<'b>(&self, balance: &'b Balance<D>, u: &[f64]) -> Imbalance<'b> {
        let known = Imbalance {
            force: balance.force.as_slice(),
            relative: balance.relative(),
            difference: None,
        };
        let expands = self.rest.stresses.thermal.is_some();
        let asks = known.is_told() && !expands && self.ranks.is_none();
        let difference = || difference_from_elements(self.model, self.rest, u);
        Imbalance {
            difference: asks.then(difference).flatten(),
            ..known
        }
    }

    /// Warnings of parts that are linear beyond the linear range of their material, or stay whole where it would break.
    ///
    /// # Errors
    /// [`RunError::Fracture`] for a fracture energy that gives no stretch.
    fn passed(&self, u: &[f64]) -> Result<Vec<Warning>, RunError> {
        let how = (RunKind::Static, self.has_exact_seam);
        let parts = LinearParts::new(self.model, self.operator, self.rest, how, self.ranks)?;
        let mut passed = Passed::default();
        parts.look(u, (0, 0.0), &mut passed);
        Ok(parts.told(&passed, 0.0).collect())
    }

    /// Forces in the sections that the scene asks for.
    ///
    /// # Errors
    /// [`RunError::EmptySection`].
    fn section_forces(&self, residual: &[f64], u: &[f64]) -> Result<Vec<SectionForce>, RunError> {
        let sections = Sections::new(self.model, self.rest)?;
        Ok(sections.forces(residual, u, 0.0))
    }

    /// Sizes of a model whose mesh has so many nodes and cells.
    pub fn sizes(&self, [nodes, cells]: [usize; 2], nonzeros: usize) -> Sizes {
        Sizes {
            nodes,
            cells,
            nonzeros,
            ..sizes(self.model, self.operator)
        }
    }

    /// The force of each condition that holds dofs.
    fn reactions(&self, equilibrium: &Equilibrium) -> Vec<ConditionForce> {
        let conditions = &self.rest.conditions;
        let mut reactions = vec![Vector::<D>::zeros(); conditions.len()];
        for (dof, holder) in equilibrium.holder.iter().enumerate() {
            if let Some(condition) = holder {
                reactions[*condition][dof % D] += equilibrium.solution.reactions[dof];
            }
        }
        conditions
            .iter()
            .zip(&reactions)
            .filter(|(c, _)| c.holds())
            .map(|(c, r)| ConditionForce {
                condition: c.name.clone(),
                force: r.iter().copied().collect(),
            })
            .chain(
                equilibrium
                    .terms
                    .reactions::<D>(&equilibrium.solution.displacement),
            )
            .collect()
    }
}
