//! Free surfaces, supports, cracks and voids: the distance of a place from them, and the kind of a facet there.

#![deny(clippy::wildcard_enum_match_arm)]

use rustc_hash::FxHashMap;

use super::classes::Skin;
use crate::mesh::boundary::BoundaryFacet;
use crate::mesh::facet_corners;
use crate::model::tributary::{Detail, Parts};
use crate::model::{Model, bin_of};
use crate::scene::conditions::{Condition, Prescribed, Support};
use crate::shape::{Barrier, Barriers};
use crate::tensor::{Tensor, Vector};

/// The cosine of the angle between the normals of two facets above which they lie in one plane.
pub(super) const PLANE: f64 = 0.99;

/// The cosine above which a surface goes on from one facet to the other without an edge: a circle of six facets is still one.
const SMOOTH: f64 = 0.49;

/// Distance, in spacings, up to which a corner lies on a facet.
const TOUCHING: f64 = 1e-6;

/// Kind of a facet of the outer boundary, by the conditions of the scene on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum FacetKind {
    /// No condition is on it.
    Free,
    /// The displacement along its normal is prescribed: a symmetry plane, or a clamp.
    Held,
    /// It has a traction.
    Loaded,
}

/// Determines if a layer of elements could cover the points at the surface of a body.
pub(super) fn skin<const D: usize>(model: &Model<D>) -> Skin {
    let mesh = &model.mesh;
    let cells = 0..mesh.cell_count();
    if !cells.clone().any(|c| model.is_element(c)) {
        return Skin::NoElements;
    }
    let barriers = model.peridynamics.iter().flat_map(|p| &p.barriers);
    let barriers: Vec<_> = barriers.collect();
    if barriers.is_empty() {
        return Skin::Possible;
    }
    let at_surface = mesh.cells_at_boundary();
    // a crack along the face of a cell passes through it, too
    let is_crossed = |c: usize| {
        let (low, high) = mesh.bounds_of(mesh.cell(c));
        let (centre, reach) = (mesh.centroid(c), 0.5 * (high - low).amax() * (1.0 + 1e-9));
        let near = |b: &&Barrier<D>| b.shape().signed_distance(&centre) <= reach;
        at_surface[c] && !model.is_element(c) && barriers.iter().any(near)
    };
    match { cells }.any(is_crossed) {
        true => Skin::Crossed,
        false => Skin::Possible,
    }
}

/// The outer boundary of a body, sorted into bins.
pub(super) struct Boundary<'a, const D: usize> {
    model: &'a Model<D>,
    pub facets: Vec<BoundaryFacet>,
    pub kinds: Vec<FacetKind>,
    pub normals: Vec<Vector<D>>,
    /// The box around each facet.
    bounds: Vec<(Vector<D>, Vector<D>)>,
    bins: FxHashMap<[i64; D], Vec<u32>>,
    reach: f64,
    barriers: Barriers<D>,
    /// The boxes around facets between materials of the points.
    borders: Vec<(Vector<D>, Vector<D>)>,
}

impl<'a, const D: usize> Boundary<'a, D> {
    /// Sorts the boundary of a model for questions of up to `reach` \[m\] about places in a box.
    pub fn new(
        model: &'a Model<D>,
        conditions: &[Condition<D>],
        reach: f64,
        (low, high): (Vector<D>, Vector<D>),
    ) -> Self {
        let mesh = &model.mesh;
        let mut facets = mesh.outer_facets();
        facets.retain(|f| {
            let (from, to) = mesh.bounds_of(&f.nodes);
            (0..D).all(|k| from[k] <= high[k] + reach && to[k] >= low[k] - reach)
        });
        let unit = |f| mesh.facet_normal_area(f).normalize();
        let normals: Vec<Vector<D>> = facets.iter().map(unit).collect();
        let kinds = kinds(model, conditions, &facets, &normals);
        let mut bins: FxHashMap<[i64; D], Vec<u32>> = FxHashMap::default();
        let bounds: Vec<_> = facets.iter().map(|f| mesh.bounds_of(&f.nodes)).collect();
        for (number, (low, high)) in bounds.iter().enumerate() {
            let from = bin_of(&(low - Vector::repeat(reach)), reach);
            let to = bin_of(&(high + Vector::repeat(reach)), reach);
            let counts: [usize; D] = std::array::from_fn(|i| (to[i] - from[i] + 1) as usize);
            for index in 0..counts.iter().product::<usize>() {
                let mut rest = index;
                let key = std::array::from_fn(|i| {
                    let k = rest % counts[i];
                    rest /= counts[i];
                    from[i] + k as i64
                });
                bins.entry(key).or_default().push(number as u32);
            }
        }
        let barriers = model.peridynamics.as_ref();
        Self {
            model,
            facets,
            kinds,
            normals,
            bounds,
            bins,
            reach,
            barriers: Barriers::new(barriers.map_or(Vec::new(), |p| p.barriers.clone())),
            borders: borders(model, reach, (low, high)),
        }
    }

