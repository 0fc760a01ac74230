//! Conditions of a scene on the sites of its model: the sites that are held, and the force on each.

#![deny(clippy::wildcard_enum_match_arm)]

use std::collections::BTreeMap;

use crate::fem;
use crate::mesh::Facet;
use crate::mesh::boundary::BoundaryFacet;
use crate::model::{CellRole, Model, SiteKind};
use crate::observe::summary::ConditionForce;
use crate::run::error::RunError;
use crate::scene::conditions::{Components, Condition, Prescribed, Support};
use crate::scene::load::Domain;
use crate::tensor::Vector;
use crate::{
    model::{
        loaded_places::{may_bound_zone, split_facets},
        tributary::{Detail, Parts},
    },
    parallel,
};

/// Distance from a set, in its own spacings, up to which a peridynamic point is held with the set in any case.
///
/// The first layer lies on the set or half a spacing away, at the corner of a square 0.71 of one; the second layer at least one. Where the first layer lies farther off, the points are held that the set's own places follow.
const FIRST_LAYER: f64 = 0.75;

/// For each node of the mesh its site, if it is one.
pub(crate) fn site_of_node<const D: usize>(model: &Model<D>) -> Vec<Option<u32>> {
    let mut site_of = vec![None; model.mesh.nodes.len()];
    for (site, s) in model.sites.iter().enumerate() {
        if let SiteKind::Node(n) = s.kind {
            site_of[n as usize] = Some(site as u32);
        }
    }
    site_of
}

/// The points in the first layer along facets or nodes.
fn first_layer<const D: usize>(model: &Model<D>, nodes: &[u32], facets: &[Facet]) -> Vec<usize> {
    let mesh = &model.mesh;
    let (mut lo, mut hi) = (
        Vector::<D>::repeat(f64::INFINITY),
        Vector::<D>::repeat(f64::NEG_INFINITY),
    );
    for &n in nodes {
        lo = lo.inf(&mesh.nodes[n as usize]);
        hi = hi.sup(&mesh.nodes[n as usize]);
    }
    parallel::filter_map(model.sites.len(), 1, |site| {
        let s = &model.sites[site];
        let (body, point) = model.point_of(site)?;
        let reach = FIRST_LAYER * body.cloud.volume[point].powf(1.0 / D as f64);
        let x = &s.position;
        if (0..D).any(|k| x[k] < lo[k] - reach || x[k] > hi[k] + reach) {
            return None;
        }
        let near = if facets.is_empty() {
            nodes
                .iter()
                .any(|&n| (mesh.nodes[n as usize] - x).norm() <= reach)
        } else {
            facets.iter().any(|f| mesh.distance_to_facet(x, f) <= reach)
        };
        near.then_some(site)
    })
}

/// The points nearest to a set where it bounds the peridynamic zone: of each piece of its facets, a spacing wide, or of each node of a set without facets, the nearest of the points that it follows.
pub(crate) fn nearest_points<const D: usize>(
    model: &Model<D>,
    site_of: &[Option<u32>],
    nodes: &[u32],
    facets: &[Facet],
) -> Vec<(Vector<D>, usize)> {
    if model.body().is_none() {
        return Vec::new();
    }
    let parts = if facets.is_empty() {
        // a node in the middle of an edge follows the ends, or is no node of the model's mesh
        let free = nodes
            .iter()
            .filter(|&&n| site_of[n as usize].is_none() && model.is_placed(n));
        let free: Vec<Vector<D>> = free.map(|&n| model.mesh.nodes[n as usize]).collect();
        Parts::of_places(model, &free)
    } else if !may_bound_zone(model, facets) {
        return Vec::new();
    } else {
        let located = model.mesh.locate_facets(facets).unwrap_or_default();
        let mut zone = located;
        zone.retain(|f| !model.is_element(f.cell as usize));
        Parts::of_facets(model, &zone, Detail::Centre)
    };
    let is_point = |s: u32| matches!(model.sites[s as usize].kind, SiteKind::Point(_));
    let nearest = |(x, follows): (&Vector<D>, &[(u32, f64, Vector<D>)])| {
        let distance = |s: u32| (model.sites[s as usize].position - x).norm();
        let points = follows.iter().map(|f| f.0).filter(|&s| is_point(s));
        let first = points.min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)))?;
        // a place on the seam is held with the nodes there
        let on_node = follows
            .iter()
            .any(|f| !is_point(f.0) && distance(f.0) < distance(first));
        (!on_node).then_some((*x, first as usize))
    };
    parts.places().filter_map(nearest).collect()
}

