//! Which of several processes computes which sites of a model.

use crate::{
    coupling::{Model, Site},
    parallel,
    system::{NeighbourGraph, Partition, Ranks, first_text},
    tensor::padded,
};

/// A graph partitioner decides where the process with the most sites of others beside its own has at most this part of those that bisection leaves it. Where both do the same, as in blocks, the cuts of
/// bisection suit passes along a lattice better, and its shares are more even.
const FEWER: f64 = 0.9;

/// Points fill the box around them where they take this part of its places.
const FULL: f64 = 0.9;

/// Which of several processes has which sites, and why.
#[derive(Clone, Debug)]
pub struct Distribution {
    /// The sites of each process.
    pub partition: Partition,
    /// In words.
    pub why: String,
}

impl<const D: usize> Model<D> {
    /// Which of `count` processes computes which sites; `is_shared` where families shall be spread over these as well.
    ///
    /// Sites are weighted by the bonds and cells around them, points by those of a family that lacks none where families are not known before they are spread.
    pub fn partition(&self, count: usize, is_shared: bool) -> Partition {
        let work = match &self.held.filter(|_| is_shared) {
            Some(held) => self.work_before_families(&self.sites, held),
            None => self.work_of_sites(),
        };
        by_work(&self.sites, &work, count)
    }

    /// Collective: which of `count` processes computes which sites: as families are distributed, where they are; else as a graph partitioner has it where that leaves fewer sites of others beside those of each; without `ranks`, by bisection.
    ///
    /// Sites are distributed by bisection also where families shall be spread, since then no process knows the graph, and where points on a lattice fill a box, since then the graph
    /// does no better and takes as long to cut as families to find.
    pub fn distribute(
        &self,
        count: usize,
        is_shared: bool,
        ranks: Option<&dyn Ranks>,
    ) -> Distribution {
        if let Some(shared) = self.shared_families() {
            return Distribution {
                partition: shared.partition().clone(),
                why: "coordinate bisection".to_owned(),
            };
        }
        let bisected = self.partition(count, is_shared);
        let is_told_by_axes = is_shared && self.can_spread_families() || self.fills_a_box();
        let Some(ranks) = ranks.filter(|_| count > 1 && !is_told_by_axes) else {
            return Distribution {
                partition: bisected,
                why: "coordinate bisection".to_owned(),
            };
        };
        // one process decides, for a partitioner need not do the same twice
        let decided = (ranks.rank() == 0).then(|| self.by_graph(&bisected, ranks));
        let (owners, why) = decided.unwrap_or_default();
        let owners = ranks.gather_words(&owners).swap_remove(0);
        let why = first_text(ranks, Some(&why)).unwrap_or_default();
        let partition = match owners.is_empty() {
            true => bisected,
            false => Partition::of_owners(owners.iter().map(|&r| r as u32).collect(), count),
        };
        Distribution { partition, why }
    }

    /// Whether all sites are points on a lattice, and these leave next to nothing of the box around them empty.
    fn fills_a_box(&self) -> bool {
        let is_point = |site: usize| self.point_of(site).is_some();
        if !self.is_lattice() || !(0..self.sites.len()).all(is_point) {
            return false;
        }
        let (low, high) = self.mesh.bounds();
        let places = ((high - low) / self.spacing()).product();
        self.sites.len() as f64 >= FULL * places
    }

    /// The process of each site by a graph partitioner, nothing where bisection is as good, and the reason.
    fn by_graph(&self, bisected: &Partition, ranks: &dyn Ranks) -> (Vec<u64>, String) {
        let most = |each: &[usize]| each.iter().copied().max().unwrap_or(0);
        let graph = self.site_graph();
        let count = bisected.ranks();
        let owners = match ranks.parts(&graph, count) {
            Ok(owners) => owners,
            Err(why) => return (Vec::new(), format!("coordinate bisection: {why}")),
        };
        let words = owners.iter().map(|&r| u64::from(r)).collect();
        let [cut, other] = [bisected, &Partition::of_owners(owners, count)];
        let [cut, other] = [cut, other].map(|partition| most(&partition.neighbours(&graph)));
        if other as f64 <= FEWER * cut as f64 {
            let why = format!(
                "a graph partitioner: no process has more than {other} sites of others beside its own, {cut} by coordinate bisection"
            );
            return (words, why);
        }
        let why = format!(
            "coordinate bisection: no process has more than {cut} sites of others beside its own, {other} by a graph partitioner"
        );
        (Vec::new(), why)
    }

    /// Which sites take part in the forces of which others: the ends of bonds, and the nodes of elements.
    fn site_graph(&self) -> NeighbourGraph {
        let of_site = |site: usize| -> Vec<u32> {
            if let Some((body, point)) = self.point_of(site) {
                let ends = body.families.of(point).iter();
                let sites = ends.flat_map(|&j| body.cloud.transfer.row(j as usize));
                return sites.map(|(s, _)| s).collect();
            }
            let nodes = self
                .cells_of_site(site)
                .flat_map(|(c, _)| self.mesh.cell(c));
            let sites = nodes.flat_map(|&n| self.node_transfer.row(n as usize));
            sites.map(|(s, _)| s).collect()
        };
        NeighbourGraph::of_rows(parallel::map(self.sites.len(), 64, of_site))
    }
}

/// Sites over processes by what they cost.
pub(super) fn by_work<const D: usize>(sites: &[Site<D>], work: &[f64], count: usize) -> Partition {
    let positions: Vec<[f64; 3]> = sites.iter().map(|s| padded(&s.position)).collect();
    Partition::by_bisection(&positions, work, count)
}
