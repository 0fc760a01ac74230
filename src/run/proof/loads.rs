//! Mass, total and first moment of each load against exact integrals over the mesh, and supports held everywhere.
//!
//! The model's side is the sum over its sites, of their masses and forces and of these times their positions. The other side knows of no site: it is the integral over the cells and facets of the mesh by the mesh's own quadrature.

#![deny(clippy::wildcard_enum_match_arm)]

use std::collections::BTreeMap;

use super::Subject;
use crate::fem;
use crate::mesh::Facet;
use crate::mesh::boundary::BoundaryFacet;
use crate::model::loaded_places::may_bound_zone;
use crate::model::tributary::Moments;
use crate::model::{CellRole, Model, Zone};
use crate::observe::proof::{Figure, Finding, Part, Severity};
use crate::observe::report::number;
use crate::observe::warning::{Code, Quantity, Warning};
use crate::run::error::RunError;
use crate::run::loads::{BodyForces, Loads, nearest_points, site_of_node};
use crate::scene::Expression;
use crate::scene::conditions::{Condition, Support};
use crate::scene::load::Domain;
use crate::system::Symmetry;
use crate::tensor::Vector;

/// Difference from the exact integral, relative, up to which masses and loads are exact: round-off of sums over a million sites is 1e-12.
const EXACT: f64 = 1e-9;

/// Difference at which a run is refused: beyond what a mesh resolves anyway.
const LOST: f64 = 1e-2;

/// Distance of the layer of points that is held from the face that is held, in spacings, from which on it is warned of: beyond the effect of half a cell.
const FAR: f64 = 0.75;

/// Compares masses and loads of the model with integrals over the mesh.
///
/// # Errors
/// As [`loads`](crate::run::loads::loads).
pub(super) fn part<const D: usize>(subject: &Subject<'_, D>) -> Result<Option<Part>, RunError> {
    let (model, conditions) = (subject.model, &subject.rest.conditions);
    let mut part = Part {
        name: "loads",
        line: String::new(),
        figures: Vec::new(),
        findings: Vec::new(),
    };
    let (mut worst, masses) = mass(model, &subject.rest.density, &mut part);
    // in equilibrium masses play no part; a load on a row that is no derivative of an energy does, whose scale is that of its part of the body
    let moves = subject.rest.is_in_time;
    let mut is_needed = vec![moves; masses.len()];
    let loads = Loads::new(model, conditions, BodyForces::Consistent)?;
    let mut count = 0;
    for (condition, c) in conditions.iter().enumerate() {
        let Some(on) = c.load().map(|load| &load.on) else {
            continue;
        };
        let at_once = steady(c);
        let mut load = vec![0.0; model.sites.len() * D];
        at_once.visit(0.0, |field| loads.add(condition, field, &mut load));
        let mut own = Moments::default();
        let centre = centre(model);
        for (site, f) in model.sites.iter().zip(load.chunks_exact(D)) {
            let f = Vector::<D>::from_column_slice(f);
            own.add(&f, &(site.position - centre));
        }
        for (site, f) in load.chunks_exact(D).enumerate() {
            is_needed[site] |= f.iter().any(|&f| f != 0.0) && !model.has_row_of_energy(site);
        }
        let domain = (on, c.components.depends_on_position());
        let exact = at_once.visit(0.0, |field| exact(model, domain, field));
        let figure = compare(model, &c.name, "load", &own, &exact, &mut part);
        worst = worst.max(figure);
        count += 1;
    }
    without_mass(model, &masses, &is_needed, &mut part);
    if model.symmetry() != Symmetry::Symmetric {
        let found = conditions.iter().filter_map(|c| unbalanced(model, c));
        part.findings.extend(found);
    }
    let held = supports(model, conditions, &mut part);
    let each = match count {
        0 => String::new(),
        1 => ", total and first moment of the load".to_owned(),
        n => format!(", totals and first moments of {n} loads"),
    };
    part.line = format!("mass{each} exact to {}{held}", number(worst));
    Ok(Some(part))
}

/// The middle of the mesh, about which moments are taken.
pub(super) fn centre<const D: usize>(model: &Model<D>) -> Vector<D> {
    let (low, high) = model.mesh.bounds();
    (low + high) * 0.5
}

/// A condition as it is at time zero; components that depend on time alone are one, for loads are made of the force of a unit field.
fn steady<const D: usize>(condition: &Condition<D>) -> Condition<D> {
    let in_space = condition.components.depends_on_position();
    let mut steady = condition.clone();
    let of_time = steady.components.0.iter_mut().flatten();
    of_time
        .filter(|e| e.depends_on_time() && !in_space)
        .for_each(|e| *e = Expression::constant(1.0));
    steady
}