/// The condition that holds each dof, by its number: the last one that does.
///
/// # Errors
/// [`RunError::Idle`] for a condition that meets no site.
pub(crate) fn holders<const D: usize>(
    model: &Model<D>,
    conditions: &[Condition<D>],
) -> Result<Vec<Option<usize>>, RunError> {
    let mut holder = vec![None; model.sites.len() * D];
    let site_of = site_of_node(model);
    let (lo, hi) = model.mesh.bounds();
    let tolerance = 1e-9 * (hi - lo).norm();
    for (number, condition) in conditions.iter().enumerate() {
        if let Prescribed::Field(field) = &condition.prescribed {
            for (site, s) in model.sites.iter().enumerate() {
                if field.at(&s.position).is_some() {
                    holder[site * D..][..D].fill(Some(number));
                }
            }
        }
        let Some(support) = condition.support() else {
            continue;
        };
        let sites: Vec<usize> = match support {
            Support::Set { nodes, facets, .. } => {
                let on_nodes = nodes.iter().filter_map(|&n| site_of[n as usize]);
                let nearest = nearest_points(model, &site_of, nodes, facets);
                on_nodes
                    .map(|s| s as usize)
                    .chain(first_layer(model, nodes, facets))
                    .chain(nearest.into_iter().map(|(_, s)| s))
                    .collect()
            }
            Support::Inside(region) => (0..model.sites.len())
                .filter(|&s| region.contains(&model.sites[s].position, tolerance))
                .collect(),
        };
        if sites.is_empty() {
            return Err(RunError::Idle {
                condition: condition.name.clone(),
                remedy: "name a set on the boundary, or enlarge the shape to hold nodes or points",
            });
        }
        for site in sites {
            for k in (0..D).filter(|&k| condition.components.0[k].is_some()) {
                holder[site * D + k] = Some(number);
            }
        }
    }
    Ok(holder)
}

/// The prescribed displacement of a dof that the condition `holder` holds, at time `t`.
pub(crate) fn displacement<const D: usize>(
    model: &Model<D>,
    holder: &Condition<D>,
    dof: usize,
    t: f64,
) -> f64 {
    let x = &model.sites[dof / D].position;
    match &holder.prescribed {
        Prescribed::Field(field) => field.at(x).map_or(0.0, |u| u[dof % D]),
        Prescribed::Displacement(_)
        | Prescribed::Velocity(_)
        | Prescribed::Load(_)
        | Prescribed::Term(_) => holder.components.at_time(dof % D, x, t).unwrap_or(0.0),
    }
}

type Held = (Vec<Option<f64>>, Vec<Option<usize>>);

/// The prescribed displacement of each dof at time `t`, and the condition that prescribes it.
///
/// # Errors
/// [`RunError::Idle`] for a condition that meets no site.
pub fn supports<const D: usize>(
    model: &Model<D>,
    conditions: &[Condition<D>],
    t: f64,
) -> Result<Held, RunError> {
    let holder = holders(model, conditions)?;
    let mut prescribed: Vec<Option<f64>> = vec![None; holder.len()];
    let mut by_function: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (dof, held) in holder.iter().enumerate() {
        let Some(h) = *held else { continue };
        match is_function(&conditions[h], dof % D) {
            true => by_function.entry((h, dof % D)).or_default().push(dof),
            false => prescribed[dof] = Some(displacement(model, &conditions[h], dof, t)),
        }
    }
    for ((h, axis), dofs) in by_function {
        let values = values_at_dofs(model, &conditions[h].components, axis, &dofs, t);
        for (dof, value) in dofs.into_iter().zip(values) {
            prescribed[dof] = Some(value);
        }
    }
    Ok((prescribed, holder))
}

