//! Conditions of a scene on the sites of its model: which sites are held, and what force each takes.

use rayon::prelude::*;

use super::conditions::{Condition, Prescribed, Support};
use super::run::RunError;
use crate::coupling::{Model, SiteKind};
use crate::fem;
use crate::mesh::Facet;
use crate::tensor::Vector;

/// How far from a set a peridynamic point may lie, in its own spacings, to follow a condition on the set.
///
/// The first layer lies on the set or half a spacing away, at the corner of a square 0.71 of one; the second layer at least one.
const FIRST_LAYER: f64 = 0.75;

/// For each node of the mesh its site, if it is one.
fn site_of_node<const D: usize>(model: &Model<D>) -> Vec<Option<u32>> {
    let mut site_of = vec![None; model.mesh.nodes.len()];
    for (site, s) in model.sites.iter().enumerate() {
        if let SiteKind::Node(n) = s.kind {
            site_of[n as usize] = Some(site as u32);
        }
    }
    site_of
}

/// The points in the first layer along facets or nodes, with their spacing.
fn first_layer<const D: usize>(
    model: &Model<D>,
    nodes: &[u32],
    facets: &[Facet],
) -> Vec<(usize, f64)> {
    let mesh = &model.mesh;
    let (mut lo, mut hi) = (
        Vector::<D>::repeat(f64::INFINITY),
        Vector::<D>::repeat(f64::NEG_INFINITY),
    );
    for &n in nodes {
        lo = lo.inf(&mesh.nodes[n as usize]);
        hi = hi.sup(&mesh.nodes[n as usize]);
    }
    (0..model.sites.len())
        .into_par_iter()
        .filter_map(|site| {
            let s = &model.sites[site];
            if !matches!(s.kind, SiteKind::Point(_)) {
                return None;
            }
            let h = s.volume.powf(1.0 / D as f64);
            let reach = FIRST_LAYER * h;
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
            near.then_some((site, h))
        })
        .collect()
}

/// The condition that holds each dof, by its number: the last one that does.
///
/// # Errors
/// [`RunError::Idle`] for a condition that meets no site.
pub(super) fn holders<const D: usize>(
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
                let layer = first_layer(model, nodes, facets);
                on_nodes
                    .map(|s| s as usize)
                    .chain(layer.into_iter().map(|(s, _)| s))
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
pub(super) fn displacement<const D: usize>(
    model: &Model<D>,
    holder: &Condition<D>,
    dof: usize,
    t: f64,
) -> f64 {
    let x = &model.sites[dof / D].position;
    match &holder.prescribed {
        Prescribed::Field(field) => field.at(x).map_or(0.0, |u| u[dof % D]),
        _ => holder.components.at_time(dof % D, x, t).unwrap_or(0.0),
    }
}

type Held = (Vec<Option<f64>>, Vec<Option<usize>>);

/// The prescribed displacement of each dof at time `t`, and the condition that prescribes it.
///
/// # Errors
/// As [`holders`].
pub(super) fn supports<const D: usize>(
    model: &Model<D>,
    conditions: &[Condition<D>],
    t: f64,
) -> Result<Held, RunError> {
    let holder = holders(model, conditions)?;
    let prescribed = holder
        .iter()
        .enumerate()
        .map(|(dof, holder)| holder.map(|h| displacement(model, &conditions[h], dof, t)))
        .collect();
    Ok((prescribed, holder))
}

/// What a load acts on; the force of any field follows from it without another search.
#[derive(Clone, Debug)]
enum Bearer {
    /// Facets of finite elements, and points in the first layer with their shares of the area.
    Surface {
        facets: Vec<Facet>,
        points: Vec<(usize, f64)>,
    },
    /// Cells, and points.
    Body {
        cells: Vec<usize>,
        points: Vec<usize>,
    },
}

/// The loads of a scene on the sites of its model.
///
/// Every site takes the load of its own model: a node the consistent force of all cells around it, a point its volume
/// times the body force, and in the first layer its share of the facets' area times the traction.
pub(super) struct Loads<'a, const D: usize> {
    model: &'a Model<D>,
    site_of: Vec<Option<u32>>,
    bearers: Vec<(usize, Bearer)>,
}

impl<'a, const D: usize> Loads<'a, D> {
    /// Finds what each load of `conditions` acts on.
    ///
    /// # Errors
    /// [`RunError::Idle`] for a load that meets no site.
    pub fn new(model: &'a Model<D>, conditions: &[Condition<D>]) -> Result<Self, RunError> {
        let mut loads = Self {
            model,
            site_of: site_of_node(model),
            bearers: Vec::new(),
        };
        for (number, condition) in conditions.iter().enumerate() {
            let bearer = match &condition.prescribed {
                Prescribed::Traction(facets) => surface(model, facets),
                Prescribed::BodyForce(region) => Bearer::Body {
                    cells: (0..model.mesh.cell_count())
                        .filter(|&c| region.contains(&model.mesh.centroid(c), 0.0))
                        .filter(|&c| model.node_takes(c))
                        .collect(),
                    points: (0..model.sites.len())
                        .filter(|&s| {
                            let site = &model.sites[s];
                            matches!(site.kind, SiteKind::Point(_))
                                && region.contains(&site.position, 0.0)
                        })
                        .collect(),
                },
                _ => continue,
            };
            let mut met = false;
            loads.each(&bearer, |_| Vector::zeros(), |_, _| met = true);
            if !met {
                return Err(RunError::Idle {
                    condition: condition.name.clone(),
                    remedy: "name a set on the boundary of the body, or enlarge the shape",
                });
            }
            loads.bearers.push((number, bearer));
        }
        Ok(loads)
    }

