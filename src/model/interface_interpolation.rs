//! Nodes at the seam that are no sites, expressed through the sites around them.

use crate::{
    assembly::Transfer,
    mesh::Mesh,
    model::{
        CellRole, FitDegree, Interface, ModelError, Site, SiteKind, bins::Bins,
        least_squares_gradient, point_cloud::PointCloud, seam_order::Ties,
    },
    parallel,
    shape::Barriers,
    tensor::Vector,
};

const NONE: u32 = u32::MAX;

/// The sites of a model as they are known when nodes are fitted to them.
pub(crate) struct Sites<'a, const D: usize> {
    pub mesh: &'a Mesh<D>,
    pub roles: &'a [CellRole],
    pub sites: &'a [Site<D>],
    /// The site of each node, `u32::MAX` for one that is none.
    pub node_site: &'a [u32],
    /// Nodes in the middle of edges that follow the ends.
    pub ties: &'a Ties,
    /// Cracks and voids: no node follows what lies behind them.
    pub barriers: &'a Barriers<D>,
}

/// Nodes of the cells at the seam that are no sites.
fn nodes_to_fit<const D: usize>(at: &Sites<'_, D>, interface: Interface) -> Vec<bool> {
    let mut wanted = vec![false; at.mesh.nodes.len()];
    let cells = match interface.overlap {
        true => at.mesh.cell_count(),
        false => 0,
    };
    for c in 0..cells {
        let cell = at.mesh.cell(c);
        if at.roles[c] != CellRole::Points || cell.iter().any(|&n| at.node_site[n as usize] != NONE)
        {
            for &n in cell {
                wanted[n as usize] |= at.node_site[n as usize] == NONE;
            }
        }
    }
    wanted
}

/// Expresses nodes at the seam, that are no sites, through the sites around them.
pub(crate) fn fit_nodes<const D: usize>(
    at: &Sites<'_, D>,
    interface: Interface,
    cloud: &PointCloud<D>,
) -> Result<Transfer, ModelError> {
    let wanted = nodes_to_fit(at, interface);
    let with_nodes = interface.constrained.is_some();
    let degree = interface.constrained.unwrap_or(FitDegree::Quadratic);
    let largest = cloud.horizon.largest();
    let data: Vec<(u32, Vector<D>)> = (0..at.sites.len() as u32)
        .map(|s| (s, at.sites[s as usize].position))
        .filter(|&(s, _)| with_nodes || matches!(at.sites[s as usize].kind, SiteKind::Point(_)))
        .collect();
    let positions: Vec<Vector<D>> = data.iter().map(|d| d.1).collect();
    let bins = Bins::new(&positions, 2.0 * cloud.spacing);
    let rows = parallel::try_map(at.mesh.nodes.len(), 1, |n| {
        if at.node_site[n] != NONE {
            return Ok(vec![(at.node_site[n], 1.0)]);
        }
        if let Some(row) = at.ties.row(n as u32, at.node_site) {
            return Ok(row);
        }
        if !wanted[n] {
            return Ok(vec![]);
        }
        let x = at.mesh.nodes[n];
        let distance = |k: &usize| (positions[*k] - x).norm();
        let widest = (6.0 * cloud.spacing).max(3.0 * largest);
        let all_within = |radius: f64| -> Vec<usize> {
            let mut found: Vec<usize> = bins
                .around(&x, radius)
                .filter(|k| distance(k) <= radius)
                .collect();
            found.sort_unstable();
            found
        };
        if let Some(&k) = all_within(1e-9 * cloud.spacing).first() {
            return Ok(vec![(data[k].0, 1.0)]);
        }
        let is_beside = at.barriers.near(&x, widest);
        let hidden = |k: &usize| is_beside && at.barriers.cuts(&x, &positions[*k]);
        // on the crack itself a node has no side
        let is_on = is_beside && all_within(widest).iter().all(hidden);
        let within = |radius: f64| {
            let mut found = all_within(radius);
            found.retain(|k| is_on || !hidden(k));
            found
        };
        let start = if with_nodes {
            largest
        } else {
            1.8 * cloud.spacing
        };
        for degree in [degree, FitDegree::Affine] {
            for factor in [1.0, 1.3, 1.7, 2.2, 3.0] {
                let radius = start * factor * (1.0 + 1e-9);
                let chosen = within(radius.min(widest));
                let seen: Vec<Vector<D>> = chosen.iter().map(|&k| positions[k]).collect();
                if let Some(weights) = least_squares_gradient::fit(&x, &seen, degree) {
                    return Ok(chosen
                        .iter()
                        .zip(weights)
                        .map(|(&k, w)| (data[k].0, w))
                        .collect());
                }
            }
        }
        Err(ModelError::Fit {
            node: n as u32,
            position: x.iter().copied().collect(),
            found: within(widest).len(),
        })
    })?;
    Ok(Transfer::from_rows(at.sites.len(), rows))
}