/// Returns true if a component of a condition is a function of position, which is evaluated for many values at once.
pub(crate) fn is_function<const D: usize>(condition: &Condition<D>, axis: usize) -> bool {
    let component = condition.components.0[axis].as_ref();
    component.is_some_and(|e| e.function().is_some() && e.depends_on_position())
}

/// The values of a component at the sites of some dofs.
pub(crate) fn values_at_dofs<const D: usize>(
    model: &Model<D>,
    components: &Components<D>,
    axis: usize,
    dofs: &[usize],
    t: f64,
) -> Vec<f64> {
    let places = dofs.iter().map(|dof| model.sites[dof / D].position);
    let places: Vec<Vector<D>> = places.collect();
    components.values(axis, &places, t).unwrap_or_default()
}

/// Parts of a model on which a load acts; the force of any field follows from them without another search.
#[derive(Clone, Debug)]
struct LoadTarget<const D: usize> {
    condition: usize,
    /// Facets of finite elements.
    facets: Vec<Facet>,
    /// Facets of finite elements under a load that knows their normals.
    pressed: Vec<BoundaryFacet>,
    /// Finite elements.
    cells: Vec<usize>,
    /// The rest, of which points have the load.
    parts: Parts<D>,
    detail: Detail,
}

/// Distribution of a body force over the nodes of a finite element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyForces {
    /// By its shape functions, as equilibrium asks for.
    Consistent,
    /// As motion with lumped masses asks for, [`fem::lumped_body_force_vector`]: a body that falls freely has no stress.
    Lumped,
}

/// The loads of a scene on the sites of its model.
///
/// By virtual work: a finite element gives its nodes their consistent forces, a part of the peridynamic zone or of its surface gives the sites that it follows the force on it. Total and first moment are those of the load itself. In a motion with lumped
/// masses body forces are shared out as these are.
pub(crate) struct Loads<'a, const D: usize> {
    model: &'a Model<D>,
    body_forces: BodyForces,
    targets: Vec<LoadTarget<D>>,
}

impl<'a, const D: usize> Loads<'a, D> {
    /// Finds the parts of a model on which each load of `conditions` acts.
    ///
    /// # Errors
    /// [`RunError::Idle`] for a load that meets no site.
    pub fn new(
        model: &'a Model<D>,
        conditions: &[Condition<D>],
        body_forces: BodyForces,
    ) -> Result<Self, RunError> {
        let mut loads = Self {
            model,
            body_forces,
            targets: Vec::new(),
        };
        for (number, condition) in conditions.iter().enumerate() {
            let Some(load) = condition.load() else {
                continue;
            };
            let detail = match condition.varies_in_space() {
                true => Detail::Quadrature,
                false => Detail::Centre,
            };
            let mut pressed = Vec::new();
            let (facets, cells, parts) = match &load.on {
                Domain::Facets(facets) => {
                    let (own, zone) = split_facets(model, facets);
                    let parts = Parts::of_facets(model, &zone, detail);
                    (own, Vec::new(), parts)
                }
                Domain::Surface(facets) => {
                    // with the nodes that its cell has in the model: cells at the seam are linear
                    let present = facets.iter().map(|f| model.mesh.present_facet(f));
                    let (own, zone): (Vec<_>, Vec<_>) =
                        present.partition(|f| model.is_element(f.cell as usize));
                    pressed = own;
                    let parts = Parts::of_facets(model, &zone, detail);
                    (Vec::new(), Vec::new(), parts)
                }
                Domain::Cells(region) => {
                    let inside = region.select_cells(&model.mesh);
                    let own = (0..inside.len()).filter(|&c| inside[c] && model.is_element(c));
                    let own = own.collect();
                    let zone: Vec<bool> = (0..inside.len())
                        .map(|c| inside[c] && model.roles[c] == CellRole::Points)
                        .collect();
                    let parts = match zone.contains(&true) {
                        true => Parts::of_cells(model, &zone, detail),
                        false => Parts::default(),
                    };
                    (Vec::new(), own, parts)
                }
            };
            let target = LoadTarget {
                condition: number,
                facets,
                pressed,
                cells,
                parts,
                detail,
            };
            let mut met = false;
            loads.each(&target, |_, _| Vector::zeros(), |_, _| met = true);
            if !met {
                return Err(RunError::Idle {
                    condition: condition.name.clone(),
                    remedy: "name a set on the boundary of the body, or enlarge the shape: it acts on the cells whose centroid it holds",
                });
            }
            loads.targets.push(target);
        }
        Ok(loads)
    }

