//! `zones = "auto"`: the nonlocal zone that follows from a scene's shapes, and from its displacement in elements.
//!
//! 1. Cells at cracks, at voids and at notches are marked, the last for good only where bonds break. Marked cells are padded, gaps narrower than a horizon are closed, islands of elements smaller than a family are filled.
//! 2. A static scene is solved with that zone, with elements alone where it is empty. Elements in which [`Criteria`](crate::coupling::error_indicator::Criteria) finds the local model wrong or a bond near its end are marked too.
//! 3. Where they lie outside, the zone is theirs and the scene is solved again; one around notches only where it leaves clearly more of the error than the tolerance, or is much larger than theirs. Else the solution is that of the scene, and is kept: the run writes it without solving again. A look costs its search only.
//!
//! A load that grows is looked at once, at its end, with elements alone in which cells at cracks and voids carry next to nothing; a motion at its start.
//!
//! | file | what |
//! |---|---|
//! | `shapes.rs` | cells at cracks, voids and notches |
//! | `solutions.rs` | the displacement by elements alone, or with a zone so far |
//! | `criteria.rs` | cells in which that displacement needs a nonlocal law or bonds |

mod criteria;
mod shapes;
mod solutions;
#[cfg(test)]
mod tests;

use std::time::Instant;

use self::criteria::CriterionInput;
use self::shapes::Marked;
pub(crate) use self::solutions::{CachedSolution, difference_from_elements};
use crate::coupling::error_indicator::Need;
use crate::mesh::Mesh;
use crate::model::Zone;
use crate::observe::report::number;
use crate::observe::summary::Decision;
use crate::scene::bounds_checks;
use crate::scene::draft::Draft;
use crate::scene::error::{SceneError, SceneErrorKind};
use crate::scene::materials::Material;
use crate::scene::peridynamics;
use crate::scene::solve::Solve;
use crate::scene::source::Span;
use crate::scene::spec::{AutoSpec, LatticeStart, SceneSpec, ZonesNeeded};
use crate::scene::validated::Placement;
use crate::scene::zones::Placed;
use crate::tensor::Vector;

/// Horizons by which cracks, voids and notches are padded at least: bonds are cut within one, and points feel it within two.
const AROUND_CRACKS: f64 = 2.0;

/// A zone that was found.
pub(super) struct Found<const D: usize> {
    pub zone: Placed,
    pub placement: Placement,
    /// The solution that the last look was taken at, where it is that of the scene.
    pub kept: Option<CachedSolution<D>>,
}

/// Options of `zones.auto`.
struct Options {
    stretch: f64,
    padding: f64,
    tolerance: f64,
}

/// Refuses cells of second order: the error of a solution is judged by the gradients that linear cells have.
fn refuse_second_order<const D: usize>(mesh: &Mesh<D>, span: &Span) -> Result<(), SceneError> {
    match mesh.shapes.iter().find(|shape| shape.is_quadratic()) {
        Some(shape) => Err(SceneError::conflict(format!("`zones.auto` judges the solution of linear cells, and the mesh has {shape:?}"))
            .label(span.clone(), "linear cells only")
            .help("draw the zone: [zones.nonlocal]; or take linear cells: mesh.file.order = \"linear\", or another `cell` of a generated mesh")),
        None => Ok(()),
    }
}

