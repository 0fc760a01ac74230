//! Families that are spread over processes: each process holds those of its own points, and of others where the rows of its own, or the seam, take these.
//!
//! Sites are distributed before any family is known, by what their rows cost if these lack nothing, so that no process ever has the families of all.

use crate::peridynamics::Families;
use crate::system::{Partition, Ranks, Spread};

/// The site of a point that is none.
pub(crate) const NONE: u32 = u32::MAX;

/// Which of several processes has which sites, and why.
#[derive(Clone, Debug)]
pub struct Distribution {
    /// The sites of each process.
    pub partition: Partition,
    /// In words.
    pub why: String,
}

/// Which process has the families of which points.
#[derive(Clone, Debug)]
pub struct SharedFamilies {
    /// Of the sites.
    distribution: Distribution,
    rank: usize,
    /// The site of each point.
    site_of_point: Vec<u32>,
    /// Bonds of the family of each point, of all points.
    sizes: Vec<u32>,
}

impl SharedFamilies {
    /// Of sites that have been distributed, by the site of each point; this process is number `rank`.
    pub(crate) fn new(distribution: Distribution, rank: usize, site_of_point: Vec<u32>) -> Self {
        Self {
            distribution,
            rank,
            site_of_point,
            sizes: Vec::new(),
        }
    }

    /// Collective: learns which points are which sites, now that none is dropped any more, and how many bonds the families have that others hold.
    pub(crate) fn count(&mut self, ranks: &dyn Ranks, site_of_point: &[u32], families: &Families) {
        self.site_of_point = site_of_point.to_vec();
        self.sizes = self.sizes_of(ranks, families);
    }

    /// The sites over processes.
    pub fn spread<'a>(&'a self, ranks: &'a dyn Ranks) -> Spread<'a> {
        Spread {
            ranks,
            partition: self.partition(),
        }
    }

    /// Which process has which sites.
    pub fn partition(&self) -> &Partition {
        &self.distribution.partition
    }

    /// The same, and why.
    pub fn distribution(&self) -> &Distribution {
        &self.distribution
    }

    /// The site of a point that is one.
    pub fn site_of_point(&self, point: u32) -> Option<u32> {
        let site = self.site_of_point[point as usize];
        (site != NONE).then_some(site)
    }

    /// Returns, for each point, true if this process reports it to others: it has the site, or is the first process, for points that are no sites.
    pub fn own(&self) -> Vec<bool> {
        let owner = |&site: &u32| match site {
            NONE => 0,
            site => self.partition().owner(site),
        };
        let sites = self.site_of_point.iter();
        sites.map(|site| owner(site) == self.rank).collect()
    }

    /// Collective: returns the number of bonds of each point in `families` over the points, whichever process holds them.
    pub fn sizes_of(&self, ranks: &dyn Ranks, families: &Families) -> Vec<u32> {
        let size = |p: usize| families.of(p).len();
        let mut by_site = vec![0.0; self.partition().sites()];
        let points = self.site_of_point.iter().enumerate();
        for (p, &site) in points.clone().filter(|(_, site)| **site != NONE) {
            by_site[site as usize] = size(p) as f64;
        }
        let spread = self.spread(ranks);
        let own = spread.take_own(&by_site);
        spread.gather_sites(&own, &mut by_site);
        let of_any = |(p, &site): (usize, &u32)| match site {
            // in an element: every process has it
            NONE => size(p) as u32,
            site => by_site[site as usize] as u32,
        };
        points.map(of_any).collect()
    }

    /// Bonds of the family of each point, of all points.
    pub fn sizes(&self) -> &[u32] {
        &self.sizes
    }

    /// Directed bonds of all families.
    pub fn bond_count(&self) -> usize {
        self.sizes.iter().map(|&n| n as usize).sum()
    }
}