/// An integral with that of the norm of its integrand, and the difference of two quadrature rules.
struct Exact<const D: usize> {
    moments: Moments<D>,
    /// `∫ |b|`.
    size: f64,
    /// `∫ |b| |x|` about the middle of the mesh.
    turned: f64,
    uncertain: f64,
}

/// The integral of a load over the mesh, and of the load times the position.
fn exact<const D: usize>(
    model: &Model<D>,
    (on, varies): (&Domain<D>, bool),
    field: impl Fn(&Vector<D>, &Vector<D>) -> Vector<D>,
) -> Exact<D> {
    let mesh = &model.mesh;
    let centre = centre(model);
    let mut found = Exact {
        moments: Moments::default(),
        size: 0.0,
        turned: 0.0,
        uncertain: 0.0,
    };
    let none = Vector::zeros();
    let add = |x: &Vector<D>, n: &Vector<D>, weight: f64, found: &mut Exact<D>| {
        let f = field(x, n) * weight;
        found.size += f.norm();
        found.turned += f.norm() * (x - centre).norm();
        found.moments.add(&f, &(x - centre));
    };
    match on {
        Domain::Facets(facets) => {
            for facet in facets {
                let add = |p: &fem::FacetPoint<D>| add(&p.position, &none, p.weight, &mut found);
                fem::facet_points(mesh, facet, add);
            }
        }
        Domain::Surface(facets) => {
            for facet in facets {
                let add =
                    |p: &fem::FacetPoint<D>| add(&p.position, &p.normal, p.weight, &mut found);
                fem::outward_points(mesh, facet, add);
            }
        }
        Domain::Cells(region) => {
            let inside = region.select_cells(mesh);
            for c in (0..inside.len()).filter(|&c| inside[c]) {
                fem::for_each_point(mesh, c, fem::Rule::Mass, |p| {
                    add(&p.position, &none, p.weight, &mut found);
                });
            }
        }
    }
    if varies {
        found.uncertain = coarser(model, on, &field, &found.moments.force);
    }
    found
}

/// Returns the difference from `fine` of the integral of a field that varies, by the middles of cells or facets alone: other quadrature rules differ by less.
fn coarser<const D: usize>(
    model: &Model<D>,
    on: &Domain<D>,
    field: impl Fn(&Vector<D>, &Vector<D>) -> Vector<D>,
    fine: &Vector<D>,
) -> f64 {
    let mesh = &model.mesh;
    let none = Vector::zeros();
    let mut sum = Vector::<D>::zeros();
    match on {
        Domain::Facets(facets) => {
            for facet in facets {
                let nodes = facet.iter().map(|&n| mesh.nodes[n as usize]);
                let middle = nodes.sum::<Vector<D>>() / facet.len() as f64;
                sum += field(&middle, &none) * fem::facet_area(mesh, facet);
            }
        }
        Domain::Surface(facets) => {
            for facet in facets {
                let nodes = facet.nodes.iter().map(|&n| mesh.nodes[n as usize]);
                let middle = nodes.sum::<Vector<D>>() / facet.nodes.len() as f64;
                let area = mesh.facet_normal_area(facet);
                // of a cut facet only a part is loaded
                let part = fem::facet_area(mesh, &facet.nodes) / mesh.facet_area(&facet.nodes);
                sum += field(&middle, &area.normalize()) * (area.norm() * part);
            }
        }
        Domain::Cells(region) => {
            let inside = region.select_cells(mesh);
            for c in (0..inside.len()).filter(|&c| inside[c]) {
                sum += field(&mesh.centroid(c), &none) * fem::cell_volume(mesh, c);
            }
        }
    }
    (sum - fine).norm()
}

/// Compares two sums; returns the larger of the relative differences of total and first moment.
fn compare<const D: usize>(
    model: &Model<D>,
    name: &str,
    what: &str,
    own: &Moments<D>,
    exact: &Exact<D>,
    part: &mut Part,
) -> f64 {
    if exact.size == 0.0 {
        return 0.0;
    }
    let total = (own.force - exact.moments.force).norm() / exact.size;
    let moment = (own.moment - exact.moments.moment).norm();
    let (low, high) = model.mesh.bounds();
    // a load on the middle alone has no arm
    let arm = exact.turned + 1e-3 * (high - low).norm() * exact.size;
    let moment = moment / arm;
    let uncertain = exact.uncertain / exact.size;
    let worst = total.max(moment);
    for (figure, value) in [("total", total), ("first moment", moment)] {
        part.figures.push(Figure {
            name: format!("{what} `{name}`, {figure}"),
            value,
        });
    }
    // a field that no rule of the mesh integrates exactly is not lost where two rules differ
    let limit = EXACT.max(uncertain);
    if worst > limit {
        let severity = match worst > LOST.max(uncertain) {
            true => Severity::Refusal,
            false => Severity::Warning,
        };
        let place = match exact.moments.force.norm() > 1e-9 * exact.size {
            true => {
                let arm = exact.moments.moment.transpose() * exact.moments.force;
                centre(model) + arm / exact.moments.force.norm_squared()
            }
            false => centre(model),
        };
        part.findings.push(Finding {
            severity,
            value: worst,
            limit,
            warning: lost(
                format!(
                    "the sites of the model carry {} of the {what} `{name}` instead of {} (relative difference of the total {}, of the first moment {}): let the nonlocal zone be at least two points wide wherever it is loaded, or move peridynamics.points.lattice.origin",
                    sizes(&own.force),
                    sizes(&exact.moments.force),
                    number(total),
                    number(moment),
                ),
                worst,
            )
            .at(place.as_slice()),
        });
    }
    worst
}