    /// The conditions that load, by their numbers.
    pub fn conditions(&self) -> impl Iterator<Item = usize> + '_ {
        self.bearers.iter().map(|(number, _)| *number)
    }

    /// Adds the force of one condition with the field `field` to `load`; returns the sum of what it added.
    pub fn add(
        &self,
        condition: usize,
        field: impl Fn(&Vector<D>) -> Vector<D>,
        load: &mut [f64],
    ) -> Vector<D> {
        let mut sum = Vector::zeros();
        for (_, bearer) in self.bearers.iter().filter(|(n, _)| *n == condition) {
            self.each(bearer, &field, |site, f| {
                sum += f;
                for k in 0..D {
                    load[site * D + k] += f[k];
                }
            });
        }
        sum
    }

    /// Hands each site's force to `add`.
    fn each(
        &self,
        bearer: &Bearer,
        field: impl Fn(&Vector<D>) -> Vector<D>,
        mut add: impl FnMut(usize, Vector<D>),
    ) {
        let mesh = &self.model.mesh;
        let mut on_node = |n: u32, f: Vector<D>| {
            if let Some(site) = self.site_of[n as usize] {
                add(site as usize, f);
            }
        };
        match bearer {
            Bearer::Surface { facets, points } => {
                for facet in facets {
                    for (n, f) in fem::traction_vector(mesh, facet, &field) {
                        on_node(n, f);
                    }
                }
                for &(site, share) in points {
                    add(site, field(&self.model.sites[site].position) * share);
                }
            }
            Bearer::Body { cells, points } => {
                for &c in cells {
                    for (n, f) in fem::body_force_vector(mesh, c, &field) {
                        on_node(n, f);
                    }
                }
                for &site in points {
                    let s = &self.model.sites[site];
                    add(site, field(&s.position) * s.volume);
                }
            }
        }
    }
}

/// The facets whose nodes take a traction, and the share of each point of the first layer in the area of those that no
/// element carries.
fn surface<const D: usize>(model: &Model<D>, facets: &[Facet]) -> Bearer {
    let mesh = &model.mesh;
    // a facet without a cell is an element's as far as anybody knows, and carries no point
    let located = mesh.locate_facets(facets).ok();
    let cell = |f: usize| located.as_ref().map(|l| l[f].cell as usize);
    let on_nodes = (0..facets.len())
        .filter(|&f| cell(f).is_none_or(|c| model.node_takes(c)))
        .map(|f| facets[f].clone())
        .collect();
    let on_points: Vec<Facet> = located
        .into_iter()
        .flatten()
        .filter(|f| !model.is_element(f.cell as usize))
        .map(|f| f.nodes)
        .collect();
    Bearer::Surface {
        facets: on_nodes,
        points: shares(model, &on_points),
    }
}

/// The share of each point of the first layer in the area of `on_points`.
fn shares<const D: usize>(model: &Model<D>, on_points: &[Facet]) -> Vec<(usize, f64)> {
    let mesh = &model.mesh;
    let mut nodes: Vec<u32> = on_points.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    if nodes.is_empty() {
        return Vec::new();
    }
    let layer = first_layer(model, &nodes, on_points);
    let area: f64 = on_points.iter().map(|f| fem::facet_area(mesh, f)).sum();
    let face = |h: f64| h.powi(D as i32 - 1);
    let sum: f64 = layer.iter().map(|(_, h)| face(*h)).sum();
    layer
        .into_iter()
        .map(|(site, h)| (site, area * face(h) / sum))
        .collect()
}

/// The applied force of each dof at time `t`, and the sum of the sizes of the forces of all conditions.
///
/// # Errors
/// As [`Loads::new`].
pub(super) fn loads<const D: usize>(
    model: &Model<D>,
    conditions: &[Condition<D>],
    t: f64,
) -> Result<(Vec<f64>, f64), RunError> {
    let loads = Loads::new(model, conditions)?;
    let mut load = vec![0.0; model.sites.len() * D];
    let mut applied = 0.0;
    for number in loads.conditions() {
        let field = |x: &Vector<D>| conditions[number].components.vector(x, t);
        applied += loads.add(number, field, &mut load).norm();
    }
    Ok((load, applied))
}
