//! Families that are spread over processes: each process holds those of its own points, and of their neighbours where a law asks for these.
//!
//! Points are distributed before any family is known, each counting the same, so that no process ever has the families of all.

use super::point_cloud::PointCloud;
use crate::peridynamics::{Families, TIE_TOLERANCE, Wanted};
use crate::system::{Partition, Ranks, Spread};
use crate::tensor::padded;

/// Which process has the families of which points. Every point is a site, of the same number.
#[derive(Clone, Debug)]
pub struct SharedFamilies {
    partition: Partition,
    rank: usize,
    /// Bonds of the family of each point, of all points.
    sizes: Vec<u32>,
}

impl SharedFamilies {
    /// The families of this process, and who has which; none where the points are no lattice.
    ///
    /// `reach` is how far families do \[m\]; of a law whose force takes the states of neighbours, `with_neighbours` holds.
    pub(super) fn search<const D: usize>(
        ranks: &dyn Ranks,
        cloud: &PointCloud<D>,
        reach: f64,
        with_neighbours: bool,
    ) -> Option<(Families, Self)> {
        let partition = by_count(&cloud.position, ranks.count());
        let rank = ranks.rank();
        let own = own_points(&partition, rank);
        let wanted = match with_neighbours {
            true => Wanted::WithNeighbours(&own),
            false => Wanted::Of(&own),
        };
        let (points, spacing) = (&cloud.position, cloud.spacing);
        let families = Families::search_lattice_of(points, spacing, reach, TIE_TOLERANCE, &wanted)?;
        let shared = Self {
            partition,
            rank,
            sizes: Vec::new(),
        };
        Some((families, shared))
    }

    /// Collective: learns how many bonds the families have that others hold.
    pub(super) fn count(&mut self, ranks: &dyn Ranks, families: &Families) {
        let own = self.partition.of(self.rank).iter();
        let own: Vec<f64> = own.map(|&i| families.of(i as usize).len() as f64).collect();
        let mut all = vec![0.0; self.partition.sites()];
        self.spread(ranks).gather_sites(&own, &mut all);
        self.sizes = all.into_iter().map(|n| n as u32).collect();
    }

    /// The points over processes.
    pub fn spread<'a>(&'a self, ranks: &'a dyn Ranks) -> Spread<'a> {
        Spread {
            ranks,
            partition: &self.partition,
        }
    }

    /// Which process has which points.
    pub fn partition(&self) -> &Partition {
        &self.partition
    }

    /// Whether each point is this process's own.
    pub fn own(&self) -> Vec<bool> {
        own_points(&self.partition, self.rank)
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

/// Points over processes before their families are known.
pub(super) fn by_count<const D: usize>(
    position: &[crate::tensor::Vector<D>],
    count: usize,
) -> Partition {
    let positions: Vec<[f64; 3]> = position.iter().map(padded).collect();
    Partition::by_bisection(&positions, &vec![1.0; positions.len()], count)
}

fn own_points(partition: &Partition, rank: usize) -> Vec<bool> {
    let points = 0..partition.sites() as u32;
    points.map(|i| partition.owner(i) == rank).collect()
}
