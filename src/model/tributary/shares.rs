//! Shares of loads and masses that nodes which are no sites hand on, where the fit of their displacement cannot give them.
//!
//! A node of the seam follows a fit to the sites within a horizon: to points alone where elements are wider than that, so that it is extrapolated. The transpose of such weights hands a few points many times the volume
//! of their cells, and others a negative one, for which no row can stand. Any weights that are exact for affine fields keep totals and first moments, so these are as near as possible to the volumes of the sites around, and none is negative.

use crate::{
    assembly::Transfer,
    model::{Bins, Model},
    parallel,
    peridynamics::bounded_least_norm::positive_weights,
    shape::Barriers,
    tensor::Vector,
};

/// Search radii for sites around a node, over the longest edge of the cells around: larger where those found lie to one side of it.
const REACH: [f64; 3] = [1.1, 1.6, 2.4];

impl<const D: usize> Model<D> {
    /// Sites and weights that a node hands its loads and masses on to: those that it follows, or [`shares`] where these leave a site without a volume.
    pub(crate) fn node_shares(&self, node: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let transfer = self
            .tributary
            .shares
            .as_ref()
            .unwrap_or(&self.node_transfer);
        transfer.row(node)
    }

    /// Sites and weights that a node hands its mass on to, and in time a body force.
    pub(crate) fn mass_shares(&self, node: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let tributary = &self.tributary;
        let own = tributary.inertia.as_deref().unwrap_or(tributary);
        let transfer = own.shares.as_ref().unwrap_or(&self.node_transfer);
        transfer.row(node)
    }
}

/// The weights of all nodes beside an embedded patch: its ties hand on displacements by weights of either sign, and masses by those of the elements around.
fn of_patch<const D: usize>(model: &Model<D>) -> Transfer {
    let shares = &model.mesh.embedded.shares;
    let row = |n: usize| -> Vec<(u32, f64)> {
        let own = |n: usize| model.node_transfer.row(n);
        match shares.get(&(n as u32)) {
            None => own(n).collect(),
            Some(row) => (row.iter())
                .flat_map(|&(m, w)| own(m as usize).map(move |(site, v)| (site, v * w)))
                .collect(),
        }
    };
    Transfer::from_rows(model.sites.len(), (0..model.mesh.nodes.len()).map(row))
}

/// The weights of all nodes, none of them negative where sites lie all around; none of a model whose nodes follow no such fit.
pub(super) fn shares<const D: usize>(model: &Model<D>) -> Option<Transfer> {
    if !model.mesh.embedded.shares.is_empty() && model.interface.constrained.is_none() {
        return Some(of_patch(model));
    }
    model.interface.constrained?;
    let barriers = model.peridynamics.as_ref();
    let barriers = Barriers::new(barriers.map_or(Vec::new(), |p| p.barriers.clone()));
    let positions: Vec<Vector<D>> = model.sites.iter().map(|s| s.position).collect();
    let edge = |n: usize| {
        let (offsets, cells) = model.node_cells();
        let around = &cells[offsets[n] as usize..offsets[n + 1] as usize];
        let nodes = around.iter().flat_map(|&c| model.mesh.cell(c as usize));
        let x = model.mesh.nodes[n];
        nodes
            .map(|&m| (model.mesh.nodes[m as usize] - x).norm())
            .fold(0.0, f64::max)
    };
    let widest = (0..model.mesh.nodes.len()).map(edge).fold(0.0, f64::max);
    let bins = Bins::new(&positions, widest);
    let rows = parallel::map(model.mesh.nodes.len(), 1, |n| {
        let own: Vec<(u32, f64)> = model.node_transfer.row(n).collect();
        if own.iter().all(|(_, w)| *w >= 0.0) {
            return own;
        }
        let x = model.mesh.nodes[n];
        let around = REACH.iter().find_map(|reach| {
            let reach = reach * edge(n);
            let is_seen = |k: &usize| {
                let far = (positions[*k] - x).norm();
                far <= reach && (far == 0.0 || !barriers.cuts(&x, &positions[*k]))
            };
            let mut seen: Vec<usize> = bins.around(&x, reach).filter(is_seen).collect();
            seen.sort_unstable();
            let volume = |k: &usize| model.sites[*k].volume;
            positive(&x, seen, &positions, volume, reach)
        });
        around.unwrap_or(own)
    });
    Some(Transfer::from_rows(model.sites.len(), rows))
}

/// The weights at `x`, exact for affine fields and none negative, that are nearest to the volumes of the sites `seen` within `reach`, less with the distance.
fn positive<const D: usize>(
    x: &Vector<D>,
    seen: Vec<usize>,
    positions: &[Vector<D>],
    volume: impl Fn(&usize) -> f64,
    reach: f64,
) -> Option<Vec<(u32, f64)>> {
    let arm = |k: &usize| (positions[*k] - x) / reach;
    let near = |k: &usize| 1.0 - arm(k).norm_squared();
    let prior: Vec<f64> = seen
        .iter()
        .map(|k| volume(k).max(0.0) * near(k).max(0.0))
        .collect();
    let arms: Vec<Vector<D>> = seen.iter().map(arm).collect();
    let weights = positive_weights(&arms, &prior)?;
    let found = seen.iter().zip(weights).filter(|(_, w)| *w > 0.0);
    Some(found.map(|(&k, w)| (k as u32, w)).collect())
}