/// A part of a load or of a mass that no site carries, relative to it.
fn lost(message: String, part: f64) -> Warning {
    Warning::new(Code::Load, message).of(Quantity::Load, part)
}

fn sizes<const D: usize>(force: &Vector<D>) -> String {
    let each: Vec<String> = force.iter().map(|&f| number(f)).collect();
    format!("({})", each.join(", "))
}

/// Compares the mass of the sites with that of the mesh, less voids; the masses of the sites beside the largest difference.
fn mass<const D: usize>(model: &Model<D>, density: &[f64], part: &mut Part) -> (f64, Vec<f64>) {
    let has_mass = density.iter().all(|&d| d > 0.0) && !density.is_empty();
    let of = |material: u16| match has_mass {
        true => density[material as usize],
        false => 1.0,
    };
    let tributary = model.tributary();
    let masses = tributary.masses(model.peridynamic_material(), of);
    let centre = centre(model);
    let (mut own, mut moment) = (0.0, Vector::<D>::zeros());
    for (site, m) in model.sites.iter().zip(&masses) {
        own += m;
        moment += (site.position - centre) * *m;
    }
    let (mut exact, mut turned, mut extent) = (0.0, Vector::<D>::zeros(), 0.0);
    let has_voids = (model.peridynamics.as_ref()).is_some_and(|p| !p.voids.is_empty());
    for c in 0..model.mesh.cell_count() {
        let rho = of(model.material_of_cell(c));
        if has_voids && model.roles[c] == CellRole::Points {
            continue;
        }
        // lumped cells of second order keep the first moment where they are affine only: of those it is that of the shares
        let is_linear = !model.mesh.shapes[c].is_quadratic();
        fem::for_each_point(&model.mesh, c, fem::Rule::Mass, |p| {
            exact += rho * p.weight;
            if is_linear {
                turned += (p.position - centre) * (rho * p.weight);
            }
            extent += (p.position - centre).norm() * (rho * p.weight);
        });
        if !is_linear {
            fem::for_each_share(&model.mesh, c, |n, part, whole| {
                turned += (model.mesh.nodes[n as usize] - centre) * (rho * part * whole);
            });
        }
    }
    if has_voids {
        // what voids leave of the zone is known by the parts of the zone alone
        exact += of(model.peridynamic_material()) * tributary.zone;
        turned = moment;
    }
    let total = (own / exact - 1.0).abs();
    let first = (moment - turned).norm() / extent.max(f64::MIN_POSITIVE);
    for (name, value) in [("mass", total), ("mass, first moment", first)] {
        part.figures.push(Figure {
            name: name.to_owned(),
            value,
        });
    }
    let worst = total.max(first);
    if worst > EXACT {
        part.findings.push(Finding {
            severity: if worst > LOST { Severity::Refusal } else { Severity::Warning },
            value: worst,
            limit: EXACT,
            warning: lost(
                format!(
                    "the sites of the model have the mass {} instead of {} (first moment off by {}, relative): make the nonlocal zone at least two points wide, or move peridynamics.points.lattice.origin",
                    number(own),
                    number(exact),
                    number(first)
                ),
                worst,
            ),
        });
    }
    (worst, masses)
}

/// Refuses a site that stands for no mass, where one is needed.
fn without_mass<const D: usize>(
    model: &Model<D>,
    masses: &[f64],
    is_needed: &[bool],
    part: &mut Part,
) {
    let needed = (0..masses.len()).filter(|&s| is_needed[s]);
    let Some(at) = needed.min_by(|&a, &b| masses[a].total_cmp(&masses[b]).then(a.cmp(&b))) else {
        return;
    };
    let least = masses[at];
    if least > 0.0 {
        return;
    }
    let x = &model.sites[at].position;
    part.findings.push(Finding {
        severity: Severity::Refusal,
        value: least,
        limit: 0.0,
        warning: Warning::new(
            Code::Load,
            format!(
                "the site at {} stands for the mass {}: the lattice of points and the surface of the nonlocal zone leave it none; move peridynamics.points.lattice.origin or refine the lattice",
                sizes(x),
                number(least)
            ),
        )
        .at(x.as_slice()),
    });
}