/// The zone of a scene that asks for one; none if it draws its own, or needs none.
///
/// # Errors
/// [`SceneError`] for a scene that lacks something, and for a solution that fails.
pub(crate) fn placed<const D: usize>(scene: &Draft<'_, D>) -> Result<Option<Found<D>>, SceneError> {
    let (spec, mesh) = (scene.spec, &scene.mesh);
    let Some(auto) = &spec.zones.auto else {
        return Ok(None);
    };
    let span = auto.span();
    if let Some(c) = &spec.coupling
        && matches!(c.get_ref().traits().zones, ZonesNeeded::Everywhere(_))
    {
        return Ok(None);
    }
    alone(spec, &span)?;
    refuse_second_order(mesh, &span)?;
    let Some(p) = &spec.peridynamics else {
        return Err(SceneError::missing("`zones.auto` needs [peridynamics]")
            .label(span, "which horizon?")
            .help("add [peridynamics] with horizon = ... and points = ..., or remove it: without zones all is finite elements"));
    };
    let options = options(auto.get_ref())?;
    let start = Instant::now();
    let choices = {
        // no zone is placed yet: a lattice that is not typed suits all cells
        let all = vec![Zone::Nonlocal; mesh.cell_count()];
        peridynamics::peridynamics(p, LatticeStart::OnCorner, mesh, &all)?
    };
    let horizon: Vec<f64> = (0..mesh.cell_count())
        .map(|c| choices.horizon_at(&mesh.centroid(c)))
        .collect();
    if let Some(c) = (0..mesh.cell_count()).find(|&c| !(horizon[c].is_finite() && horizon[c] > 0.0))
    {
        return Err(SceneError::wrong_value(format!(
            "`peridynamics.horizon` is {} at {:?}",
            horizon[c],
            mesh.centroid(c).as_slice()
        ))
        .label(
            p.horizon.as_ref().map_or(span, |h| h.span.clone()),
            "`zones.auto` looks everywhere",
        )
        .help("make it positive in the whole body, or draw the zone: [zones.nonlocal]"));
    }
    let marked = shapes::marked(scene)?;
    let shapes = marked.shapes();
    let material = material(scene, &shapes, &span)?;
    refuse_damage(&scene.materials[material as usize], &span)?;
    let search = Search {
        scene,
        options,
        horizon,
        shapes,
        marked,
        material,
        span,
        start,
    };
    match &scene.solve {
        Solve::Static if search.begins() => search.by_rounds().map(Some),
        _ => search.at_once().map(Some),
    }
}

/// A zone on its way.
struct Search<'a, const D: usize> {
    scene: &'a Draft<'a, D>,
    options: Options,
    /// At the centre of each cell.
    horizon: Vec<f64>,
    marked: Marked,
    /// Cells of `marked` that are padded as shapes are.
    shapes: Vec<bool>,
    /// The material of the points.
    material: u16,
    /// Position of `zones.auto` in the scene.
    span: Span,
    start: Instant,
}

/// Solutions before a zone that still wants to grow is taken as it is: each adds what lies at the edge of the last.
const ROUNDS: usize = 4;

/// Horizons around a notch that its strains are taken to ask for, before they are known; the slit plate asks for a sixth to a third.
const GUESS: f64 = 0.17;

/// Times the tolerance that a zone may leave of the error if cells around notches were taken for those asked for: another solution takes longer than all that it could save.
const SETTLED: f64 = 1.2;

/// A zone around notches is kept if the solution with it asks for this share of its cells: smaller ones cost as much, and another solution besides.
const SPARE: usize = 2;

