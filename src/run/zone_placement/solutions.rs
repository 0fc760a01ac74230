//! The displacement that a scene has with elements alone, and with the zone that it has so far.

use std::fmt;

use crate::observe::summary::{Stopwatch, Timings};
use crate::progress::Silent;
use crate::run::equilibrium::{self, Equilibrium};
use crate::run::error::RunError;
use crate::run::setup;
use crate::scene::conditions::Condition;
use crate::scene::draft::Draft;
use crate::scene::error::SceneError;
use crate::scene::initial::InitialKind;
use crate::scene::materials::elastic_cells;
use crate::scene::solve::Solve;
use crate::scene::source::Span;
use crate::scene::validated::{Scene, Solver};
use crate::tensor::Vector;
use crate::{
    coupling::{Coupling, Local, Problem},
    model::{Model, Sampler, SiteKind, Zone, ZonedBody},
};

/// Stiffness of cells that a crack or a void passes through, over that of their material: a crack opens as if it were a slot one to two cells wide.
const CUT: f64 = 1e-6;

/// A scene that is solved already.
pub(crate) struct CachedSolution<const D: usize> {
    pub model: Model<D>,
    pub coupling: Box<dyn Coupling<D>>,
    pub equilibrium: Equilibrium,
}

impl<const D: usize> CachedSolution<D> {
    /// Displacement at the nodes of the mesh. Nodes of elements are sites; others, inside of a zone, have none.
    pub(super) fn at_nodes(&self) -> Vec<Vector<D>> {
        let displacement = &self.equilibrium.solution.displacement;
        let mut u = vec![Vector::zeros(); self.model.mesh.nodes.len()];
        for (site, s) in self.model.sites.iter().enumerate() {
            if let SiteKind::Node(n) = s.kind {
                u[n as usize] = Vector::from_column_slice(&displacement[site * D..][..D]);
            }
        }
        u
    }

    /// The same, with the displacement of the points around at the nodes of cells that hold points.
    pub(super) fn everywhere(&self) -> Vec<Vector<D>> {
        let sampler = Sampler::new(&self.model);
        let displacement = &self.equilibrium.solution.displacement;
        let mesh = &self.model.mesh;
        let mut u = self.at_nodes();
        let mut is_known = vec![true; u.len()];
        for c in (0..mesh.cell_count()).filter(|&c| !self.model.is_element(c)) {
            (mesh.cell(c).iter()).for_each(|&n| is_known[n as usize] = false);
        }
        for n in (0..u.len()).filter(|&n| !is_known[n]) {
            let found = sampler.displacement(&mesh.nodes[n], displacement);
            u[n] = found.unwrap_or_else(Vector::zeros);
        }
        u
    }
}

impl<const D: usize> fmt::Debug for CachedSolution<D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} sites solved", self.model.sites.len())
    }
}

/// Displacement at the nodes of the mesh by elements alone, where bonds are pulled the most that can be known without bonds: at the end of a load, at the start of a motion. With the solution, if that is the static scene's own.
pub(super) fn state<const D: usize>(
    scene: &Draft<'_, D>,
    cut: &[bool],
    span: &Span,
) -> Result<(Vec<Vector<D>>, Option<CachedSolution<D>>), SceneError> {
    let time = match &scene.solve {
        Solve::Static => 0.0,
        Solve::QuasiStatic(q) => q.duration,
        Solve::Explicit(_) => return Ok((initial(scene), None)),
    };
    let kept = elements(scene, cut, time).map_err(|error| {
        unsolved(&error, "with elements alone", span)
            .help("hold and load the body so that `coupling = \"local\"` runs, or draw the zone: [zones.nonlocal]")
    })?;
    let u = kept.at_nodes();
    let own = scene.solve == Solve::Static && !cut.contains(&true);
    Ok((u, own.then_some(kept)))
}

/// The solution of a static scene with the zone that it has so far.
///
/// # Errors
/// [`SceneError`] for a solution that fails.
pub(super) fn coupled<const D: usize>(
    scene: Scene<D>,
    span: &Span,
) -> Result<CachedSolution<D>, SceneError> {
    let (problem, rest) = setup::problem(scene);
    solved(problem, &rest.conditions, &rest.solver, 0.0).map_err(|error| {
        unsolved(&error, "with a zone around cracks and voids", span)
            .help("draw the zone, [zones.nonlocal], to see what the scene lacks")
    })
}

