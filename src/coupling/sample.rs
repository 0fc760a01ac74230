//! The displacement anywhere in a coupled model: from finite elements, or from the peridynamic points around.

use rustc_hash::FxHashMap;

use crate::{
    coupling::{FitDegree, Model, SiteKind, derivative},
    fem::Locator,
    shape::Barriers,
    tensor::Vector,
};

/// How far from a position its points lie, in spacings.
const AROUND: f64 = 1.6;

/// As far, where cracks hide some of them.
const ASIDE: f64 = 2.4;

/// Finds displacements at any position of the body.
pub struct Sampler<'a, const D: usize> {
    model: &'a Model<D>,
    elements: Locator<D>,
    bins: FxHashMap<[i64; D], Vec<u32>>,
    barriers: Barriers<D>,
}

/// What carries the displacement at a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carrier {
    /// A finite element, by its cell.
    Element(usize),
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
        let mut bins: FxHashMap<[i64; D], Vec<u32>> = FxHashMap::default();
        for (s, site) in model.sites.iter().enumerate() {
            if matches!(site.kind, SiteKind::Point(_)) {
                bins.entry(bin(&site.position, model.spacing()))
                    .or_default()
                    .push(s as u32);
            }
        }
        let barriers = model.peridynamics.as_ref();
        Self {
            model,
            elements,
            bins,
            barriers: Barriers::new(barriers.map_or(Vec::new(), |p| p.barriers.clone())),
        }
    }

    /// The displacement at `x` \[m\]: a site's own where one lies there, else by shape functions, else by an affine fit to the points within 1.6 spacings, or 2.4 beside a crack or a void, behind which no point counts.
    /// `None` outside of the body.
    pub fn displacement(&self, x: &Vector<D>, u: &[f64]) -> Option<Vector<D>> {
        let weights = self.weights(x)?;
        let of_site = |s: u32| Vector::<D>::from_fn(|a, _| u[s as usize * D + a]);
        Some(weights.into_iter().map(|(s, w)| of_site(s) * w).sum())
    }

    /// The sites, with their weights, that the displacement at `x` \[m\] follows; the same for velocities. `None` outside of the body.
    pub fn weights(&self, x: &Vector<D>) -> Option<Vec<(u32, f64)>> {
        let h = self.model.spacing();
        let near = self.points_near(x, AROUND);
        let position = |s: u32| self.model.sites[s as usize].position;
        if let Some(&s) = near.iter().find(|&&s| (position(s) - x).norm() <= 1e-9 * h) {
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
            let weights = derivative::fit(x, &data, FitDegree::Affine)?;
            Some(points.into_iter().zip(weights).collect())
        };
        let seen = self.seen(x, near.clone());
        if seen.len() == near.len() {
            return fitted(near);
        }
        fitted(seen)
            .or_else(|| fitted(self.seen(x, self.points_near(x, ASIDE))))
            .or_else(|| fitted(near))
    }

    /// Those of the points that no crack and no void hides from `x`.
    fn seen(&self, x: &Vector<D>, mut points: Vec<u32>) -> Vec<u32> {
        let reach = ASIDE * self.model.spacing();
        if self.barriers.near(x, reach) {
            let position = |s: u32| &self.model.sites[s as usize].position;
            points.retain(|&s| !self.barriers.cuts(x, position(s)));
        }
        points
    }

    /// What carries the displacement at `x` \[m\]; `None` farther than 1.6 spacings from any point and outside of all elements.
    pub fn carrier(&self, x: &Vector<D>) -> Option<Carrier> {
        if let Some(located) = self.elements.locate(&self.model.mesh, x, 1e-9) {
            return Some(Carrier::Element(located.cell));
        }
        let distance = |s: &u32| (self.model.sites[*s as usize].position - x).norm();
        let near = self.points_near(x, AROUND);
        let seen = self.seen(x, near.clone());
        (if seen.is_empty() { near } else { seen })
            .into_iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)))
            .map(|s| Carrier::Point(s as usize))
    }

    /// Points within so many spacings.
    fn points_near(&self, x: &Vector<D>, spacings: f64) -> Vec<u32> {
        let h = self.model.spacing();
        if h <= 0.0 {
            return Vec::new();
        }
        let (centre, reach) = (bin(x, h), spacings.ceil() as usize);
        let width = 2 * reach + 1;
        let mut found = Vec::new();
        for index in 0..width.pow(D as u32) {
            let mut rest = index;
            let key = std::array::from_fn(|i| {
                let k = rest % width;
                rest /= width;
                centre[i] + k as i64 - reach as i64
            });
            for &s in self.bins.get(&key).into_iter().flatten() {
                if (self.model.sites[s as usize].position - x).norm() <= spacings * h {
                    found.push(s);
                }
            }
        }
        found
    }
}

fn bin<const D: usize>(x: &Vector<D>, size: f64) -> [i64; D] {
    std::array::from_fn(|i| (x[i] / size).floor() as i64)
}
