//! `zones = "auto"`: the finite-element solution of the scene, and the nonlocal zone that follows from it.
//!
//! 1. The scene is solved with elements alone; cells through which a crack or a void passes carry next to nothing.
//! 2. Cells at cracks, at voids and, where bonds break, at notches are marked; so are those in which [`Criteria`] finds the local model wrong or a bond near its end.
//! 3. What is marked is padded, gaps narrower than a horizon are closed, islands of elements smaller than a family are filled. Where nothing is marked, elements are the whole model, and their solution is kept: the run writes it without solving again.

use std::fmt;
use std::sync::Arc;
use std::time::Instant;

use super::check;
use super::conditions::{Condition, Support};
use super::error::{SceneError, SceneErrorKind};
use super::initial::{Initial, InitialKind};
use super::materials::{self, Fracture, Law, Material};
use super::region;
use super::run::{self, Equilibrium, RunError};
use super::solve::Solve;
use super::source::Span;
use super::spec::{AutoSpec, LatticeStart, SceneSpec, ZonesNeeded};
use super::validate::Solver;
use crate::coupling::need::{Criteria, Need, gradient_ratio};
use crate::coupling::{Coupling, Local, Model, Problem, SiteKind, Zone};
use crate::mesh::Mesh;
use crate::observe::report::number;
use crate::observe::summary::{Choice, Stopwatch, Timings};
use crate::progress::Silent;
use crate::tensor::{Tensor4, Vector};

/// Horizons by which cracks, voids and notches are padded at least: bonds are cut within one, and points feel it within two.
const AROUND_CRACKS: f64 = 2.0;

/// Stiffness of cells that a crack or a void passes through, over that of their material: a crack opens as if it were a slot one to two cells wide.
const CUT: f64 = 1e-6;

/// How far from a crack, in sizes of a cell, centroids of cut cells lie: below half a diagonal a path of cut cells would have gaps.
const CUT_WITHIN: f64 = 0.71;

/// What of a scene places its zone.
pub(super) struct Unplaced<'a, const D: usize> {
    pub spec: &'a SceneSpec,
    pub mesh: &'a Mesh<D>,
    pub materials: &'a [Material<D>],
    pub cell_material: &'a [u16],
    pub solve: &'a Solve,
    pub conditions: &'a [Condition<D>],
    pub initial: &'a [Initial<D>],
    pub solver: &'a Solver,
}

/// The nonlocal zone that a scene needs.
#[derive(Clone, Debug)]
pub(super) struct Placed<const D: usize> {
    /// One entry per cell.
    pub nonlocal: Vec<bool>,
    /// Where the scene asks for it.
    pub span: Span,
    pub placement: Placement<D>,
}

/// How a zone came about.
#[derive(Clone, Debug)]
pub(crate) struct Placement<const D: usize> {
    /// What was chosen, and why.
    pub choice: Choice,
    /// Seconds of all but the solution that is kept.
    pub seconds: f64,
    /// The solution of elements alone, where it is that of the scene.
    pub kept: Option<Arc<Kept<D>>>,
}

/// A local scene that is solved already.
pub(crate) struct Kept<const D: usize> {
    pub model: Model<D>,
    pub coupling: Box<dyn Coupling<D>>,
    pub equilibrium: Equilibrium,
}

impl<const D: usize> fmt::Debug for Kept<D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} sites solved", self.model.sites.len())
    }
}

/// Options of `zones.auto`.
struct Options {
    stretch: f64,
    padding: f64,
    tolerance: f64,
}

/// What marks cells, beside their padding.
struct Marked {
    cracks: Vec<bool>,
    voids: Vec<bool>,
    notches: Vec<bool>,
    /// Cells that carry next to nothing in the finite-element solution.
    cut: Vec<bool>,
}

impl Marked {
    fn shapes(&self) -> Vec<bool> {
        let all = self.cracks.iter().zip(&self.voids).zip(&self.notches);
        all.map(|((c, v), n)| *c || *v || *n).collect()
    }
}

