//! Several processes that compute one run together: what the library asks of them, and which sites each of them has.
//!
//! All of them do the same, in the same order, with the same mesh; each computes the rows of its own sites. Whoever starts them supplies [`Ranks`]: the library
//! knows no message passing. Sites are numbered anew for such a run, rank by rank, so that the rows of a rank follow one another.

use super::{BlockCsr, Symmetry};

/// The processes of a run, as one of them sees them.
///
/// A method that is *collective* is called by all ranks, in the same order; it returns once all have called it.
pub trait Ranks: Send + Sync + std::fmt::Debug {
    /// The number of this process, from zero.
    fn rank(&self) -> usize;

    /// How many processes there are.
    fn count(&self) -> usize;

    /// Collective: overwrites `all` with the numbers of all ranks, one rank after another; the same on every rank.
    ///
    /// Shapes: rank `r` gives `lengths[r]` numbers, `all` takes the sum of them.
    fn gather_into(&self, own: &[f64], lengths: &[usize], all: &mut [f64]);

    /// Collective: the words of each rank, whatever their number.
    fn gather_words(&self, own: &[u64]) -> Vec<Vec<u64>>;

    /// Collective: overwrites each number with the sum of those of all ranks at its place.
    fn add_into(&self, sums: &mut [i64]);

    /// Collective: what brings blocks of `block` numbers from the ranks that have them to those that want them.
    ///
    /// Each rank has `own` blocks, and they are numbered rank by rank; `wanted` are blocks of other ranks, ascending.
    fn exchange(&self, own: usize, wanted: &[u64], block: usize) -> Box<dyn Exchange>;

    /// Collective: what solves systems with a matrix of which each rank holds its own rows.
    ///
    /// # Errors
    /// In words, if there is no such solver, or it cannot be set up for this matrix.
    fn solver<'a>(
        &'a self,
        rows: RankRows<'a>,
        kind: RankSolverKind,
    ) -> Result<Box<dyn RankSolver + 'a>, String>;
}

/// Brings blocks of numbers from the processes that have them to those that want them, again and again.
pub trait Exchange: Send + Sync + std::fmt::Debug {
    /// Collective: sends the own blocks, which may change again at once.
    fn begin(&mut self, own: &[f64]);

    /// Collective: overwrites `wanted` with the blocks of the last [`Exchange::begin`], once they are there.
    fn end(&mut self, wanted: &mut [f64]);
}

/// How a system that is spread over ranks is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RankSolverKind {
    /// Conjugate gradients or restarted GMRES, by the symmetry, preconditioned by algebraic multigrid.
    Krylov,
    /// A factorisation.
    Direct,
}

/// The rows of a square matrix that one rank holds.
///
/// Rows and columns of prescribed unknowns are those of a diagonal matrix, so that the system is one of all unknowns and keeps its symmetry.
#[derive(Clone, Copy, Debug)]
pub struct RankRows<'a> {
    /// The rows of the own sites, ascending by site; columns are sites.
    pub matrix: &'a BlockCsr,
    /// Which rank has which sites.
    pub partition: &'a Partition,
    /// Whether the whole matrix is symmetric.
    pub symmetry: Symmetry,
    /// Position of each site \[m\], padded with zeros.
    pub positions: &'a [[f64; 3]],
    /// Whether each unknown is prescribed.
    pub prescribed: &'a [bool],
}

/// What a solver of [`Ranks`] did.
#[derive(Clone, Debug, PartialEq)]
pub struct RankSolve {
    /// Iterations.
    pub iterations: usize,
    /// Why it stopped short of the tolerance, in the solver's own words, if it did.
    pub failure: Option<String>,
}

/// Solves systems with one matrix.
pub trait RankSolver {
    /// Collective: overwrites `x` with a solution of `K x = b` on the own sites, to a relative residual of about `tolerance`.
    ///
    /// Shapes: a block of numbers per own site, ascending by site.
    fn solve_into(
        &mut self,
        b: &[f64],
        x: &mut [f64],
        tolerance: f64,
        max_iterations: usize,
    ) -> RankSolve;
}

