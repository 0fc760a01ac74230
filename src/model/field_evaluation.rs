//! The displacement anywhere in a coupled model: from finite elements, or from the peridynamic points around.

use std::sync::OnceLock;

use rustc_hash::FxHashMap;

use crate::{
    fem::Locator,
    model::{FitDegree, Model, SiteKind, bins::bin_of, least_squares_gradient},
    shape::Barriers,
    tensor::{Vector, padded},
};

/// Search radius for the points around a position, in spacings.
const AROUND: f64 = 1.6;

/// The same, where cracks hide some of them.
const ASIDE: f64 = 2.4;

/// The same, where nodes beside the seam have to help.
const FAR: f64 = 4.0;

/// Sites by cells one spacing wide.
type Bins<const D: usize> = FxHashMap<[i64; D], Vec<u32>>;

/// Finds displacements at any position of the body.
pub struct Sampler<'a, const D: usize> {
    model: &'a Model<D>,
    elements: Locator<D>,
    points: Bins<D>,
    /// Nodes of elements, sorted when first asked for.
    nodes: OnceLock<Bins<D>>,
    barriers: Barriers<D>,
}

/// Carrier of the displacement at a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Carrier {
    /// A finite element, by its cell, and the reference coordinates of the position in it.
    Element(usize, [f64; 3]),
    /// The points around; the nearest one, by its site.
    Point(usize),
}

impl<'a, const D: usize> Sampler<'a, D> {
    /// Sorts the cells and points of a model.
    pub fn new(model: &'a Model<D>) -> Self {
        let elements = Locator::new(
            &model.mesh,
            (0..model.mesh.cell_count()).filter(|&c| model.is_element(c)),
        );
        let barriers = model.peridynamics.as_ref();
        Self {
            model,
            elements,
            points: bins(model, |kind| matches!(kind, SiteKind::Point(_))),
            nodes: OnceLock::new(),
            barriers: Barriers::new(barriers.map_or(Vec::new(), |p| p.barriers.clone())),
        }
    }

    /// The displacement at `x` \[m\]: a site's own where one lies there, else by shape functions, else by an affine fit to the points within 1.6 spacings, or 2.4 beside a crack or a void, behind which no point counts.
    /// If these lie in one line (or plane), nodes of elements within 2.4 or 4 spacings help, or the nearest point stands alone. `None` outside of the body.
    pub fn displacement(&self, x: &Vector<D>, u: &[f64]) -> Option<Vector<D>> {
        let weights = self.weights(x)?;
        let of_site = |s: u32| Vector::<D>::from_fn(|a, _| u[s as usize * D + a]);
        Some(weights.into_iter().map(|(s, w)| of_site(s) * w).sum())
    }

    /// The sites, with their weights, that the displacement at `x` \[m\] follows; the same for velocities. `None` outside of the body.
    pub fn weights(&self, x: &Vector<D>) -> Option<Vec<(u32, f64)>> {
        let h = self.model.spacing();
        let near = self.near(&self.points, x, AROUND);
        let position = |s: u32| self.model.sites[s as usize].position;
        let distance = |s: u32| (position(s) - x).norm();
        if let Some(&s) = near.iter().find(|&&s| distance(s) <= 1e-9 * h) {
            return Some(vec![(s, 1.0)]);
        }
        if let Some(located) = self.elements.locate(&self.model.mesh, x, 1e-9) {
            let nodes = self.model.mesh.cell(located.cell);
            let row = |(&n, &w): (&u32, &f64)| {
                let row = self.model.node_transfer.row(n as usize);
                row.map(move |(site, v)| (site, v * w)).collect::<Vec<_>>()
            };
            return Some(nodes.iter().zip(&located.shape).flat_map(row).collect());
        }
        let fitted = |points: Vec<u32>| {
            let data: Vec<Vector<D>> = points.iter().map(|&s| position(s)).collect();
            let weights = least_squares_gradient::fit(x, &data, FitDegree::Affine)?;
            Some(points.into_iter().zip(weights).collect())
        };
        let with_nodes = |spacings: f64| {
            let is_node = |kind: &SiteKind| matches!(kind, SiteKind::Node(_));
            let nodes = self.nodes.get_or_init(|| bins(self.model, is_node));
            let mut sites = self.near(&self.points, x, spacings);
            sites.extend(self.near(nodes, x, spacings));
            fitted(self.seen(x, sites))
        };
        let seen = self.seen(x, near.clone());
        let nearest = seen.iter().copied();
        let nearest = nearest.min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
        let Some(nearest) = nearest else {
            return fitted(self.seen(x, self.near(&self.points, x, ASIDE)))
                .or_else(|| fitted(near));
        };
        fitted(seen)
            .or_else(|| fitted(self.seen(x, self.near(&self.points, x, ASIDE))))
            .or_else(|| with_nodes(ASIDE))
            .or_else(|| with_nodes(FAR))
            .or_else(|| Some(vec![(nearest, 1.0)]))
    }

    /// Those of the points that no crack and no void hides from `x`.
    fn seen(&self, x: &Vector<D>, mut points: Vec<u32>) -> Vec<u32> {
        let reach = FAR * self.model.spacing();
        if self.barriers.near(x, reach) {
            let position = |s: u32| &self.model.sites[s as usize].position;
            points.retain(|&s| !self.barriers.cuts(x, position(s)));
        }
        points
    }

    /// Returns the carrier of the displacement at `x` \[m\]; `None` farther than 1.6 spacings from any point and outside of all elements.
    pub fn carrier(&self, x: &Vector<D>) -> Option<Carrier> {
        if let Some(located) = self.elements.locate(&self.model.mesh, x, 1e-9) {
            return Some(Carrier::Element(located.cell, padded(&located.reference)));
        }
        let distance = |s: &u32| (self.model.sites[*s as usize].position - x).norm();
        let near = self.near(&self.points, x, AROUND);
        let seen = self.seen(x, near.clone());
        (if seen.is_empty() { near } else { seen })
            .into_iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)))
            .map(|s| Carrier::Point(s as usize))
    }

    /// Sites within so many spacings.
    fn near(&self, bins: &Bins<D>, x: &Vector<D>, spacings: f64) -> Vec<u32> {
        let h = self.model.spacing();
        if h <= 0.0 {
            return Vec::new();
        }
        let (centre, reach) = (bin_of(x, h), spacings.ceil() as usize);
        let width = 2 * reach + 1;
        let mut found = Vec::new();
        for index in 0..width.pow(D as u32) {
            let mut rest = index;
            let key = std::array::from_fn(|i| {
                let k = rest % width;
                rest /= width;
                centre[i] + k as i64 - reach as i64
            });
            for &s in bins.get(&key).into_iter().flatten() {
                if (self.model.sites[s as usize].position - x).norm() <= spacings * h {
                    found.push(s);
                }
            }
        }
        found
    }
}

/// Sites of some kinds by where they lie; none where there are no points.
fn bins<const D: usize>(model: &Model<D>, wanted: impl Fn(&SiteKind) -> bool) -> Bins<D> {
    let h = model.spacing();
    let mut bins = Bins::default();
    if h > 0.0 {
        for (s, site) in model.sites.iter().enumerate() {
            if wanted(&site.kind) {
                let list: &mut Vec<u32> = bins.entry(bin_of(&site.position, h)).or_default();
                list.push(s as u32);
            }
        }
    }
    bins
}