/// A support or a traction on a surface where a coupling by forces mixes two models: rows there are equations at a place, which know of no surface, so that neither the support nor the load is felt as a whole.
///
/// Measured: of the weight of a plate held there, blending lost 25 to 45 %, balanced 48 %, partial stress 26 %, a splice, which mixes nothing, 0.8 %.
fn unbalanced<const D: usize>(model: &Model<D>, condition: &Condition<D>) -> Option<Finding> {
    let of_load: Vec<Facet>;
    let facets = match (condition.load(), condition.support()) {
        (Some(load), _) => {
            of_load = load.on.facets().into_iter().map(Facet::from).collect();
            &of_load
        }
        (None, Some(Support::Set { facets, .. })) => facets,
        (None, Some(Support::Inside(_)) | None) => return None,
    };
    let has_stress = model.roles.contains(&CellRole::StressElement);
    if !has_stress && !may_bound_zone(model, facets) {
        return None;
    }
    let mixes = |c: usize| match model.roles[c] {
        CellRole::Points => model.zones[c] != Zone::Nonlocal,
        CellRole::StressElement => true,
        CellRole::Element => false,
    };
    let located = model.mesh.locate_facets(facets).ok()?;
    let area = |f: &BoundaryFacet| fem::facet_area(&model.mesh, &f.nodes);
    let all: f64 = located.iter().map(area).sum();
    let mixed: Vec<&BoundaryFacet> = located.iter().filter(|f| mixes(f.cell as usize)).collect();
    let first = mixed.first()?;
    let share = mixed.iter().map(|f| area(f)).sum::<f64>() / all;
    let nodes = first.nodes.iter().map(|&n| model.mesh.nodes[n as usize]);
    let place = nodes.sum::<Vector<D>>() / first.nodes.len() as f64;
    Some(Finding {
        severity: Severity::Refusal,
        value: share,
        limit: 0.0,
        warning: Warning::new(
            Code::Load,
            format!(
                "`{}` acts where the coupling mixes both models, on {:.0} % of its surface, first at {}: the rows there are equations at a place and know of no surface, so that a part of the force is lost; keep the transition zone, and the collar of one horizon around it, off that surface, or couple by truncated",
                condition.name,
                100.0 * share,
                sizes(&place)
            ),
        )
        .at(place.as_slice())
        .remedy(["coupling=truncated"]),
    })
}

/// Looks at every support on a set where it bounds the peridynamic zone; returns a phrase about them for the line of the proof.
fn supports<const D: usize>(
    model: &Model<D>,
    conditions: &[Condition<D>],
    part: &mut Part,
) -> String {
    if model.body().is_none() {
        return String::new();
    }
    let site_of = site_of_node(model);
    let mut held = false;
    for c in conditions {
        let Some(Support::Set { nodes, facets, .. }) = c.support() else {
            continue;
        };
        let nearest = nearest_points(model, &site_of, nodes, facets);
        let h = model.spacing();
        let off = |(x, s): &(Vector<D>, usize)| (model.sites[*s].position - x).norm() / h;
        // a piece of the face beside which no point lies has those of its neighbours: each point counts by the nearest piece
        let mut of_point: BTreeMap<usize, (Vector<D>, usize)> = BTreeMap::new();
        for found in nearest {
            let best = of_point.entry(found.1).or_insert(found);
            if off(&found) < off(best) {
                *best = found;
            }
        }
        let Some(worst) = of_point.values().max_by(|a, b| off(a).total_cmp(&off(b))) else {
            continue;
        };
        held = true;
        let gap = off(worst);
        part.figures.push(Figure {
            name: format!(
                "support `{}`, distance of the points held, in spacings",
                c.name
            ),
            value: gap,
        });
        if gap > FAR {
            part.findings.push(Finding {
                severity: Severity::Warning,
                value: gap,
                limit: FAR,
                warning: Warning::new(
                    Code::Support,
                    format!(
                        "the points that `{}` holds lie up to {gap:.2} spacings inside of its face, at {}: what is prescribed acts there, on a body that much shorter; move peridynamics.points.lattice.origin so that points lie on the face",
                        c.name,
                        sizes(&worst.0)
                    ),
                )
                .at(worst.0.as_slice()),
            });
        }
    }
    match held {
        true => "; supports held everywhere".to_owned(),
        false => String::new(),
    }
}