impl<const D: usize> Search<'_, D> {
    /// Returns true if there is a zone to begin with.
    fn begins(&self) -> bool {
        self.shapes.contains(&true) || self.marked.notches.contains(&true)
    }

    /// From elements alone.
    fn at_once(self) -> Result<Found<D>, SceneError> {
        let cut = &self.marked.cut;
        let (displacement, solved) = solutions::state(self.scene, cut, &self.span)?;
        let need = self.need(cut, &displacement)?;
        let nonlocal = self.zone(&either(&need.error, &need.stretch));
        let kept = solved.filter(|_| !nonlocal.contains(&true));
        Ok(self.placed(nonlocal, &need, kept))
    }

    /// From solutions with the zone so far, at first that around shapes, or where there are none around notches.
    fn by_rounds(self) -> Result<Found<D>, SceneError> {
        let shaped = self.shapes.contains(&true);
        let mut criteria = match shaped {
            true => vec![false; self.shapes.len()],
            false => self
                .scene
                .mesh
                .grown(&self.marked.notches, |c| GUESS * self.horizon[c]),
        };
        let mut placed = Placed {
            nonlocal: self.zone(&criteria),
            span: self.span.clone(),
            is_for_patch: false,
        };
        let mut round = 1;
        loop {
            let solved = self.scene.scene(Some(&placed)).and_then(|scene| {
                let elements: Vec<bool> = scene.zones.iter().map(|z| *z == Zone::Local).collect();
                Ok((elements, solutions::coupled(scene, &self.span)?))
            });
            let (elements, kept) = match solved {
                // a guess that does not run is none
                Err(_) if !shaped => return self.at_once(),
                other => other?,
            };
            if shaped {
                // points on both sides of a crack give no strain
                let bonds: Vec<bool> = elements.iter().map(|e| !e).collect();
                let need = self.need(&bonds, &kept.at_nodes())?;
                criteria = either(&criteria, &either(&need.error, &need.stretch));
                let grown = self.zone(&criteria);
                if grown == placed.nonlocal || round == ROUNDS {
                    return Ok(self.placed(placed.nonlocal, &need, Some(kept)));
                }
                placed.nonlocal = grown;
            } else {
                let mut need = self.need(&self.marked.cut, &kept.everywhere())?;
                let wanted = either(&need.error, &need.stretch);
                let asked = self.zone(&wanted);
                if !asked.contains(&true) {
                    return self.at_once();
                }
                let count = |cells: &[bool]| cells.iter().filter(|c| **c).count();
                let remaining = need.remaining_outside(&criteria);
                let are_in = |(s, taken): (&bool, &bool)| *taken || !s;
                let holds = remaining <= SETTLED * self.options.tolerance
                    && need.stretch.iter().zip(&criteria).all(are_in);
                let spare = count(&placed.nonlocal) <= SPARE * count(&asked);
                if (holds && spare) || round == ROUNDS {
                    (need.error, need.remaining) = (criteria, remaining);
                    return Ok(self.placed(placed.nonlocal, &need, Some(kept)));
                }
                (criteria, placed.nonlocal) = (wanted, asked);
            }
            round += 1;
        }
    }

    fn need(&self, cut: &[bool], displacement: &[Vector<D>]) -> Result<Need, SceneError> {
        let asked = CriterionInput {
            material: self.material,
            horizon: &self.horizon,
            tolerance: self.options.tolerance,
            stretch: self.options.stretch,
        };
        criteria::need(self.scene, &asked, cut, displacement)
    }

    fn placed(
        &self,
        nonlocal: Vec<bool>,
        need: &Need,
        kept: Option<CachedSolution<D>>,
    ) -> Found<D> {
        let choice = told(self.scene, &self.options, &self.marked, need, &nonlocal);
        let reused = kept.as_ref().map_or(0.0, |k| k.equilibrium.timings.total());
        let placement = Placement {
            choice,
            seconds: self.start.elapsed().as_secs_f64() - reused,
        };
        let span = self.span.clone();
        Found {
            zone: Placed {
                nonlocal,
                span,
                is_for_patch: false,
            },
            placement,
            kept,
        }
    }

    /// The zone around shapes and the cells that the criteria mark.
    fn zone(&self, criteria: &[bool]) -> Vec<bool> {
        zone(
            self.scene,
            &self.options,
            &self.horizon,
            self.material,
            &self.shapes,
            criteria,
        )
    }
}

fn either(a: &[bool], b: &[bool]) -> Vec<bool> {
    a.iter().zip(b).map(|(a, b)| *a || *b).collect()
}

/// Refuses zones that are drawn beside the one that is not.
fn alone(spec: &SceneSpec, span: &Span) -> Result<(), SceneError> {
    let drawn = match (&spec.zones.nonlocal, spec.zones.bodies.keys().next()) {
        (Some(n), _) => ("zones.nonlocal".to_owned(), n.span()),
        (None, Some(name)) => (format!("zones.bodies.{name}"), name.span.clone()),
        (None, None) => return Ok(()),
    };
    Err(SceneError::conflict(format!(
        "`zones.auto` and `{}` both say where the body is nonlocal",
        drawn.0
    ))
    .label(span.clone(), "places the zone")
    .label(drawn.1, "draws it")
    .help("keep one of them; `--set zones=auto` replaces all of [zones]"))
}

/// Refuses bonds that are damaged, or break, by something else than their stretch: no solution before the run shows the place where that begins.
fn refuse_damage<const D: usize>(material: &Material<D>, span: &Span) -> Result<(), SceneError> {
    let does = match material.fracture {
        _ if material.law.as_ref().is_some_and(|law| law.damages()) => {
            "takes their stiffness by a damage before they break".to_owned()
        }
        Some(fracture) if !fracture.is_of_stretch() => {
            format!(
                "breaks them by a {}",
                fracture.criterion.key().replace('-', " ")
            )
        }
        _ => return Ok(()),
    };
    Err(SceneError::conflict(format!(
        "`zones.auto` looks for bonds that reach a critical stretch, and the law of the material `{}`, {}, {does}",
        material.name,
        material.law_name()
    ))
    .label(span.clone(), "cannot tell where damage begins")
    .help("draw the zone, [zones.nonlocal], with room for the damage, or use coupling = \"nonlocal\""))
}

