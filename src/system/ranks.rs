//! Several processes that compute one run together: the interface by which the library uses them, and values that are spread over them.
//!
//! All of them do the same, in the same order, with the same mesh; each computes the rows of its own sites. Whoever starts them supplies [`Ranks`]: the library
//! knows no message passing. Sites are numbered anew for such a run, rank by rank, so that the rows of a rank follow one another.

use super::{BlockCsr, NeighbourGraph, Partition, RowBatch, SharedRows, Symmetry};

/// The processes of a run, as one of them sees them.
///
/// A method that is *collective* is called by all ranks, in the same order; it returns once all have called it.
pub trait Ranks: Send + Sync + std::fmt::Debug {
    /// The number of this process, from zero.
    fn rank(&self) -> usize;

    /// Returns the number of processes.
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

    /// Parts of a graph, as many as asked for, with about the same work and few neighbours in other parts: the part of each site. Of this process alone.
    ///
    /// # Errors
    /// In words, if there is no graph partitioner, or it fails.
    fn parts(&self, graph: &NeighbourGraph, count: usize) -> Result<Vec<u32>, String>;

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

/// Method by which a system that is spread over ranks is solved.
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
    /// Partition of the sites over ranks.
    pub partition: &'a Partition,
    /// Symmetry of the whole matrix.
    pub symmetry: Symmetry,
    /// Position of each site \[m\], padded with zeros.
    pub positions: &'a [[f64; 3]],
    /// True for each unknown that is prescribed.
    pub prescribed: &'a [bool],
}

/// Summary of a solve by a solver of [`Ranks`].
#[derive(Clone, Debug, PartialEq)]
pub struct RankSolve {
    /// Iterations.
    pub iterations: usize,
    /// Reason why it stopped short of the tolerance, in the solver's own words, if it did.
    pub failure: Option<String>,
}

/// Solves systems with one matrix.
pub trait RankSolver: Send {
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

/// Returns the offset of the part of each rank.
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
    /// Partition of the sites over them.
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

    /// Collective: the rows of all sites, each from the rank that has it, with equal rows stored once.
    pub fn gather_all_rows(&self, block: usize, own: impl Fn(&[u32]) -> BlockCsr) -> BlockCsr {
        /// Rows of a batch.
        const BATCH: usize = 256;
        let sites: Vec<u32> = (0..self.partition.sites() as u32).collect();
        let mut gathered = SharedRows::gather(block, sites.len());
        for sites in sites.chunks(BATCH) {
            let rows = self.gather_rows(sites, &own);
            let mut batch = RowBatch::new(block);
            for r in 0..rows.rows() {
                let (columns, blocks) = rows.row(r);
                batch.push(columns, blocks);
            }
            gathered.append(batch);
        }
        gathered.finish()
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
