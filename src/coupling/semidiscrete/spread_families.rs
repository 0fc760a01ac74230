//! Queries of a coupled system about single bonds of families that may be spread over processes: each process reports its own, and all learn them.

use super::CoupledSystem;
use super::behaviour::NONE;
use crate::coupling::NonlinearSeam;
use crate::system::{BlockCsr, Spread};
use crate::{assembly, parallel};

impl<const D: usize> CoupledSystem<'_, D> {
    /// The sites over processes, where families are.
    fn spread_families(&self) -> Option<Spread<'_>> {
        let ranks = self.split.as_ref().map(|split| split.ranks);
        self.model.spread(ranks)
    }

    /// Returns true if the pass over the bonds contains that between two points of the cloud, or contained it before it broke.
    pub(super) fn is_passed_over(&self, i: usize, j: u32) -> bool {
        match (&self.seam, &self.body) {
            (Some(seam), _) => seam.is_whole(i, j as usize),
            (None, Some(body)) => body.is_passed_over(i, j),
            (None, None) => false,
        }
    }

    /// See [`crate::system::Tangent::tangent_rows`]. Collective where families are spread.
    pub(super) fn rows_at(&self, sites: &[u32]) -> BlockCsr {
        match self.spread_families() {
            Some(spread) => spread.gather_rows(sites, |own| self.own_rows_at(own)),
            None => self.own_rows_at(sites),
        }
    }

    fn own_rows_at(&self, sites: &[u32]) -> BlockCsr {
        // of rows that share blocks each has the bits of the first, which may lie with another process
        assembly::assemble_apart(sites.len(), self.mass.len(), |r, row| {
            let site = sites[r] as usize;
            self.linear.add_row(site, row);
            if let (Some(moving), Some(body)) = (&self.body, self.model.body())
                && moving.bonds_of_site[site] != NONE
            {
                let point = moving.bonds_of_site[site] as usize;
                let without_energy = self
                    .seam
                    .as_ref()
                    .map_or(&[][..], NonlinearSeam::without_energy);
                if without_energy.is_empty() {
                    let weight = |j: usize| match self.is_passed_over(point, j as u32) {
                        true => 1.0,
                        false => 0.0,
                    };
                    body.add_force_row(point, weight, row);
                } else {
                    // a point with an energy in the body's pass has whole bonds only
                    body.add_force_row_of_energies(
                        point,
                        |_| [1.0; 2],
                        |j| !without_energy[j],
                        row,
                    );
                }
            }
            if let (Some(moving), Some(body)) = (&self.body, self.model.body()) {
                moving.add_rows_of_feet(body, sites[r], row);
            }
            if let Some(seam) = &self.seam {
                seam.add_row(site, row);
            }
            if let Some(scale) = self.model.row_scale() {
                row.scale(scale[site]);
            }
        })
    }

    /// See [`crate::system::BodyState::broken_bonds`]. Collective where families are spread.
    pub(super) fn broken_between_sites(&self) -> Vec<(u32, u32)> {
        let held = self.broken_of_held_families();
        let Some(spread) = self.spread_families() else {
            return held;
        };
        // neighbours of own points may be held as well
        let rank = spread.ranks.rank();
        let own = held.into_iter();
        let own = own.filter(|&(i, _)| spread.partition.owner(i) == rank);
        let words: Vec<u64> = own
            .map(|(i, j)| u64::from(i) << 32 | u64::from(j))
            .collect();
        let mut all = spread.ranks.gather_words(&words).concat();
        // points and sites have the same order
        all.sort_unstable();
        let ends = |word: u64| ((word >> 32) as u32, word as u32);
        all.into_iter().map(ends).collect()
    }

    fn broken_of_held_families(&self) -> Vec<(u32, u32)> {
        let (Some(moving), Some(body)) = (self.body.as_ref(), self.model.body()) else {
            return Vec::new();
        };
        // a point that continues a lattice where that of another has a point stands for this
        let site = |p: usize| match (moving.site_of_point[p], &moving.transfer) {
            (NONE, Some(transfer)) if self.model.continues_on(p as u32) => {
                transfer.site(p).unwrap_or(NONE)
            }
            (site, _) => site,
        };
        let families = moving.traversed(body);
        parallel::listed(moving.site_of_point.len(), 1, |i, all| {
            if moving.site_of_point[i] == NONE || !moving.pass.is_damaged(i) {
                return;
            }
            let lost = families.of(i).iter().filter(|&&j| {
                !moving.pass.bonded(i, j as usize)
                    && site(j as usize) != NONE
                    && self.is_passed_over(i, j)
            });
            all.extend(lost.map(|&j| (site(i), site(j as usize))));
        })
    }
}