fn options(spec: &AutoSpec) -> Result<Options, SceneError> {
    let stretch = match &spec.stretch {
        Some(s) => bounds_checks::within(
            "zones.auto.stretch",
            s,
            s.value > 0.0 && s.value <= 1.0,
            "must be positive and at most 1",
            "it is a fraction of the critical stretch; 0.5 suits most scenes",
        )?,
        None => 0.5,
    };
    let padding = match &spec.padding {
        Some(p) => bounds_checks::within(
            "zones.auto.padding",
            p,
            p.value >= 1.0,
            "must be at least 1",
            "it is a number of horizons, and bonds reach one",
        )?,
        None => 1.0,
    };
    let tolerance = match &spec.tolerance {
        Some(t) => bounds_checks::within(
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

/// The material that the points will have: that of the cracks, voids and notches; else the first one whose bonds break, else the first.
fn material<const D: usize>(
    scene: &Draft<'_, D>,
    shapes: &[bool],
    span: &Span,
) -> Result<u16, SceneError> {
    let of = |c: usize| scene.cell_material[c];
    let mut held = (0..shapes.len()).filter(|&c| shapes[c]).map(of);
    let no_points = |what: &str| {
        SceneError::conflict(format!("`zones.auto` places points, and {what}"))
            .label(
                span.clone(),
                "an orthotropic material has no peridynamic law",
            )
            .help("give what may crack a material that has points, or use coupling = \"local\"")
    };
    let has_law = |m: &Material<D>| m.law.is_some();
    let Some(first) = held.next() else {
        let breaks = scene.materials.iter().position(|m| m.fracture.is_some());
        let found = breaks.or_else(|| scene.materials.iter().position(has_law));
        let found = found.ok_or_else(|| no_points("no material has any"))?;
        return Ok(found as u16);
    };
    let own = &scene.materials[usize::from(first)];
    if own.law.is_none() {
        return Err(no_points(&format!(
            "finds a crack, void or notch in the material `{}`, which has none",
            own.name
        )));
    }
    match held.find(|m| *m != first) {
        None => Ok(first),
        Some(other) => Err(SceneError::new(
            SceneErrorKind::Later,
            format!(
                "`zones.auto` finds cracks, voids or notches in the materials `{}` and `{}`",
                scene.materials[first as usize].name, scene.materials[other as usize].name
            ),
        )
        .label(span.clone(), "places points of one material")
        .help("draw the zone, [zones.nonlocal]; points of a zone that is drawn may have several materials")),
    }
}

/// The zone around marked cells: padded, without gaps and islands of elements.
fn zone<const D: usize>(
    scene: &Draft<'_, D>,
    options: &Options,
    horizon: &[f64],
    material: u16,
    shapes: &[bool],
    criteria: &[bool],
) -> Vec<bool> {
    let mesh = &scene.mesh;
    if !(shapes.contains(&true) || criteria.contains(&true)) {
        return vec![false; mesh.cell_count()];
    }
    let far = options.padding.max(AROUND_CRACKS);
    let within = |mut cells: Vec<bool>| {
        for (cell, m) in cells.iter_mut().zip(&scene.cell_material) {
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

/// Returns the choice, and the reasons for it.
fn told<const D: usize>(
    scene: &Draft<'_, D>,
    options: &Options,
    marked: &Marked,
    need: &Need,
    nonlocal: &[bool],
) -> Decision {
    let count = |cells: &[bool]| cells.iter().filter(|c| **c).count();
    let mesh = &scene.mesh;
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
        if count(cells) > 0 && (name != "notches" || marked.breaks) {
            why.push(format!("{name} mark {} cells", count(cells)));
        }
    }
    let shapes = marked.shapes().contains(&true);
    let looked = match &scene.solve {
        Solve::Static if shapes => " outside of the zone",
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
        return Decision {
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
    Decision {
        choice: format!(
            "zones.auto: {cells} of {} cells nonlocal, {:.1} % of the body",
            mesh.cell_count(),
            100.0 * share
        ),
        why: why.join("; "),
    }
}