/// The zone of a scene that asks for one; none if it draws its own, or needs none.
///
/// # Errors
/// What the scene lacks, and what its solution with elements alone complains of.
pub(super) fn placed<const D: usize>(
    scene: &Unplaced<'_, D>,
) -> Result<Option<Placed<D>>, SceneError> {
    let (spec, mesh) = (scene.spec, scene.mesh);
    let Some(auto) = &spec.zones.auto else {
        return Ok(None);
    };
    let span = auto.span();
    if let Some(c) = &spec.coupling
        && matches!(c.get_ref().joining().zones, ZonesNeeded::Everywhere(_))
    {
        return Ok(None);
    }
    alone(spec, &span)?;
    let Some(p) = &spec.peridynamics else {
        return Err(SceneError::new(
            SceneErrorKind::Missing,
            "`zones.auto` needs [peridynamics]",
        )
        .label(span, "which horizon?")
        .help("add [peridynamics] with horizon = ... and points = ..., or remove it: without zones all is finite elements"));
    };
    let options = options(auto.get_ref())?;
    let start = Instant::now();
    let choices = materials::peridynamics(p, LatticeStart::OnCorner, mesh)?;
    let horizon: Vec<f64> = (0..mesh.cell_count())
        .map(|c| choices.horizon_at(&mesh.centroid(c)))
        .collect();
    if let Some(c) = (0..mesh.cell_count()).find(|&c| !(horizon[c].is_finite() && horizon[c] > 0.0))
    {
        return Err(SceneError::new(
            SceneErrorKind::WrongValue,
            format!(
                "`peridynamics.horizon` is {} at {:?}",
                horizon[c],
                mesh.centroid(c).as_slice()
            ),
        )
        .label(p.horizon.span.clone(), "`zones.auto` looks everywhere")
        .help("make it positive in the whole body, or draw the zone: [zones.nonlocal]"));
    }
    let marked = marked(scene)?;
    let shapes = marked.shapes();
    let (states, solved) = states(scene, &marked.cut, &span)?;
    let material = material(scene, &shapes, &span)?;
    let need = need(scene, &options, &horizon, &marked.cut, material, &states)?;
    let criteria: Vec<bool> = need
        .error
        .iter()
        .zip(&need.stretch)
        .map(|(e, s)| *e || *s)
        .collect();
    let nonlocal = zone(scene, &options, &horizon, material, &shapes, &criteria);
    let choice = told(scene, &options, &marked, &need, &nonlocal);
    let kept = solved.filter(|_| !nonlocal.contains(&true));
    let reused = kept.as_ref().map_or(0.0, |k| k.equilibrium.timings.total());
    Ok(Some(Placed {
        nonlocal,
        span,
        placement: Placement {
            choice,
            seconds: start.elapsed().as_secs_f64() - reused,
            kept: kept.map(Arc::new),
        },
    }))
}

/// Refuses zones that are drawn beside the one that is not.
fn alone(spec: &SceneSpec, span: &Span) -> Result<(), SceneError> {
    let drawn = match (&spec.zones.nonlocal, spec.zones.bodies.keys().next()) {
        (Some(n), _) => ("zones.nonlocal".to_owned(), n.span()),
        (None, Some(name)) => (format!("zones.bodies.{name}"), name.span.clone()),
        (None, None) => return Ok(()),
    };
    Err(SceneError::new(
        SceneErrorKind::Conflict,
        format!(
            "`zones.auto` and `{}` both say where the body is nonlocal",
            drawn.0
        ),
    )
    .label(span.clone(), "places the zone")
    .label(drawn.1, "draws it")
    .help("keep one of them; `--set zones=auto` replaces all of [zones]"))
}

fn options(spec: &AutoSpec) -> Result<Options, SceneError> {
    let stretch = match &spec.stretch {
        Some(s) => check::within(
            "zones.auto.stretch",
            s,
            s.value > 0.0 && s.value <= 1.0,
            "must be positive and at most 1",
            "it is a fraction of the critical stretch; 0.5 suits most scenes",
        )?,
        None => 0.5,
    };
    let padding = match &spec.padding {
        Some(p) => check::within(
            "zones.auto.padding",
            p,
            p.value >= 1.0,
            "must be at least 1",
            "it is a number of horizons, and bonds reach one",
        )?,
        None => 1.0,
    };
    let tolerance = match &spec.tolerance {
        Some(t) => check::within(
            "zones.auto.tolerance",
            t,
            t.value > 0.0 && t.value < 1.0,
            "must lie between 0 and 1",
            "0.05 leaves the local model an error of 0.25 % of the energy",
        )?,
        None => 0.05,
    };
    Ok(Options {
        stretch,
        padding,
        tolerance,
    })
}

/// Size of a cell.
fn size<const D: usize>(mesh: &Mesh<D>, c: usize) -> f64 {
    mesh.cell_volume(c).abs().powf(1.0 / D as f64)
}