    /// The conditions that load, by their numbers.
    pub fn conditions(&self) -> impl Iterator<Item = usize> + '_ {
        self.targets.iter().map(|b| b.condition)
    }

    /// Adds the force of one condition with the field `field`, of place and outward unit normal, to `load`; returns the sum of what it added.
    pub fn add(
        &self,
        condition: usize,
        field: impl Fn(&Vector<D>, &Vector<D>) -> Vector<D>,
        load: &mut [f64],
    ) -> Vector<D> {
        let mut sum = Vector::zeros();
        for target in self.targets.iter().filter(|b| b.condition == condition) {
            self.each(target, &field, |site, f| {
                sum += f;
                for k in 0..D {
                    load[site * D + k] += f[k];
                }
            });
        }
        sum
    }

    /// Adds the force of a condition, by its number, at the time `t` to `load`; returns the sum of what it added.
    pub fn add_condition(
        &self,
        condition: &Condition<D>,
        number: usize,
        t: f64,
        load: &mut [f64],
    ) -> Vector<D> {
        condition.visit(t, |field| self.add(number, field, load))
    }

    /// Hands each site's force to `add`.
    fn each(
        &self,
        target: &LoadTarget<D>,
        field: impl Fn(&Vector<D>, &Vector<D>) -> Vector<D>,
        mut add: impl FnMut(usize, Vector<D>),
    ) {
        let mesh = &self.model.mesh;
        // a node at the seam that is no site hands its force on
        let mut on_node = |n: u32, f: Vector<D>| {
            let sites = self.model.node_shares(n as usize);
            sites.for_each(|(site, w)| add(site as usize, f * w));
        };
        let none = Vector::zeros();
        for facet in &target.facets {
            for (n, f) in fem::traction_vector(mesh, facet, |x| field(x, &none)) {
                on_node(n, f);
            }
        }
        for facet in &target.pressed {
            for (n, f) in fem::outward_traction_vector(mesh, facet, &field) {
                on_node(n, f);
            }
        }
        for &c in &target.cells {
            let force = |x: &Vector<D>| field(x, &none);
            match self.body_forces {
                BodyForces::Consistent => {
                    for (n, f) in fem::body_force_vector(mesh, c, force) {
                        let sites = self.model.node_shares(n as usize);
                        sites.for_each(|(site, w)| add(site as usize, f * w));
                    }
                }
                BodyForces::Lumped => {
                    for (n, f) in fem::lumped_body_force_vector(mesh, c, force) {
                        let sites = self.model.mass_shares(n as usize);
                        sites.for_each(|(site, w)| add(site as usize, f * w));
                    }
                }
            }
        }
        target.parts.each(target.detail, field, add);
    }
}

/// The applied force of each dof at time `t`, and that of each condition.
///
/// # Errors
/// [`RunError::Idle`] for a load that meets no site.
pub fn loads<const D: usize>(
    model: &Model<D>,
    conditions: &[Condition<D>],
    t: f64,
) -> Result<(Vec<f64>, Vec<ConditionForce>), RunError> {
    let loads = Loads::new(model, conditions, BodyForces::Consistent)?;
    let mut load = vec![0.0; model.sites.len() * D];
    let mut applied = Vec::new();
    for number in loads.conditions() {
        let condition = &conditions[number];
        let force = loads.add_condition(condition, number, t, &mut load);
        applied.push(ConditionForce {
            condition: condition.name.clone(),
            force: force.iter().copied().collect(),
        });
    }
    Ok((load, applied))
}
