//! Numbers of ghosts: sites whose numbers a process needs while another computes them.

use super::{Exchange, Partition, Ranks, Spread};

/// Traffic of a process with others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Traffic {
    /// Sites that it computes.
    pub sites: u64,
    /// Sites of others whose numbers it received in each exchange.
    pub ghosts: u64,
    /// Own sites whose numbers it sent in each exchange, each once.
    pub sent_sites: u64,
    /// Exchanges, one for each step.
    pub exchanges: u64,
    /// Data that it received in all of them \[bytes\].
    pub received_bytes: u64,
}

/// The ghosts of a process, and how their numbers come to it.
#[derive(Debug)]
pub struct Ghosts {
    /// Sites of others, in the order of processes.
    ghosts: Vec<u32>,
    /// Own sites that others have as ghosts, ascending.
    sent: Vec<u32>,
    block: usize,
    exchange: Box<dyn Exchange>,
    own: Vec<f64>,
    arrived: Vec<f64>,
    traffic: Traffic,
}

impl Ghosts {
    /// Collective: of the sites whose numbers this process needs, of which it may have some itself.
    pub fn new(spread: &Spread<'_>, needed: &[bool], block: usize) -> Self {
        let Spread { ranks, partition } = *spread;
        let rank = ranks.rank();
        let order = |site: &u32| partition.number(*site);
        let foreign = |site: &u32| needed[*site as usize] && partition.owner(*site) != rank;
        let mut ghosts: Vec<u32> = (0..needed.len() as u32).filter(foreign).collect();
        ghosts.sort_unstable_by_key(order);
        let told: Vec<u64> = ghosts.iter().map(|&s| u64::from(s)).collect();
        let all = ranks.gather_words(&told).into_iter().flatten();
        let mut wanted: Vec<u32> = all.map(|s| s as u32).collect();
        wanted.sort_unstable_by_key(order);
        wanted.dedup();
        let place = |site: &u32| {
            let number = partition.number(*site);
            wanted.partition_point(|s| partition.number(*s) < number) as u64
        };
        let places: Vec<u64> = ghosts.iter().map(place).collect();
        let sent: Vec<u32> = of_rank(&wanted, partition, rank).to_vec();
        Self {
            exchange: ranks.exchange(sent.len(), &places, block),
            own: vec![0.0; sent.len() * block],
            arrived: vec![0.0; ghosts.len() * block],
            traffic: Traffic {
                sites: partition.of(rank).len() as u64,
                ghosts: ghosts.len() as u64,
                sent_sites: sent.len() as u64,
                ..Traffic::default()
            },
            ghosts,
            sent,
            block,
        }
    }

    /// Sites of others whose numbers come.
    pub fn sites(&self) -> &[u32] {
        &self.ghosts
    }

    /// Own sites whose numbers others want, ascending.
    pub fn sent(&self) -> &[u32] {
        &self.sent
    }

    /// Collective: sends the numbers that others want, out of those of all sites.
    pub fn begin(&mut self, all: &[f64]) {
        let block = self.block;
        for (to, &site) in self.own.chunks_exact_mut(block).zip(&self.sent) {
            to.copy_from_slice(&all[site as usize * block..][..block]);
        }
        self.exchange.begin(&self.own);
    }

    /// Collective: puts the numbers of the ghosts among those of all sites.
    pub fn end(&mut self, all: &mut [f64]) {
        let block = self.block;
        self.exchange.end(&mut self.arrived);
        for (from, &site) in self.arrived.chunks_exact(block).zip(&self.ghosts) {
            all[site as usize * block..][..block].copy_from_slice(from);
        }
        self.traffic.exchanges += 1;
        self.traffic.received_bytes += std::mem::size_of_val(&self.arrived[..]) as u64;
    }

    /// Collective: what each process exchanged so far.
    pub fn traffic(&self, ranks: &dyn Ranks) -> Vec<Traffic> {
        let t = &self.traffic;
        let own = [
            t.sites,
            t.ghosts,
            t.sent_sites,
            t.exchanges,
            t.received_bytes,
        ];
        let all = ranks.gather_words(&own).into_iter();
        all.map(|words| Traffic {
            sites: words[0],
            ghosts: words[1],
            sent_sites: words[2],
            exchanges: words[3],
            received_bytes: words[4],
        })
        .collect()
    }
}

/// Those of a process among sites in the order of processes.
fn of_rank<'a>(sites: &'a [u32], partition: &Partition, rank: usize) -> &'a [u32] {
    let first = sites.partition_point(|&s| partition.owner(s) < rank);
    let end = sites.partition_point(|&s| partition.owner(s) <= rank);
    &sites[first..end]
}
