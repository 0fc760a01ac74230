//! Which of several processes computes which sites of a model.

use super::bins::Bins;
use super::held_families::HeldFamilies;
use crate::{
    model::{Distribution, Model, Site, SiteKind},
    parallel,
    peridynamics::TIE_TOLERANCE,
    system::{NeighbourGraph, Partition, Ranks, first_text},
    tensor::{Vector, padded},
};

/// A graph partitioner decides where the process with the most sites of others beside its own has at most this part of those that bisection leaves it. Where both do the same, as in blocks, the cuts of
/// bisection suit passes along a lattice better, and its shares are more even.
const FEWER: f64 = 0.9;

/// Points fill the box around them where they take this part of its places.
const FULL: f64 = 0.9;

impl<const D: usize> Model<D> {
    /// Which of `count` processes computes which sites, weighted by the bonds and cells around them.
    pub fn partition(&self, count: usize) -> Partition {
        by_work(&self.sites, &self.work_of_sites(), count)
    }

    /// Collective: which of `count` processes computes which sites: as families are distributed, where they are, or will be if `is_shared`; else as a graph partitioner has it where that leaves fewer sites of others
    /// beside those of each; without `ranks`, by bisection.
    pub fn distribute(
        &self,
        count: usize,
        is_shared: bool,
        ranks: Option<&dyn Ranks>,
    ) -> Distribution {
        if let Some(shared) = self.shared_families() {
            return shared.distribution().clone();
        }
        if let Some(held) = self.spread.held.filter(|_| is_shared) {
            return self.distribute_before_families(&self.sites, &held, count, ranks);
        }
        let bisected = self.partition(count);
        // the graph does no better there, and takes as long to cut as families to find
        let is_full = self.is_lattice() && self.fills_a_box(&self.sites, self.spacing());
        decided(bisected, ranks.filter(|_| !is_full), || self.site_graph())
    }

    /// Collective: the same of sites whose families are not known, and of no process will be: a graph partitioner cuts what is next to each other.
    pub(crate) fn distribute_before_families(
        &self,
        sites: &[Site<D>],
        held: &HeldFamilies,
        count: usize,
        ranks: Option<&dyn Ranks>,
    ) -> Distribution {
        let bisected = by_work(sites, &self.work_before_families(sites, held), count);
        let is_full = self.fills_a_box(sites, held.spacing);
        decided(bisected, ranks.filter(|_| !is_full), || {
            self.graph_before_families(sites, held.spacing)
        })
    }

    /// Returns true if all sites are points, and leave next to nothing of the box around them empty.
    fn fills_a_box(&self, sites: &[Site<D>], spacing: f64) -> bool {
        let is_point = |site: &Site<D>| matches!(site.kind, SiteKind::Point(_));
        let (low, high) = self.mesh.bounds();
        let places = ((high - low) / spacing).product();
        sites.iter().all(is_point) && sites.len() as f64 >= FULL * places
    }

    /// Which sites are next to each other: points a spacing apart, nodes of one element, and nodes and points between which no point lies.
    fn graph_before_families(&self, sites: &[Site<D>], spacing: f64) -> NeighbourGraph {
        let positions: Vec<Vector<D>> = sites.iter().map(|site| site.position).collect();
        let mut site_of_node = vec![None; self.mesh.nodes.len()];
        for (site, of) in (0..).zip(sites) {
            if let SiteKind::Node(n) = of.kind {
                site_of_node[n as usize] = Some(site);
            }
        }
        let bins = Bins::new(&positions, spacing);
        let next = spacing * (1.0 + TIE_TOLERANCE);
        let across = next * (D as f64).sqrt();
        let is_point = |site: usize| matches!(sites[site].kind, SiteKind::Point(_));
        let of_site = |site: usize| -> Vec<u32> {
            let x = &positions[site];
            let is_next = |other: &usize| match [site, *other].map(is_point) {
                [true, true] => (positions[*other] - x).norm() <= next,
                [false, false] => false,
                _ => (positions[*other] - x).norm() <= across,
            };
            let near = bins
                .around(x, across)
                .filter(is_next)
                .map(|other| other as u32);
            let mut row: Vec<u32> = near.collect();
            if let SiteKind::Node(n) = sites[site].kind {
                let cells = self.cells_of_node(n).filter(|(c, _)| self.is_element(*c));
                let nodes = cells.flat_map(|(c, _)| self.mesh.cell(c));
                row.extend(nodes.filter_map(|&n| site_of_node[n as usize]));
            }
            row
        };
        NeighbourGraph::of_rows(parallel::map(sites.len(), 64, of_site))
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

/// Collective: as a graph partitioner has it where that leaves fewer sites of others beside those of each than bisection does; without `ranks`, by bisection.
fn decided(
    bisected: Partition,
    ranks: Option<&dyn Ranks>,
    graph: impl FnOnce() -> NeighbourGraph,
) -> Distribution {
    let count = bisected.ranks();
    let Some(ranks) = ranks.filter(|_| count > 1) else {
        return Distribution {
            partition: bisected,
            why: "coordinate bisection".to_owned(),
        };
    };
    // one process decides, for a partitioner need not do the same twice
    let decided = (ranks.rank() == 0).then(|| by_graph(&graph(), &bisected, ranks));
    let (owners, why) = decided.unwrap_or_default();
    let owners = ranks.gather_words(&owners).swap_remove(0);
    let why = first_text(ranks, Some(&why)).unwrap_or_default();
    let partition = match owners.is_empty() {
        true => bisected,
        false => Partition::of_owners(owners.iter().map(|&r| r as u32).collect(), count),
    };
    Distribution { partition, why }
}

/// The process of each site by a graph partitioner, nothing where bisection is as good, and the reason.
fn by_graph(graph: &NeighbourGraph, bisected: &Partition, ranks: &dyn Ranks) -> (Vec<u64>, String) {
    let most = |each: &[usize]| each.iter().copied().max().unwrap_or(0);
    let count = bisected.ranks();
    let owners = match ranks.parts(graph, count) {
        Ok(owners) => owners,
        Err(why) => return (Vec::new(), format!("coordinate bisection: {why}")),
    };
    let words = owners.iter().map(|&r| u64::from(r)).collect();
    let [cut, other] = [bisected, &Partition::of_owners(owners, count)];
    let [cut, other] = [cut, other].map(|partition| most(&partition.neighbours(graph)));
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

/// Sites over processes by what they cost.
fn by_work<const D: usize>(sites: &[Site<D>], work: &[f64], count: usize) -> Partition {
    let positions: Vec<[f64; 3]> = sites.iter().map(|s| padded(&s.position)).collect();
    Partition::by_bisection(&positions, work, count)
}
