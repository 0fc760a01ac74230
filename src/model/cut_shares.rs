//! Shares of families that voids and cracks of the scene have cut away, before any bond breaks.

use crate::{
    model::{Model, Surfaces, bond_cutting},
    parallel,
    peridynamics::{Families, TIE_TOLERANCE},
    shape::Barriers,
    tensor::Vector,
};

impl<const D: usize> Model<D> {
    /// For each site at which cracks, or voids that cut bonds, have cut some, the share `Σ V' of these / Σ V'` of its family: that which it would have without them.
    ///
    /// Bonds that the surface of the mesh cuts count in neither of the sums. Shapes: sites ascend.
    pub(crate) fn cut_shares(&self) -> Vec<(u32, f64)> {
        let (Some(p), Some(body)) = (&self.peridynamics, self.body()) else {
            return Vec::new();
        };
        let barriers = Barriers::new(p.barriers.clone());
        let position = &body.cloud.position;
        let reach_of = |i: usize| p.reach(body.cloud.horizon.of(i));
        let site_of = |s: usize| Some((s as u32, self.point_of(s)?.1));
        let mut near: Vec<(u32, usize)> = (0..self.sites.len()).filter_map(site_of).collect();
        near.retain(|&(_, i)| barriers.near(&position[i], reach_of(i)));
        if near.is_empty() {
            return Vec::new();
        }
        near.sort_unstable_by_key(|n| n.1);
        let centres: Vec<u32> = near.iter().map(|n| n.1 as u32).collect();
        let places: Vec<Vector<D>> = near.iter().map(|n| position[n.1]).collect();
        let selves: Vec<Option<u32>> = centres.iter().copied().map(Some).collect();
        let reaches: Vec<f64> = near.iter().map(|n| reach_of(n.1)).collect();
        // the points have been searched before, where errors are reported
        let whole = Families::search_from(&places, &selves, &reaches, position, TIE_TOLERANCE);
        let Ok(whole) = whole else {
            return Vec::new();
        };
        let mut whole = whole.spread(&centres, position.len());
        let surface = (p.surfaces == Surfaces::Cut).then(|| self.mesh.outer_facets());
        let longest = reaches.iter().copied().fold(0.0, f64::max);
        bond_cutting::cut(&[], &self.mesh, surface, longest, position, &mut whole);
        let share = |&(site, i): &(u32, usize)| {
            let (mut all, mut cut) = (body.volume_behind(i), 0.0);
            for &j in whole.of(i) {
                let j = j as usize;
                // bonds run within a lattice
                if body.is_foot(j) || !self.are_of_one_lattice([i, j]) {
                    continue;
                }
                let volume = body.cloud.volume[j];
                all += volume;
                if barriers.cuts(&position[i], &position[j]) {
                    cut += volume;
                }
            }
            (cut > 0.0).then(|| (site, cut / all))
        };
        let mut shares: Vec<(u32, f64)> = parallel::map_slice(&near, share)
            .into_iter()
            .flatten()
            .collect();
        shares.sort_unstable_by_key(|s| s.0);
        shares
    }
}
