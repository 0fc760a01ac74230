//! Partition of the sites over several processes.

use crate::parallel;

/// Partition of the sites over ranks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Partition {
    /// The rank of each site.
    owner: Vec<u32>,
    /// Number of each site in the order of the ranks.
    number: Vec<u32>,
    /// Sites in the order of the ranks, ascending within each.
    pub(super) order: Vec<u32>,
    /// Start of each rank's sites in that order, and their end.
    starts: Vec<usize>,
}

impl Partition {
    /// By coordinate bisection: the longest side of a box is cut where the work on both sides is in the proportion of their ranks; of sides of one length the last.
    ///
    /// Shapes: `positions` and `work` have one entry per site. The same on every rank. Ranks beyond the number of sites have none.
    pub fn by_bisection(positions: &[[f64; 3]], work: &[f64], ranks: usize) -> Self {
        let mut owner = vec![0; positions.len()];
        let mut sites: Vec<u32> = (0..positions.len() as u32).collect();
        bisect(positions, work, &mut sites, 0, ranks.max(1), &mut owner);
        Self::of_owners(owner, ranks.max(1))
    }

    /// Of the rank of each site.
    pub fn of_owners(owner: Vec<u32>, ranks: usize) -> Self {
        let mut starts = vec![0; ranks + 1];
        for &r in &owner {
            starts[r as usize + 1] += 1;
        }
        for r in 0..ranks {
            starts[r + 1] += starts[r];
        }
        let mut next = starts.clone();
        let mut number = vec![0; owner.len()];
        let mut order = vec![0; owner.len()];
        for (site, &r) in owner.iter().enumerate() {
            let place = next[r as usize];
            next[r as usize] += 1;
            number[site] = place as u32;
            order[place] = site as u32;
        }
        Self {
            owner,
            number,
            order,
            starts,
        }
    }

    /// Sites of others beside those of each rank.
    pub fn neighbours(&self, graph: &NeighbourGraph) -> Vec<usize> {
        let mut seen_by = vec![u32::MAX; self.sites()];
        let of_rank = |rank: usize| {
            let mut count = 0;
            for &j in self.of(rank).iter().flat_map(|&site| graph.of(site)) {
                if self.owner(j) != rank && seen_by[j as usize] != rank as u32 {
                    seen_by[j as usize] = rank as u32;
                    count += 1;
                }
            }
            count
        };
        (0..self.ranks()).map(of_rank).collect()
    }

    /// Number of ranks.
    pub fn ranks(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of sites.
    pub fn sites(&self) -> usize {
        self.owner.len()
    }

    /// The sites of a rank, ascending.
    pub fn of(&self, rank: usize) -> &[u32] {
        &self.order[self.starts[rank]..self.starts[rank + 1]]
    }

    /// The rank of a site.
    pub fn owner(&self, site: u32) -> usize {
        self.owner[site as usize] as usize
    }

    /// The number of a site in the order of the ranks: those of a rank follow one another.
    pub fn number(&self, site: u32) -> u32 {
        self.number[site as usize]
    }

    /// The row of a site among those of a rank, if the rank has it.
    pub fn row(&self, rank: usize, site: u32) -> Option<usize> {
        (self.owner(site) == rank).then(|| self.number(site) as usize - self.starts[rank])
    }

    /// Numbers of all ranks with `block` per site, for [`Ranks::gather_into`](super::Ranks::gather_into).
    pub fn lengths(&self, block: usize) -> Vec<usize> {
        self.starts
            .windows(2)
            .map(|s| (s[1] - s[0]) * block)
            .collect()
    }
}

/// Graph of the sites that take part in each other's forces, either way: its edges are those that a partition cuts.
#[derive(Clone, Debug)]
pub struct NeighbourGraph {
    /// Start of each site's neighbours, and their end.
    pub starts: Vec<usize>,
    /// Neighbours, ascending for each site; each has the other.
    pub neighbours: Vec<u32>,
}

impl NeighbourGraph {
    /// Of the sites that each row takes, in any order, its own or others.
    pub fn of_rows(mut rows: Vec<Vec<u32>>) -> Self {
        parallel::for_each_mut(&mut rows, 64, |site, row| {
            row.sort_unstable();
            row.dedup();
            row.retain(|&j| j as usize != site);
        });
        let mut missing = vec![Vec::new(); rows.len()];
        for (site, row) in (0..).zip(&rows) {
            let one_way = |j: &&u32| rows[**j as usize].binary_search(&site).is_err();
            row.iter()
                .filter(one_way)
                .for_each(|&j| missing[j as usize].push(site));
        }
        let (mut starts, mut neighbours) = (vec![0], Vec::new());
        for (row, missing) in rows.iter_mut().zip(&missing) {
            if !missing.is_empty() {
                row.extend(missing);
                row.sort_unstable();
            }
            neighbours.append(row);
            starts.push(neighbours.len());
        }
        Self { starts, neighbours }
    }

