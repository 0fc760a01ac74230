//! Families that are spread over processes: each process holds those of its own points, and of others where the rows of its own, or the seam, take these.
//!
//! Sites are distributed before any family is known, by what their rows cost if these lack nothing, so that no process ever has the families of all.

use super::held_families::HeldFamilies;
use super::point_cloud::PointCloud;
use super::{Model, Site, SiteKind};
use crate::peridynamics::{Families, TIE_TOLERANCE, Wanted};
use crate::system::{Partition, Ranks, Spread};
use crate::tensor::padded;

/// The site of a point that is none.
const NONE: u32 = u32::MAX;

/// Which process has the families of which points.
#[derive(Clone, Debug)]
pub struct SharedFamilies {
    /// Of the sites.
    partition: Partition,
    rank: usize,
    /// The site of each point.
    site_of_point: Vec<u32>,
    /// Bonds of the family of each point, of all points.
    sizes: Vec<u32>,
}

impl<const D: usize> Model<D> {
    /// The families of this process, and who has which; none where the points are no lattice. Sites that are nodes have been placed, and those that are points come behind them.
    ///
    /// `reach` is how far families do \[m\].
    pub(super) fn search_shared(
        &self,
        ranks: &dyn Ranks,
        held: &HeldFamilies,
        cloud: &PointCloud<D>,
        reach: f64,
    ) -> Option<(Families, SharedFamilies)> {
        let mut sites = self.sites.clone();
        let mut site_of_point = vec![NONE; cloud.position.len()];
        let points = cloud.element.iter().enumerate();
        for (p, _) in points.filter(|(_, element)| element.is_none()) {
            site_of_point[p] = sites.len() as u32;
            sites.push(Site {
                position: cloud.position[p],
                kind: SiteKind::Point(p as u32),
                volume: cloud.volume[p],
            });
        }
        let work = self.work_before_families(&sites, held);
        let partition = by_work(&sites, &work, ranks.count());
        let shared = SharedFamilies {
            partition,
            rank: ranks.rank(),
            site_of_point,
            sizes: Vec::new(),
        };
        let mut own = shared.own();
        let mut others = self.beside_elements(&cloud.position, held.depth);
        // those in elements complete families of the seam
        let in_element = cloud
            .element
            .iter()
            .enumerate()
            .filter(|(_, e)| e.is_some());
        for (p, _) in in_element {
            (own[p], others[p]) = (false, true);
        }
        let both: Vec<bool>;
        let wanted = match held.with_neighbours {
            true => Wanted::WithNeighbours(&own, &others),
            false => {
                both = own.iter().zip(&others).map(|(a, b)| *a || *b).collect();
                Wanted::Of(&both)
            }
        };
        let (points, spacing) = (&cloud.position, cloud.spacing);
        let families = Families::search_lattice_of(points, spacing, reach, TIE_TOLERANCE, &wanted)?;
        Some((families, shared))
    }
}

impl SharedFamilies {
    /// Collective: learns which points are which sites, now that none is dropped any more, and how many bonds the families have that others hold.
    pub(super) fn count(&mut self, ranks: &dyn Ranks, site_of_point: &[u32], families: &Families) {
        self.site_of_point = site_of_point.to_vec();
        self.sizes = self.sizes_of(ranks, families);
    }

    /// The sites over processes.
    pub fn spread<'a>(&'a self, ranks: &'a dyn Ranks) -> Spread<'a> {
        Spread {
            ranks,
            partition: &self.partition,
        }
    }

    /// Which process has which sites.
    pub fn partition(&self) -> &Partition {
        &self.partition
    }

    /// The site of a point that is one.
    pub fn site_of_point(&self, point: u32) -> Option<u32> {
        let site = self.site_of_point[point as usize];
        (site != NONE).then_some(site)
    }

    /// Whether this process tells others of each point: it has the site, or is the first one, of points that are none.
    pub fn own(&self) -> Vec<bool> {
        let owner = |&site: &u32| match site {
            NONE => 0,
            site => self.partition.owner(site),
        };
        let sites = self.site_of_point.iter();
        sites.map(|site| owner(site) == self.rank).collect()
    }

    /// Collective: the bonds of each point in `families` over the points, whoever holds them.
    pub fn sizes_of(&self, ranks: &dyn Ranks, families: &Families) -> Vec<u32> {
        let size = |p: usize| families.of(p).len();
        let mut by_site = vec![0.0; self.partition.sites()];
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

/// Sites over processes by what they cost.
pub(super) fn by_work<const D: usize>(sites: &[Site<D>], work: &[f64], count: usize) -> Partition {
    let positions: Vec<[f64; 3]> = sites.iter().map(|s| padded(&s.position)).collect();
    Partition::by_bisection(&positions, work, count)
}