    /// Facets nearer to `x` than `limit`, at most the reach, with their distances.
    pub fn near<'s>(
        &'s self,
        x: &'s Vector<D>,
        limit: f64,
    ) -> impl Iterator<Item = (usize, f64)> + 's {
        self.near_of(x, limit, |_| true)
    }

    /// As [`Boundary::near`], of the facets that are `wanted`.
    pub fn near_of<'s>(
        &'s self,
        x: &'s Vector<D>,
        limit: f64,
        wanted: impl Fn(usize) -> bool + 's,
    ) -> impl Iterator<Item = (usize, f64)> + 's {
        let list = self.bins.get(&bin_of(x, self.reach));
        list.into_iter().flatten().filter_map(move |&f| {
            let f = f as usize;
            let (low, high) = &self.bounds[f];
            // a distance takes far longer than that to the box
            let outside = (low - x).sup(&(x - high)).sup(&Vector::zeros());
            if !wanted(f) || outside.norm_squared() >= limit * limit {
                return None;
            }
            let distance = self.model.mesh.distance_to_facet(x, &self.facets[f].nodes);
            (distance < limit).then_some((f, distance))
        })
    }

    /// Returns true if bonds of another material come nearer to `x` than `limit`: points stand for their material up to half a spacing beyond its border.
    pub fn is_near_border(&self, x: &Vector<D>, limit: f64) -> bool {
        let limit = limit + self.model.spacing();
        self.borders.iter().any(|(low, high)| {
            let outside = (low - x).sup(&(x - high)).sup(&Vector::zeros());
            outside.norm_squared() < limit * limit
        })
    }

    /// The facets in which a surface goes on from one of them without an edge, one entry per facet.
    pub fn smooth_surface(&self, main: usize) -> Vec<bool> {
        let beside = self.beside();
        let mut is_found = vec![false; self.facets.len()];
        is_found[main] = true;
        let mut last = vec![main];
        while let Some(f) = last.pop() {
            for &other in &beside[f] {
                let goes_on = self.normals[f].dot(&self.normals[other]) > SMOOTH;
                if !is_found[other] && goes_on {
                    is_found[other] = true;
                    last.push(other);
                }
            }
        }
        is_found
    }

    /// The facets that each one shares an edge with, or a part of one: those that a patch cuts, and their parts in it, have nodes of their own.
    fn beside(&self) -> Vec<Vec<usize>> {
        let mut beside = vec![Vec::new(); self.facets.len()];
        let limit = TOUCHING * self.model.spacing().min(self.reach);
        for (f, facet) in self.facets.iter().enumerate() {
            let mut at_corners: Vec<usize> = Vec::new();
            for &n in facet_corners::<D>(&facet.nodes) {
                let x = &self.model.mesh.nodes[n as usize];
                at_corners.extend(self.near_of(x, limit, |other| other != f).map(|(o, _)| o));
            }
            at_corners.sort_unstable();
            for of in at_corners.chunk_by(|a, b| a == b) {
                if of.len() + 1 >= D {
                    beside[f].push(of[0]);
                    beside[of[0]].push(f);
                }
            }
        }
        beside
    }

    /// The parts of a smooth surface that are the points', but for those in the plane of its facet `main`.
    pub fn bent_parts(&self, main: usize, surface: &[bool]) -> Parts<D> {
        let n = &self.normals[main];
        let is_bent = |f: usize| surface[f] && self.normals[f].dot(n) <= PLANE;
        let bent = (0..self.facets.len()).filter(|&f| is_bent(f));
        let facets = bent.map(|f| self.facets[f].clone());
        let of_points = facets.filter(|f| !self.model.is_element(f.cell as usize));
        Parts::of_facets(
            self.model,
            &of_points.collect::<Vec<_>>(),
            Detail::Quadrature,
        )
    }

    /// Returns true if a crack or a void is nearer to `x` than `limit`.
    pub fn is_near_crack(&self, x: &Vector<D>, limit: f64) -> bool {
        self.barriers.near(x, limit)
    }
}

