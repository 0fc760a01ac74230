//! Places beside points at centroids of cells, expressed through the points around.

use rustc_hash::FxHashMap;

use super::grid::{Follows, gradients};
use crate::{
    model::{Bins, Model, SiteKind},
    shape::Barriers,
    tensor::{Tensor, Vector},
};

/// The site of the point at the centroid of each cell, if it has one.
pub(super) fn centroid_sites<const D: usize>(model: &Model<D>) -> Vec<Option<u32>> {
    let key = |x: &Vector<D>| -> [u64; D] { std::array::from_fn(|i| x[i].to_bits()) };
    let at: FxHashMap<[u64; D], u32> = (0..model.sites.len())
        .filter(|&s| matches!(model.sites[s].kind, SiteKind::Point(_)))
        .map(|s| (key(&model.sites[s].position), s as u32))
        .collect();
    (0..model.mesh.cell_count())
        .map(|c| match model.is_element(c) {
            true => None,
            false => at.get(&key(&model.mesh.centroid(c))).copied(),
        })
        .collect()
}

/// Sites around a point at a centroid.
pub(super) struct Around<const D: usize> {
    /// Edge of the cell of each point; the spacing of nodes.
    size: Vec<f64>,
    bins: Bins<D>,
    barriers: Barriers<D>,
}

impl<const D: usize> Around<D> {
    pub fn new(model: &Model<D>) -> Self {
        let position: Vec<Vector<D>> = model.sites.iter().map(|s| s.position).collect();
        let barriers = model.peridynamics.as_ref();
        let size = |s: usize| match model.point_of(s) {
            Some((body, p)) => body.cloud.volume[p].powf(1.0 / D as f64),
            None => model.spacing(),
        };
        Self {
            size: (0..model.sites.len()).map(size).collect(),
            bins: Bins::new(&position, 2.0 * model.spacing()),
            barriers: Barriers::new(barriers.map_or(Vec::new(), |p| p.barriers.clone())),
        }
    }

    /// A place beside a point, with the gradient that its nearest neighbours give.
    pub fn place(&self, model: &Model<D>, site: u32, x: &Vector<D>) -> Vec<Follows<D>> {
        let at = |s: u32| &model.sites[s as usize].position;
        let centre = at(site);
        for reach in [1.3, 1.8, 2.6, 4.0] {
            let reach = reach * self.size[site as usize];
            let mut near: Vec<u32> = self
                .bins
                .around(centre, reach)
                .map(|s| s as u32)
                .filter(|&s| (at(s) - centre).norm() <= reach)
                .filter(|&s| self.barriers.is_empty() || !self.barriers.cuts(centre, at(s)))
                .collect();
            near.sort_unstable();
            let position: Vec<Vector<D>> = near.iter().map(|&s| *at(s)).collect();
            let gradient = gradients(&position);
            let exact: Tensor<D> = position
                .iter()
                .zip(&gradient)
                .map(|(x, g)| (x - centre) * g.transpose())
                .sum();
            if (exact - Tensor::identity()).amax() > 1e-6 {
                continue;
            }
            let offset = x - centre;
            let follow = |(&s, g): (&u32, Vector<D>)| {
                let own = if s == site { 1.0 } else { 0.0 };
                (s, own + g.dot(&offset), g)
            };
            return near.iter().zip(gradient).map(follow).collect();
        }
        vec![(site, 1.0, Vector::zeros())]
    }
}
