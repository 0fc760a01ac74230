//! From a validated scene to its solution: the only place where scene, core, solver and observers meet.

use super::chosen::with_choice;
use super::equilibrium::{Equilibrium, StaticInput, equilibrium};
use super::motion::{self, RunOptions};
use super::proof::{self, Subject};
use super::rotation::Rotations;
use super::setup::{problem, volumes_choice};
use super::solution::{Solved, zone_of_site};
use super::zone_placement::CachedSolution;
use crate::run::placed_scene::PlacedScene;
use std::sync::Arc;

use crate::coupling::{Model, SiteKind};
use crate::observe::ObserveError;
use crate::observe::proof::Proof;
use crate::observe::summary::{
    Decision, Reaction, Rotation, RunSummary, Sizes, Stopwatch, Timings, peak_memory_bytes,
};
use crate::progress::Progress;
use crate::run::definiteness;
use crate::run::error::RunError;
use crate::run::warnings::{indefinite, out_of_balance, warnings};
use crate::scene::solve::Solve;
use crate::scene::validated::{Output, Scene};
use crate::system::{BlockCsr, SemiDiscrete};
use crate::tensor::Vector;

/// Runs a scene and writes its outputs.
///
/// # Errors
/// [`RunError`], each with place and remedy.
pub(crate) fn run<const D: usize>(
    scene: PlacedScene<D>,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    let moves = scene.solve != Solve::Static;
    let claim = || scene.output.claim(&scene.title, moves);
    let _claim = options.writes().then(claim).transpose()?;
    if moves {
        return with_choice(scene.scene, |scene| motion::run(scene, options, progress));
    }
    solve_with(scene, progress, |output, solved| {
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
    visit: impl FnOnce(&Output<D>, &Solved<'_, D>) -> Result<Vec<std::path::PathBuf>, ObserveError>,
) -> Result<RunSummary, RunError> {
    let mut visit = Some(visit);
    let PlacedScene { scene, mut kept } = scene.into();
    with_choice(scene, |scene| {
        solve_chosen(scene, kept.take(), progress, |output, solved| {
            match visit.take() {
                Some(visit) => visit(output, solved),
                // a solved scene is not solved again
                None => Ok(Vec::new()),
            }
        })
    })
}

fn solve_chosen<const D: usize>(
    scene: Scene<D>,
    kept: Option<Arc<CachedSolution<D>>>,
    progress: &dyn Progress,
    visit: impl FnOnce(&Output<D>, &Solved<'_, D>) -> Result<Vec<std::path::PathBuf>, ObserveError>,
) -> Result<RunSummary, RunError> {
    let mut timings = Timings::default();
    let mut watch = Stopwatch::start();
    let name = scene.title.clone();
    let joining = scene.coupling.joining();
    let (cells, nodes) = (scene.mesh.cell_count(), scene.mesh.nodes.len());
    if let Some(placement) = &scene.placement {
        timings.add("placing the zone", placement.seconds);
    }
    let (problem, rest) = problem(scene);
    let fresh;
    let (model, coupling) = match &kept {
        Some(k) => (&k.model, k.coupling.as_ref()),
        None => {
            fresh = Model::new(problem, progress)?;
            (&fresh.0, fresh.1.as_ref())
        }
    };
    watch.lap(&mut timings, "sites and bonds");
    let operator = coupling.operator(model)?;
    let mut choices: Vec<Decision> = rest.made().cloned().collect();
    definiteness::check(model, operator.as_ref(), rest.ratio, &mut choices, progress)?;
    watch.lap(&mut timings, "assembly");
    let mut proof = Proof::default();
    let mut prove = |stiffness: &BlockCsr| -> Result<f64, RunError> {
        let mut clock = Stopwatch::start();
        let mut taken = Timings::default();
        proof = proof::prove(
            &Subject {
                model,
                coupling,
                operator: operator.as_ref(),
                rest: &rest,
                stiffness: Some(stiffness),
                system: None,
                affine_forces: &[],
            },
            progress,
        )?;
        proof::hold(&proof)?;
        clock.lap(&mut taken, "proof");
        Ok(taken.total())
    };
    let mut system = motion::dynamic_system::still(model, coupling, operator.as_ref(), &rest)?;
    let is_linear = system.is_none();
    let computed;
    // what placed the zone was solved with linear forces
    let equilibrium = match kept.as_ref().filter(|_| is_linear) {
        Some(k) => {
            let seconds = prove(&k.equilibrium.stiffness)?;
            k.equilibrium.timings.add_to(&mut timings);
            timings.add("proof", seconds);
            &k.equilibrium
        }
        None => {
            computed = equilibrium(
                &StaticInput {
                    model,
                    coupling,
                    operator: operator.as_ref(),
                    conditions: &rest.conditions,
                    solver: &rest.solver,
                    time: 0.0,
                },
                system.as_mut().map(|s| s as &mut dyn SemiDiscrete),
                Timings::default(),
                prove,
                progress,
            )?;
            computed.timings.add_to(&mut timings);
            &computed
        }
    };
    let Equilibrium {
        stiffness,
        symmetry,
        load,
        applied,
        holder,
        solution,
        internal,
        energy,
        ..
    } = equilibrium;
    let symmetry = *symmetry;
    let info = &solution.info;
    watch = Stopwatch::start();
    choices.extend(equilibrium.choices.iter().cloned());
    choices.extend(rest.nonlinear(model));
    choices.push(Decision {
        choice: info.method.name().to_owned(),
        why: format!("{} system of {} unknowns", symmetry.name(), info.free_dofs),
    });
    choices.extend(volumes_choice(model));

    let u = &solution.displacement;
    let residual: Vec<f64> = internal.iter().zip(load).map(|(k, f)| k - f).collect();
    let mut reactions = vec![Vector::<D>::zeros(); rest.conditions.len()];
    for (dof, holder) in holder.iter().enumerate() {
        if let Some(condition) = holder {
            reactions[*condition][dof % D] += solution.reactions[dof];
        }
    }
    let mut balance = Vector::<D>::zeros();
    internal
        .iter()
        .enumerate()
        .for_each(|(dof, f)| balance[dof % D] += f);
    // the sizes of nodal forces: their sum vanishes where pressure or two faces pull against each other
    let size = |forces: &[f64]| -> f64 {
        let nodal = forces.chunks_exact(D);
        nodal
            .map(|f| Vector::<D>::from_column_slice(f).norm())
            .sum()
    };
    let scale = size(load) + size(&solution.reactions);
    let zone_of_site = zone_of_site(model);
    let solved = Solved {
        model,
        operator: operator.as_ref(),
        displacement: u,
        residual: &residual,
        zone_of_site: &zone_of_site,
        system: system.as_ref().map(|s| s as &dyn SemiDiscrete),
        broken: &[],
    };
    let files = visit(&rest.output, &solved)?;
    watch.lap(&mut timings, "output");
    progress.finish();
    let rotations = Rotations::new(model, is_linear);
    let rotation = rotations
        .largest(u)
        .and_then(|r| rotations.told(r.degrees, r.place, 0.0, 0.0, None));
    let mut told = warnings(model, joining, &proof);
    told.extend(indefinite(symmetry, info.method));
    told.extend(rotation.as_ref().map(Rotation::warning));
    let out_of_balance_relative = if scale > 0.0 {
        balance.norm() / scale
    } else {
        0.0
    };
    told.extend(out_of_balance(
        balance.as_slice(),
        out_of_balance_relative,
        joining,
    ));
    let summary = RunSummary {
        scene: name,
        dimension: D,
        coupling: joining.name.to_owned(),
        sizes: Sizes {
            nodes,
            cells,
            sites: model.sites.len(),
            points: model
                .sites
                .iter()
                .filter(|s| matches!(s.kind, SiteKind::Point(_)))
                .count(),
            bonds: model.body().map_or(0, |b| b.bond_count()) + operator.additional_bonds(),
            dofs: stiffness.dofs(),
            nonzeros: stiffness.nonzeros(),
        },
        choices,
        total_seconds: timings.total(),
        timings,
        peak_memory_bytes: peak_memory_bytes(),
        warnings: told,
        proof,
        rotation,
        iterations: info.iterations,
        factor_nonzeros: info.factor_nnz,
        residual: info.relative_residual,
        out_of_balance_force: balance.iter().copied().collect(),
        out_of_balance_relative,
        applied: applied.clone(),
        reactions: rest
            .conditions
            .iter()
            .zip(&reactions)
            .filter(|(c, _)| c.holds())
            .map(|(c, r)| Reaction {
                condition: c.name.clone(),
                force: r.iter().copied().collect(),
            })
            .collect(),
        energy: *energy,
        motion: None,
        files,
    };
    Ok(summary)
}