/// Which rank has which sites.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Partition {
    /// The rank of each site.
    owner: Vec<u32>,
    /// Number of each site in the order of the ranks.
    number: Vec<u32>,
    /// Sites in the order of the ranks, ascending within each.
    order: Vec<u32>,
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
    fn of_owners(owner: Vec<u32>, ranks: usize) -> Self {
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

    /// Numbers of all ranks with `block` per site, for [`Ranks::gather_into`].
    pub fn lengths(&self, block: usize) -> Vec<usize> {
        self.starts
            .windows(2)
            .map(|s| (s[1] - s[0]) * block)
            .collect()
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

/// Collective: whether all ranks say so.
pub(crate) fn all_say(ranks: &dyn Ranks, own: bool) -> bool {
    ranks
        .gather_words(&[u64::from(own)])
        .iter()
        .all(|words| *words == [1])
}

/// Collective: the text of the first rank that has one.
pub(crate) fn first_text(ranks: &dyn Ranks, own: Option<&str>) -> Option<String> {
    let words = own.map_or(Vec::new(), |text| text.bytes().map(u64::from).collect());
    let texts = ranks.gather_words(&words);
    let first = texts.into_iter().find(|text| !text.is_empty())?;
    let bytes = first.into_iter().map(|byte| byte as u8).collect();
    String::from_utf8(bytes).ok()
}

/// Where the part of each rank begins.
fn starts(lengths: &[usize]) -> Vec<usize> {
    let mut end = 0;
    let begin = |n: &usize| {
        end += n;
        end - n
    };
    lengths.iter().map(begin).collect()
}

/// Values of sites that are spread over ranks.
#[derive(Clone, Copy, Debug)]
pub struct Spread<'a> {
    /// The processes.
    pub ranks: &'a dyn Ranks,
    /// Which of them has which sites.
    pub partition: &'a Partition,
}

impl<'a> Spread<'a> {
    /// The own sites, ascending.
    pub fn own(&self) -> &'a [u32] {
        self.partition.of(self.ranks.rank())
    }

    /// Collective: overwrites `all`, a block of numbers per site, with the `own` ones of each rank, a block per own site.
    pub fn gather_sites(&self, own: &[f64], all: &mut [f64]) {
        let block = all.len() / self.partition.sites().max(1);
        let mut found = vec![0.0; all.len()];
        let lengths = self.partition.lengths(block);
        self.ranks.gather_into(own, &lengths, &mut found);
        for (&site, from) in self
            .partition
            .order
            .iter()
            .zip(found.chunks_exact(block.max(1)))
        {
            all[site as usize * block..][..block].copy_from_slice(from);
        }
    }

    /// The numbers of the own sites among those of all.
    pub fn take_own(&self, all: &[f64]) -> Vec<f64> {
        let block = all.len() / self.partition.sites().max(1);
        let own = self.own().iter();
        own.flat_map(|&s| &all[s as usize * block..][..block])
            .copied()
            .collect()
    }

    /// Collective: the numbers of all ranks, one from each.
    pub fn each(&self, own: f64) -> Vec<f64> {
        let count = self.ranks.count();
        let mut all = vec![0.0; count];
        self.ranks.gather_into(&[own], &vec![1; count], &mut all);
        all
    }

    /// Collective: the sum of a number over ranks, in their order.
    pub fn sum(&self, own: f64) -> f64 {
        self.each(own).iter().sum()
    }

    /// The own ones of some sites, in their order.
    fn own_among(&self, sites: &[u32]) -> Vec<u32> {
        let rank = self.ranks.rank();
        let own = sites.iter().copied();
        own.filter(|&s| self.partition.owner(s) == rank).collect()
    }

    /// Collective: whether all ranks say so.
    pub fn all(&self, own: bool) -> bool {
        all_say(self.ranks, own)
    }

    /// Collective: `width` numbers of each of some sites, from the rank that has it; the same `sites` on every rank, of which `own` computes some.
    pub fn of_sites(
        &self,
        sites: &[u32],
        width: usize,
        own: impl FnOnce(&[u32]) -> Vec<f64>,
    ) -> Vec<f64> {
        let mine = own(&self.own_among(sites));
        let mut lengths = vec![0; self.partition.ranks()];
        for &s in sites {
            lengths[self.partition.owner(s)] += width;
        }
        let mut found = vec![0.0; sites.len() * width];
        self.ranks.gather_into(&mine, &lengths, &mut found);
        let mut next = starts(&lengths);
        let mut sorted = vec![0.0; found.len()];
        for (&s, to) in sites.iter().zip(sorted.chunks_exact_mut(width.max(1))) {
            let next = &mut next[self.partition.owner(s)];
            to.copy_from_slice(&found[*next..*next + width]);
            *next += width;
        }
        sorted
    }

    /// Collective: the rows of some sites, each from the rank that has it; the same `sites` on every rank, of which `own` computes some.
    ///
    /// Rows of state-based laws have a thousand blocks, and messages are held several times: a few rows are told at a time.
    pub fn gather_rows(&self, sites: &[u32], own: impl Fn(&[u32]) -> BlockCsr) -> BlockCsr {
        /// Rows of a message.
        const AT_A_TIME: usize = 16;
        let mut all = BlockCsr {
            row_offsets: vec![0],
            ..BlockCsr::default()
        };
        for sites in sites.chunks(AT_A_TIME) {
            self.append_rows(sites, &own(&self.own_among(sites)), &mut all);
        }
        all
    }

    /// Collective: appends the rows of some sites to `all`, of which `own` are those of this rank.
    fn append_rows(&self, sites: &[u32], own: &BlockCsr, all: &mut BlockCsr) {
        let mut words = vec![own.block as u64];
        for r in 0..own.rows() {
            let (columns, values) = own.row(r);
            words.push(columns.len() as u64);
            words.extend(columns.iter().map(|&c| u64::from(c)));
            words.extend(values.iter().map(|x| x.to_bits()));
        }
        let parts = self.ranks.gather_words(&words);
        let block = own.block;
        all.block = block;
        let mut rest: Vec<&[u64]> = parts.iter().map(|part| &part[1..]).collect();
        for &s in sites {
            let rest = &mut rest[self.partition.owner(s)];
            let (count, tail) = rest.split_first().expect("a row for each site");
            let (columns, tail) = tail.split_at(*count as usize);
            let (values, tail) = tail.split_at(columns.len() * block * block);
            all.columns.extend(columns.iter().map(|&c| c as u32));
            all.values.extend(values.iter().map(|x| f64::from_bits(*x)));
            all.row_offsets.push(all.columns.len());
            *rest = tail;
        }
    }

    /// Collective: the largest of a number over ranks.
    pub fn largest(&self, own: f64) -> f64 {
        self.each(own).into_iter().fold(f64::NEG_INFINITY, f64::max)
    }
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
