//! Nodes at the seam that are no sites, and points that continue a lattice among those of another, expressed through the sites around them.

use crate::{
    assembly::Transfer,
    mesh::Mesh,
    model::{
        CellRole, FitDegree, Interface, ModelError, Site, SiteKind,
        bins::Bins,
        least_squares_gradient,
        point_cloud::{PointCarrier, PointCloud},
        seam_order::Ties,
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

/// Sites with weights that a place follows.
pub(crate) type SiteWeights = Vec<(u32, f64)>;

/// Sites around places, to which these are fitted.
struct NearSites<'a, const D: usize> {
    barriers: &'a Barriers<D>,
    sites: Vec<u32>,
    positions: Vec<Vector<D>>,
    bins: Bins<D>,
    spacing: f64,
    /// The farthest that a fit reaches.
    widest: f64,
}

impl<'a, const D: usize> NearSites<'a, D> {
    fn new(at: &Sites<'a, D>, cloud: &PointCloud<D>, counts: impl Fn(&Site<D>) -> bool) -> Self {
        let all = 0..at.sites.len() as u32;
        let sites: Vec<u32> = all.filter(|&s| counts(&at.sites[s as usize])).collect();
        let place = |s: &u32| at.sites[*s as usize].position;
        let positions: Vec<Vector<D>> = sites.iter().map(place).collect();
        Self {
            barriers: at.barriers,
            bins: Bins::new(&positions, 2.0 * cloud.spacing),
            sites,
            positions,
            spacing: cloud.spacing,
            widest: (6.0 * cloud.spacing).max(3.0 * cloud.horizon.largest()),
        }
    }

    fn all_within(&self, x: &Vector<D>, radius: f64) -> Vec<usize> {
        let is_near = |k: &usize| (self.positions[*k] - x).norm() <= radius;
        let mut found: Vec<usize> = self.bins.around(x, radius).filter(is_near).collect();
        found.sort_unstable();
        found
    }

    /// The weights of a fit at `x` to the sites that no crack or void hides, within `start` or as little farther as determines one; how many there are if none does.
    fn fit(&self, x: &Vector<D>, start: f64, degree: FitDegree) -> Result<SiteWeights, usize> {
        if let Some(&k) = self.all_within(x, 1e-9 * self.spacing).first() {
            return Ok(vec![(self.sites[k], 1.0)]);
        }
        let is_beside = self.barriers.near(x, self.widest);
        let hidden = |k: &usize| is_beside && self.barriers.cuts(x, &self.positions[*k]);
        // on the crack itself a node has no side
        let is_on = is_beside && self.all_within(x, self.widest).iter().all(hidden);
        let within = |radius: f64| {
            let mut found = self.all_within(x, radius);
            found.retain(|k| is_on || !hidden(k));
            found
        };
        for degree in [degree, FitDegree::Affine] {
            for factor in [1.0, 1.3, 1.7, 2.2, 3.0] {
                let radius = start * factor * (1.0 + 1e-9);
                let chosen = within(radius.min(self.widest));
                let seen: Vec<Vector<D>> = chosen.iter().map(|&k| self.positions[k]).collect();
                if let Some(weights) = least_squares_gradient::fit(x, &seen, degree) {
                    let sites = chosen.iter().map(|&k| self.sites[k]);
                    return Ok(sites.zip(weights).collect());
                }
            }
        }
        Err(within(self.widest).len())
    }
}

fn is_point<const D: usize>(site: &Site<D>) -> bool {
    matches!(site.kind, SiteKind::Point(_))
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
    let near = NearSites::new(at, cloud, |site| with_nodes || is_point(site));
    let start = match with_nodes {
        true => cloud.horizon.largest(),
        false => 1.8 * cloud.spacing,
    };
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
        near.fit(&x, start, degree)
            .map_err(|found| ModelError::Fit {
                node: n as u32,
                position: x.iter().copied().collect(),
                found,
            })
    })?;
    Ok(Transfer::from_rows(at.sites.len(), rows))
}

/// Expresses the points that continue a lattice through the points among which they lie; no rows if there are no such points.
pub(crate) fn fit_continued<const D: usize>(
    at: &Sites<'_, D>,
    cloud: &PointCloud<D>,
) -> Result<Vec<SiteWeights>, ModelError> {
    let continues = |i: usize| cloud.carrier[i] == PointCarrier::Lattice;
    if !(0..cloud.position.len()).any(continues) {
        return Ok(Vec::new());
    }
    let near = NearSites::new(at, cloud, is_point);
    parallel::try_map(cloud.position.len(), 16, |i| {
        if !continues(i) {
            return Ok(Vec::new());
        }
        let x = &cloud.position[i];
        let fit = near.fit(x, 1.8 * cloud.spacing, FitDegree::Quadratic);
        fit.map_err(|found| ModelError::Continuation {
            position: x.iter().copied().collect(),
            found,
        })
    })
}