    /// The neighbours of a site.
    pub fn of(&self, site: u32) -> &[u32] {
        let site = site as usize;
        &self.neighbours[self.starts[site]..self.starts[site + 1]]
    }
}

/// Sides of this part of the longest are as long. A lattice pass takes some points along the first axis at a time, and two processes compute those that a cut across it separates:
/// of a cube of 2·10⁷ bonds, cut in two, a sixth more.
const AS_LONG: f64 = 0.9;

/// Gives `count` ranks from `first` on to `sites`, which are put in order on the way.
fn bisect(
    positions: &[[f64; 3]],
    work: &[f64],
    sites: &mut [u32],
    first: usize,
    count: usize,
    owner: &mut [u32],
) {
    if count == 1 || sites.is_empty() {
        sites.iter().for_each(|&s| owner[s as usize] = first as u32);
        return;
    }
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for &s in sites.iter() {
        for (a, x) in positions[s as usize].iter().enumerate() {
            low[a] = low[a].min(*x);
            high[a] = high[a].max(*x);
        }
    }
    let length = |a: usize| high[a] - low[a];
    let longest = length(0).max(length(1)).max(length(2));
    let axis = (0..3)
        .rfind(|&a| length(a) >= AS_LONG * longest)
        .unwrap_or(0);
    let at = |s: &u32| positions[*s as usize][axis];
    sites.sort_unstable_by(|s, t| at(s).total_cmp(&at(t)).then(s.cmp(t)));
    let below = count / 2;
    let all: f64 = sites.iter().map(|&s| work[s as usize]).sum();
    let wanted = all * below as f64 / count as f64;
    let mut sum = 0.0;
    let split = sites.iter().position(|&s| {
        // a site goes where more than half of its work is
        let half = 0.5 * work[s as usize];
        sum += 2.0 * half;
        sum - half >= wanted
    });
    let (lower, upper) = sites.split_at_mut(split.unwrap_or(sites.len()));
    bisect(positions, work, lower, first, below, owner);
    bisect(positions, work, upper, first + below, count - below, owner);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: usize) -> Vec<[f64; 3]> {
        (0..n * n)
            .map(|i| [(i % n) as f64, (i / n) as f64, 0.0])
            .collect()
    }

    #[test]
    fn every_site_has_one_rank_and_a_place_among_its_sites() {
        for ranks in [1, 2, 3, 4, 7] {
            let p = Partition::by_bisection(&grid(12), &vec![1.0; 144], ranks);
            let mut seen = vec![0; 144];
            for r in 0..ranks {
                assert!(p.of(r).is_sorted());
                for (row, &site) in p.of(r).iter().enumerate() {
                    seen[site as usize] += 1;
                    assert_eq!((p.owner(site), p.row(r, site)), (r, Some(row)));
                    assert_eq!(p.order[p.number(site) as usize], site);
                }
                let share = p.of(r).len() as f64 / (144.0 / ranks as f64);
                assert!((0.95..1.05).contains(&share), "{ranks} {share}");
            }
            assert!(seen.iter().all(|&n| n == 1));
        }
    }

    #[test]
    fn work_and_not_sites_is_halved() {
        // the lower third has ten times the work of the rest; of two sides of one length the last is cut
        let x = grid(30);
        let work: Vec<f64> = x
            .iter()
            .map(|x| if x[1] < 10.0 { 10.0 } else { 1.0 })
            .collect();
        let p = Partition::by_bisection(&x, &work, 2);
        let of = |r: usize| p.of(r).iter().map(|&s| work[s as usize]).sum::<f64>();
        assert!((of(0) / of(1) - 1.0).abs() < 0.01, "{} {}", of(0), of(1));
        assert!(p.of(0).len() * 3 < p.of(1).len());
        assert!(p.of(0).iter().all(|&s| x[s as usize][1] < 6.0));
    }

    #[test]
    fn more_ranks_than_sites_leave_some_without() {
        let p = Partition::by_bisection(&grid(2), &[1.0; 4], 6);
        assert_eq!(p.ranks(), 6);
        let sites: Vec<usize> = (0..6).map(|r| p.of(r).len()).collect();
        assert_eq!(sites.iter().sum::<usize>(), 4);
        assert!(sites.iter().all(|&n| n <= 1), "{sites:?}");
        assert_eq!(Partition::by_bisection(&[], &[], 3).sites(), 0);
    }
}