/// Cells that have one of these nodes.
fn touching<const D: usize>(mesh: &Mesh<D>, nodes: impl IntoIterator<Item = u32>) -> Vec<bool> {
    let mut flag = vec![false; mesh.nodes.len()];
    nodes.into_iter().for_each(|n| flag[n as usize] = true);
    (0..mesh.cell_count())
        .map(|c| mesh.cell(c).iter().any(|&n| flag[n as usize]))
        .collect()
}

/// Cells at cracks and voids, and at notches of the mesh where bonds break.
fn marked<const D: usize>(scene: &Unplaced<'_, D>) -> Result<Marked, SceneError> {
    let (spec, mesh) = (scene.spec, scene.mesh);
    let count = mesh.cell_count();
    let mut marked = Marked {
        cracks: vec![false; count],
        voids: vec![false; count],
        notches: vec![false; count],
        cut: vec![false; count],
    };
    for (name, c) in &spec.cracks {
        let shape = region::shape(&format!("cracks.{name}"), c, mesh, &name.span)?;
        for c in 0..count {
            if shape.signed_distance(&mesh.centroid(c)) <= CUT_WITHIN * size(mesh, c) {
                marked.cracks[c] = true;
                marked.cut[c] = true;
            }
        }
    }
    for (name, v) in &spec.voids {
        let place = format!("voids.{name}.inside");
        let shape = region::shape(&place, &v.inside, mesh, &name.span)?;
        for c in 0..count {
            let distance = shape.signed_distance(&mesh.centroid(c));
            marked.voids[c] |= distance <= CUT_WITHIN * size(mesh, c);
            marked.cut[c] |= distance <= 0.0;
        }
    }
    if scene.materials.iter().any(|m| m.fracture.is_some()) {
        marked.notches = touching(mesh, mesh.notches());
    }
    Ok(marked)
}

/// The material that the points will have: that of the cracks, voids and notches; else the first one whose bonds break, else the first.
fn material<const D: usize>(
    scene: &Unplaced<'_, D>,
    shapes: &[bool],
    span: &Span,
) -> Result<u16, SceneError> {
    let of = |c: usize| scene.cell_material[c];
    let mut held = (0..shapes.len()).filter(|&c| shapes[c]).map(of);
    let Some(first) = held.next() else {
        let breaks = scene.materials.iter().position(|m| m.fracture.is_some());
        return Ok(breaks.unwrap_or(0) as u16);
    };
    match held.find(|m| *m != first) {
        None => Ok(first),
        Some(other) => Err(SceneError::new(
            SceneErrorKind::Later,
            format!(
                "`zones.auto` finds cracks, voids or notches in the materials `{}` and `{}`",
                scene.materials[first as usize].name, scene.materials[other as usize].name
            ),
        )
        .label(span.clone(), "points have one material")
        .help("draw the zone within one of them, [zones.nonlocal]; bonds between materials come later")),
    }
}

/// Displacements at the nodes that the scene may reach, by elements alone; with the solution if it is that of a static scene.
type States<const D: usize> = (Vec<Vec<Vector<D>>>, Option<Kept<D>>);

fn states<const D: usize>(
    scene: &Unplaced<'_, D>,
    cut: &[bool],
    span: &Span,
) -> Result<States<D>, SceneError> {
    let times = match scene.solve {
        Solve::Static => vec![0.0],
        Solve::QuasiStatic(q) => vec![q.duration],
        Solve::Explicit(_) => return Ok((vec![initial(scene)], None)),
    };
    let mut found = Vec::with_capacity(times.len());
    let mut last = None;
    for t in times {
        let kept = elements(scene, cut, t).map_err(|error| {
            SceneError::new(
                SceneErrorKind::Conflict,
                format!("`zones.auto` could not solve the scene with elements alone: {error}"),
            )
            .label(span.clone(), "needs that solution")
            .help("hold and load the body so that `coupling = \"local\"` runs, or draw the zone: [zones.nonlocal]")
        })?;
        // all nodes of elements are sites, in their order; others have no displacement
        let mut u = vec![Vector::zeros(); scene.mesh.nodes.len()];
        for (site, s) in kept.model.sites.iter().enumerate() {
            if let SiteKind::Node(n) = s.kind {
                let values = &kept.equilibrium.solution.displacement[site * D..][..D];
                u[n as usize] = Vector::from_column_slice(values);
            }
        }
        found.push(u);
        last = Some(kept);
    }
    let still = *scene.solve == Solve::Static && !cut.contains(&true);
    Ok((found, last.filter(|_| still)))
}