/// Adds the forces \[N\] that the tractions of a uniform stress on parts of a surface exert on sites, `D` numbers each.
pub(super) fn add_tractions<const D: usize>(
    parts: &Parts<D>,
    stress: &Tensor<D>,
    force: &mut [f64],
) {
    parts.each_point(|_, weight, normal, follows| {
        let traction = stress * normal * weight;
        for (site, share) in follows {
            for k in 0..D {
                force[*site as usize * D + k] += share * traction[k];
            }
        }
    });
}

/// The boxes around facets between materials, of points that have several, near a box.
fn borders<const D: usize>(
    model: &Model<D>,
    reach: f64,
    (low, high): (Vector<D>, Vector<D>),
) -> Vec<(Vector<D>, Vector<D>)> {
    let used = model.several().map_or(&[][..], |several| several.used());
    let reach = reach + model.spacing();
    let mesh = &model.mesh;
    let of_material = |&material: &u16| {
        let own = (0..mesh.cell_count()).map(|c| model.material_of_cell(c) == material);
        let own: Vec<bool> = own.collect();
        let facets = mesh.interface_facets(&own, &true, &false).into_iter();
        facets.map(|f| mesh.bounds_of(&f.first.nodes))
    };
    let mut boxes: Vec<_> = used.iter().flat_map(of_material).collect();
    boxes
        .retain(|(from, to)| (0..D).all(|k| from[k] <= high[k] + reach && to[k] >= low[k] - reach));
    boxes
}

/// Returns the kind of each facet, by the conditions on it.
fn kinds<const D: usize>(
    model: &Model<D>,
    conditions: &[Condition<D>],
    facets: &[BoundaryFacet],
    normals: &[Vector<D>],
) -> Vec<FacetKind> {
    let mesh = &model.mesh;
    let mut kinds = vec![FacetKind::Free; facets.len()];
    let (low, high) = mesh.bounds();
    let tolerance = 1e-9 * (high - low).norm();
    let mut sorted: FxHashMap<Vec<u32>, usize> = FxHashMap::default();
    let key = |nodes: &[u32]| {
        let mut key = nodes.to_vec();
        key.sort_unstable();
        key
    };
    for (number, facet) in facets.iter().enumerate() {
        sorted.insert(key(&facet.nodes), number);
    }
    for condition in conditions {
        let loaded: Vec<&[u32]> = match &condition.prescribed {
            Prescribed::Load(load) => load.on.facets(),
            Prescribed::Term(term) => term.facets(),
            Prescribed::Displacement(_) | Prescribed::Velocity(_) | Prescribed::Field(_) => {
                Vec::new()
            }
        };
        for nodes in loaded {
            if let Some(&f) = sorted.get(&key(nodes)) {
                kinds[f] = FacetKind::Loaded;
            }
        }
    }
    for condition in conditions.iter().filter(|c| c.holds()) {
        let mut on = vec![false; mesh.nodes.len()];
        let on_all = matches!(condition.prescribed, Prescribed::Field(_));
        match condition.support() {
            Some(Support::Set { nodes, .. }) => nodes.iter().for_each(|&n| on[n as usize] = true),
            Some(Support::Inside(region)) => {
                for (on, x) in on.iter_mut().zip(&mesh.nodes) {
                    *on = region.contains(x, tolerance);
                }
            }
            None => {
                if let Prescribed::Field(field) = &condition.prescribed {
                    for (on, x) in on.iter_mut().zip(&mesh.nodes) {
                        *on = field.at(x).is_some();
                    }
                }
            }
        }
        for (f, facet) in facets.iter().enumerate() {
            let n = &normals[f];
            let along = (0..D).max_by(|&a, &b| n[a].abs().total_cmp(&n[b].abs()));
            let holds = on_all || along.is_some_and(|k| condition.components.0[k].is_some());
            if holds && facet.nodes.iter().all(|&n| on[n as usize]) {
                kinds[f] = FacetKind::Held;
            }
        }
    }
    kinds
}