fn unsolved(error: &RunError, how: &str, span: &Span) -> SceneError {
    SceneError::conflict(format!(
        "`zones.auto` could not solve the scene {how}: {error}"
    ))
    .label(span.clone(), "needs that solution")
}

/// The displacement at time zero.
fn initial<const D: usize>(scene: &Draft<'_, D>) -> Vec<Vector<D>> {
    let mut u = vec![Vector::zeros(); scene.mesh.nodes.len()];
    for field in &scene.initial {
        if field.kind != InitialKind::Displacement {
            continue;
        }
        for (x, u) in scene.mesh.nodes.iter().zip(&mut u) {
            if field.region.contains(x, 0.0) {
                for k in 0..D {
                    u[k] = field.components.at(k, x).unwrap_or(u[k]);
                }
            }
        }
    }
    u
}

/// Solves the scene with elements alone, under its supports and loads at time `t`.
fn elements<const D: usize>(
    scene: &Draft<'_, D>,
    cut: &[bool],
    t: f64,
) -> Result<CachedSolution<D>, RunError> {
    let cells = scene.cell_material.clone();
    let whole = elastic_cells(&scene.materials, cells, 0, &scene.mesh);
    let problem = Problem {
        body: ZonedBody {
            zones: vec![Zone::Local; scene.mesh.cell_count()],
            elastic: whole.scaled_where(cut, CUT),
            mesh: scene.mesh.clone(),
            peridynamics: None,
        },
        coupling: Box::new(Local),
    };
    solved(problem, &scene.conditions, &scene.solver, t)
}

/// The largest difference of the displacement of a static scene from that of elements alone, at nodes of elements, over the largest of that.
///
/// Without cracks and voids that is the error of a coupling, together with the effect of the nonlocal law. None with cracks or voids, where forces are not linear in the displacement, or without a solution.
pub(crate) fn difference_from_elements<const D: usize>(
    model: &Model<D>,
    rest: &setup::RunSettings<D>,
    displacement: &[f64],
) -> Option<f64> {
    let cut = (model.peridynamics.as_ref())
        .is_some_and(|p| !p.barriers.is_empty() || !p.voids.is_empty());
    if cut || rest.nonlinear(model).is_some() {
        return None;
    }
    let cells = 0..model.mesh.cell_count();
    let problem = Problem {
        body: ZonedBody {
            zones: vec![Zone::Local; cells.len()],
            elastic: model.elastic.clone(),
            mesh: model.mesh.clone(),
            peridynamics: None,
        },
        coupling: Box::new(Local),
    };
    let alone = solved(problem, &rest.conditions, &rest.solver, 0.0).ok()?;
    let known = &alone.equilibrium.solution.displacement;
    let (mut largest, mut difference) = (0.0f64, 0.0f64);
    for c in cells.filter(|&c| model.is_element(c)) {
        for &n in model.mesh.cell(c) {
            let u = alone
                .model
                .node_transfer
                .displacement::<D>(n as usize, known);
            let own = model
                .node_transfer
                .displacement::<D>(n as usize, displacement);
            largest = largest.max(u.norm());
            difference = difference.max((own - u).norm());
        }
    }
    let part = difference / largest;
    part.is_finite().then_some(part)
}

/// Lays out and solves a problem under its supports and loads at time `t`.
fn solved<const D: usize>(
    problem: Problem<D>,
    conditions: &[Condition<D>],
    solver: &Solver,
    t: f64,
) -> Result<CachedSolution<D>, RunError> {
    let mut timings = Timings::default();
    let mut watch = Stopwatch::start();
    let (model, coupling) = problem.lay_out(None, &Silent)?;
    watch.lap(&mut timings, "sites and bonds");
    let operator = coupling.operator(&model)?;
    watch.lap(&mut timings, "assembly");
    let equilibrium = equilibrium::equilibrium(
        &equilibrium::StaticInput {
            model: &model,
            coupling: coupling.as_ref(),
            operator: &operator,
            conditions,
            solver,
            time: t,
            ranks: None,
            thermal: None,
        },
        None,
        timings,
        |_| Ok(0.0),
        &Silent,
    )?;
    drop(operator);
    Ok(CachedSolution {
        model,
        coupling,
        equilibrium,
    })
}