/// The displacement at time zero.
fn initial<const D: usize>(scene: &Unplaced<'_, D>) -> Vec<Vector<D>> {
    let mut u = vec![Vector::zeros(); scene.mesh.nodes.len()];
    for field in scene.initial {
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

/// Solves the scene with elements alone, under what holds and loads it at time `t`.
fn elements<const D: usize>(
    scene: &Unplaced<'_, D>,
    cut: &[bool],
    t: f64,
) -> Result<Kept<D>, RunError> {
    let whole: Vec<Tensor4<D>> = scene.materials.iter().map(Material::stiffness).collect();
    let soft = whole.iter().map(|c| c.scaled(CUT));
    let shift = whole.len() as u16;
    let problem = Problem {
        mesh: scene.mesh.clone(),
        zones: vec![Zone::Local; scene.mesh.cell_count()],
        tensors: whole.iter().cloned().chain(soft).collect(),
        cell_material: scene
            .cell_material
            .iter()
            .zip(cut)
            .map(|(m, cut)| if *cut { m + shift } else { *m })
            .collect(),
        peridynamic_material: 0,
        peridynamics: None,
        coupling: Box::new(Local),
    };
    let mut timings = Timings::default();
    let mut watch = Stopwatch::start();
    let (model, coupling) = Model::new(problem, &Silent)?;
    watch.lap(&mut timings, "sites and bonds");
    let operator = coupling.operator(&model)?;
    let equilibrium = run::equilibrium(
        &run::At {
            model: &model,
            coupling: coupling.as_ref(),
            operator: operator.as_ref(),
            conditions: scene.conditions,
            solver: scene.solver,
            time: t,
        },
        timings,
        &Silent,
    )?;
    drop(operator);
    Ok(Kept {
        model,
        coupling,
        equilibrium,
    })
}

/// What the states need, taken together.
fn need<const D: usize>(
    scene: &Unplaced<'_, D>,
    options: &Options,
    horizon: &[f64],
    cut: &[bool],
    material: u16,
    states: &[Vec<Vector<D>>],
) -> Result<Need, SceneError> {
    let (spec, mesh) = (scene.spec, scene.mesh);
    let stuff = &scene.materials[material as usize];
    let largest = horizon.iter().copied().fold(0.0, f64::max);
    let mut no_fail = Vec::with_capacity(spec.no_fail.len());
    for (name, shape) in &spec.no_fail {
        no_fail.push(region::region(&format!("no-fail.{name}"), shape, mesh)?.select(mesh));
    }
    let unbreakable: Vec<bool> = (0..mesh.cell_count())
        .map(|c| no_fail.iter().any(|n| n[c]))
        .collect();
    let tensors: Vec<Tensor4<D>> = scene.materials.iter().map(Material::stiffness).collect();
    let criteria = Criteria {
        mesh,
        tensors: &tensors,
        cell_material: scene.cell_material,
        material,
        horizon,
        gradient_ratio: gradient_ratio::<D>(|r| micromodulus(stuff, r, largest), largest),
        tolerance: options.tolerance,
        stretch: critical_stretch(stuff, largest).map(|s| options.stretch * s),
        cut,
        unbreakable: &unbreakable,
        held: &held(scene, horizon),
    };
    let mut all: Option<Need> = None;
    for u in states {
        let found = criteria.need(|n| u[n]);
        all = Some(match all {
            None => found,
            Some(before) => before.and(&found),
        });
    }
    Ok(all.unwrap_or_default())
}

/// Cells within a horizon of nodes whose motion is prescribed.
fn held<const D: usize>(scene: &Unplaced<'_, D>, horizon: &[f64]) -> Vec<bool> {
    let mesh = scene.mesh;
    let mut nodes: Vec<u32> = Vec::new();
    for condition in scene.conditions {
        match condition.support() {
            Some(Support::Set { nodes: set, .. }) => nodes.extend(set),
            Some(Support::Inside(region)) => nodes.extend(
                (0..mesh.nodes.len() as u32)
                    .filter(|&n| region.contains(&mesh.nodes[n as usize], 0.0)),
            ),
            None => {}
        }
    }
    mesh.grown(&touching(mesh, nodes), |c| horizon[c])
}

/// The micromodulus of the bonds of a material, up to a factor; of a law that is not named here, that of ω = 1.
fn micromodulus<const D: usize>(material: &Material<D>, r: f64, horizon: f64) -> f64 {
    let mut influence = 1.0;
    if let Law::BondBased(m) = material.law {
        return m.shape(r, horizon);
    } else if let Law::Lps(omega) | Law::Correspondence(omega, _) = material.law {
        influence = omega.value(r, horizon);
    }
    influence / (r * r)
}

/// The stretch at which bonds of a material break. A fracture energy that gives none is the run's to complain of.
fn critical_stretch<const D: usize>(material: &Material<D>, horizon: f64) -> Option<f64> {
    match material.fracture? {
        Fracture::Stretch(s) => Some(s),
        Fracture::Energy(energy) => {
            let bonds = run::law(material).bond_energy(horizon)?;
            bonds.critical_stretch::<D>(energy, horizon).ok()
        }
    }
}

/// The zone around marked cells: padded, without gaps and islands of elements.
fn zone<const D: usize>(
    scene: &Unplaced<'_, D>,
    options: &Options,
    horizon: &[f64],
    material: u16,
    shapes: &[bool],
    criteria: &[bool],
) -> Vec<bool> {
    let mesh = scene.mesh;
    let far = options.padding.max(AROUND_CRACKS);
    let within = |mut cells: Vec<bool>| {
        for (cell, m) in cells.iter_mut().zip(scene.cell_material) {
            *cell &= *m == material;
        }
        cells
    };
    let around_shapes = mesh.grown(shapes, |c| far * horizon[c]);
    let around_criteria = mesh.grown(criteria, |c| options.padding * horizon[c]);
    let padded = within(
        around_shapes
            .iter()
            .zip(&around_criteria)
            .map(|(s, c)| *s || *c)
            .collect(),
    );
    let half = |c: usize| 0.5 * horizon[c];
    let closed = mesh.shrunk(&mesh.grown(&padded, half), half);
    let largest = horizon.iter().copied().fold(0.0, f64::max);
    within(mesh.filled(&closed, (2.0 * largest).powi(D as i32)))
}

/// What was chosen, and why.
fn told<const D: usize>(
    scene: &Unplaced<'_, D>,
    options: &Options,
    marked: &Marked,
    need: &Need,
    nonlocal: &[bool],
) -> Choice {
    let count = |cells: &[bool]| cells.iter().filter(|c| **c).count();
    let mesh = scene.mesh;
    let volume = |of: &dyn Fn(usize) -> bool| -> f64 {
        (0..mesh.cell_count())
            .filter(|&c| of(c))
            .map(|c| mesh.cell_volume(c).abs())
            .sum()
    };
    let mut why = Vec::new();
    for (name, cells) in [
        ("cracks", &marked.cracks),
        ("voids", &marked.voids),
        ("notches", &marked.notches),
    ] {
        if count(cells) > 0 {
            why.push(format!("{name} mark {} cells", count(cells)));
        }
    }
    let looked = match scene.solve {
        Solve::Static => "",
        Solve::QuasiStatic(_) => " at the end of the load",
        Solve::Explicit(_) => " at time zero",
    };
    why.push(format!(
        "the local model errs by {}{looked} in the norm of energy{}",
        number(need.all_local),
        match count(&need.error) {
            0 => format!(", within the tolerance {}", options.tolerance),
            n => format!(
                ", and by {} without {n} cells (tolerance {})",
                number(need.remaining),
                options.tolerance
            ),
        }
    ));
    if scene.materials.iter().any(|m| m.fracture.is_some()) {
        why.push(format!(
            "{} cells are stretched beyond {} of the critical stretch{looked}",
            count(&need.stretch),
            options.stretch
        ));
    }
    let cells = count(nonlocal);
    if cells == 0 {
        return Choice {
            choice: "zones.auto: no peridynamics".to_owned(),
            why: why.join("; "),
        };
    }
    let share = volume(&|c| nonlocal[c]) / volume(&|_| true);
    why.push(format!(
        "padded by {} horizons, {} around cracks, voids and notches",
        options.padding,
        options.padding.max(AROUND_CRACKS)
    ));
    Choice {
        choice: format!(
            "zones.auto: {cells} of {} cells nonlocal, {:.1} % of the body",
            mesh.cell_count(),
            100.0 * share
        ),
        why: why.join("; "),
    }
}
