//! Processes under `mpirun`, and PETSc's solvers over them.

use std::process::exit;
use std::time::Duration;

use bondline::system::{
    Exchange, Ghosts, NeighbourGraph, RankRows, RankSolve, RankSolver, RankSolverKind, Ranks,
    Spread, Symmetry,
};

use crate::shim::{self, GhostVector, Product, System};

/// Variables by which the starters of OpenMPI, MPICH, Intel MPI and PMIx tell a process that it is one of several.
const STARTED: [&str; 4] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMI_RANK", "PMIX_RANK"];

/// Time for which a process with an error waits for the first process to report it: most errors occur on all of them.
const PATIENCE: Duration = Duration::from_secs(3);

/// Exit status of a panic.
const PANICKED: u8 = 101;

/// Returns true if this process was started by `mpirun` or the like.
pub fn is_under_mpi() -> bool {
    STARTED.iter().any(|name| std::env::var_os(name).is_some())
}

/// The processes of an MPI job.
#[derive(Debug)]
pub struct PetscRanks {
    rank: usize,
    count: usize,
}

impl PetscRanks {
    /// Starts MPI and PETSc; once in a process. From then on a panic ends all processes.
    ///
    /// # Errors
    /// In words, where MPI or PETSc does not start, or MPI cannot be called from the threads that compute.
    pub fn start() -> Result<Self, String> {
        let (rank, count, threads) = shim::start()?;
        if !threads {
            return Err(
                "this MPI may be called from one thread only; build it with threads".to_owned(),
            );
        }
        let told = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            told(panic);
            eprintln!("bondline: process {rank} of {count} panicked; all end");
            shim::abort(PANICKED);
            exit(i32::from(PANICKED));
        }));
        Ok(Self { rank, count })
    }

    /// Ends MPI and PETSc, where all processes have come to their end.
    pub fn stop(self) {
        shim::stop();
    }

    /// Ends all processes for an error of this one. The first process tells of it at once; another waits for that, and tells of it if it is its own alone.
    pub fn fail(self, tell: impl FnOnce(), code: u8) -> ! {
        if self.rank > 0 {
            std::thread::sleep(PATIENCE);
            eprintln!("bondline: process {} of {}:", self.rank, self.count);
        }
        tell();
        shim::abort(code);
        exit(i32::from(code))
    }

    /// Returns the value of a result; an error ends all processes.
    fn must<T>(&self, result: Result<T, String>) -> T {
        match result {
            Ok(value) => value,
            Err(message) => {
                eprintln!(
                    "bondline: process {} of {}: {message}",
                    self.rank, self.count
                );
                shim::abort(1);
                exit(1)
            }
        }
    }
}

impl Ranks for PetscRanks {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.count
    }

    fn gather_into(&self, own: &[f64], lengths: &[usize], all: &mut [f64]) {
        self.must(shim::gather(own, lengths, all));
    }

    fn gather_words(&self, own: &[u64]) -> Vec<Vec<u64>> {
        let lengths = self.must(shim::counts(own.len(), self.count));
        let all = self.must(shim::gather_words(own, &lengths));
        let mut rest = all.as_slice();
        let parts = lengths.iter().map(|&n| {
            let (part, tail) = rest.split_at(n);
            rest = tail;
            part.to_vec()
        });
        parts.collect()
    }

    fn add_into(&self, sums: &mut [i64]) {
        self.must(shim::add(sums));
    }

    fn exchange(&self, own: usize, wanted: &[u64], block: usize) -> Box<dyn Exchange> {
        let vector = self.must(GhostVector::new(own, wanted, block));
        let ranks = Self { ..*self };
        Box::new(PetscExchange { vector, ranks })
    }

    fn parts(&self, graph: &NeighbourGraph, count: usize) -> Result<Vec<u32>, String> {
        let has_edges = !graph.neighbours.is_empty();
        if !has_edges {
            return Err("no site is next to another".to_owned());
        }
        shim::parts_of_graph(&graph.starts, &graph.neighbours, count)
    }

    fn solver<'a>(
        &'a self,
        rows: RankRows<'a>,
        kind: RankSolverKind,
    ) -> Result<Box<dyn RankSolver + 'a>, String> {
        let springs = match kind {
            RankSolverKind::Krylov => rows.neighbour_springs(self),
            RankSolverKind::Direct => None,
        };
        let system = match &springs {
            Some(springs) => {
                let near = RankRows {
                    matrix: springs,
                    ..rows
                };
                solver(&near, kind, self.rank, Some(product(rows, self)))?
            }
            None => solver(&rows, kind, self.rank, None)?,
        };
        Ok(Box::new(RowSolver {
            rows,
            kind,
            rank: self.rank,
            is_by_product: springs.is_some(),
            system,
        }))
    }
}

/// A vector of PETSc with ghosts.
#[derive(Debug)]
struct PetscExchange {
    vector: GhostVector,
    ranks: PetscRanks,
}

impl Exchange for PetscExchange {
    fn begin(&mut self, own: &[f64]) {
        self.ranks.must(self.vector.begin(own));
    }

    fn end(&mut self, wanted: &mut [f64]) {
        self.ranks.must(self.vector.end(wanted));
    }
}

/// Products of the rows that a process has, which share their blocks; unknowns that are prescribed keep their numbers.
fn product<'a>(rows: RankRows<'a>, ranks: &'a PetscRanks) -> Box<Product<'a>> {
    let (matrix, d) = (rows.matrix, rows.matrix.block);
    let spread = Spread {
        ranks,
        partition: rows.partition,
    };
    let own = spread.own();
    let mut needed = vec![false; rows.partition.sites()];
    (matrix.columns.iter()).for_each(|&c| needed[c as usize] = true);
    let mut ghosts = Ghosts::new(&spread, &needed, d);
    let mut all = vec![0.0; rows.prescribed.len()];
    let held = held_stiffness(&rows, own);
    Box::new(move |x, y| {
        for (x, &site) in x.chunks_exact(d).zip(own) {
            for (a, x) in x.iter().enumerate() {
                let dof = site as usize * d + a;
                all[dof] = if rows.prescribed[dof] { 0.0 } else { *x };
            }
        }
        ghosts.begin(&all);
        ghosts.end(&mut all);
        matrix.multiply_into(&all, y);
        for ((x, y), held) in x.iter().zip(y).zip(&held) {
            if let Some(stiffness) = held {
                *y = stiffness * x;
            }
        }
    })
}

/// The diagonal of each unknown of the own sites that is prescribed.
fn held_stiffness(rows: &RankRows<'_>, own: &[u32]) -> Vec<Option<f64>> {
    let (matrix, d) = (rows.matrix, rows.matrix.block);
    let of_dof = |k: usize| {
        let (r, site) = (k / d, own[k / d]);
        if !rows.prescribed[site as usize * d + k % d] {
            return None;
        }
        let (columns, blocks) = matrix.row(r);
        let place = columns.binary_search(&site).ok();
        Some(place.map_or(1.0, |e| diagonal(&blocks[e * d * d..], d, k % d)))
    };
    (0..own.len() * d).map(of_dof).collect()
}

/// The matrix of the rows, and what solves with it: with the matrix, or with a product that it preconditions.
fn solver<'a>(
    rows: &RankRows<'_>,
    kind: RankSolverKind,
    rank: usize,
    product: Option<Box<Product<'a>>>,
) -> Result<System<'a>, String> {
    let (matrix, partition) = (rows.matrix, rows.partition);
    let own = partition.of(rank);
    let d = matrix.block;
    let is_own = |c: &&u32| partition.owner(**c) == rank;
    let count = |r: usize| matrix.row(r).0.iter().filter(is_own).count();
    let others: Vec<usize> = (0..own.len())
        .map(|r| matrix.row(r).0.len() - count(r))
        .collect();
    // a row without stiffness at its own site, all of whose unknowns are prescribed
    let lacks = |r: usize| matrix.row(r).0.binary_search(&own[r]).is_err();
    let mine: Vec<usize> = (0..own.len())
        .map(|r| count(r) + usize::from(lacks(r)))
        .collect();
    let is_symmetric = rows.symmetry == Symmetry::Symmetric;
    let mut system = System::new(d, &mine, &others, is_symmetric)?;
    let (mut columns, mut strip) = (Vec::new(), Vec::new());
    for (r, &site) in own.iter().enumerate() {
        let (sites, blocks) = matrix.row(r);
        columns.clear();
        let own_column = lacks(r).then_some(site);
        columns.extend(
            sites
                .iter()
                .chain(&own_column)
                .map(|&c| i64::from(partition.number(c))),
        );
        let width = d * columns.len();
        strip.clear();
        strip.resize(d * width, 0.0);
        if own_column.is_some() {
            (0..d).for_each(|a| strip[a * width + d * sites.len() + a] = 1.0);
        }
        for (e, (&c, block)) in sites.iter().zip(blocks.chunks_exact(d * d)).enumerate() {
            for a in 0..d {
                for b in 0..d {
                    let (row, column) = (site as usize * d + a, c as usize * d + b);
                    strip[a * width + e * d + b] =
                        match (rows.prescribed[row], rows.prescribed[column]) {
                            (false, false) => block[a * d + b],
                            // of the size of its neighbours
                            _ if row == column => diagonal(block, d, a),
                            _ => 0.0,
                        };
                }
            }
        }
        system.set_row(partition.number(site), &columns, &strip)?;
    }
    let positions = own
        .iter()
        .flat_map(|&s| rows.positions[s as usize].into_iter().take(d));
    let xyz: Vec<f64> = positions.collect();
    if let Some(product) = product {
        system.multiply_by(product)?;
    }
    system.finish(&xyz, kind == RankSolverKind::Direct, is_symmetric)?;
    Ok(system)
}

/// The diagonal of a prescribed unknown: its own stiffness, or one if it has none.
fn diagonal(block: &[f64], d: usize, a: usize) -> f64 {
    let own = block[a * d + a].abs();
    if own > 0.0 { own } else { 1.0 }
}

/// A solver of the rows; by products of them, until these do not converge.
struct RowSolver<'a> {
    rows: RankRows<'a>,
    kind: RankSolverKind,
    rank: usize,
    is_by_product: bool,
    system: System<'a>,
}

impl RankSolver for RowSolver<'_> {
    fn solve_into(
        &mut self,
        b: &[f64],
        x: &mut [f64],
        tolerance: f64,
        max_iterations: usize,
    ) -> RankSolve {
        let done = solve_into(&mut self.system, b, x, tolerance, max_iterations);
        if done.failure.is_none() || !self.is_by_product {
            return done;
        }
        self.is_by_product = false;
        match solver(&self.rows, self.kind, self.rank, None) {
            Ok(system) => self.system = system,
            Err(message) => {
                return RankSolve {
                    failure: Some(message),
                    ..done
                };
            }
        }
        let left = max_iterations.saturating_sub(done.iterations);
        let again = solve_into(&mut self.system, b, x, tolerance, left);
        RankSolve {
            iterations: done.iterations + again.iterations,
            ..again
        }
    }
}

fn solve_into(
    system: &mut System<'_>,
    b: &[f64],
    x: &mut [f64],
    tolerance: f64,
    max_iterations: usize,
) -> RankSolve {
    match system.solve(b, x, tolerance, max_iterations) {
        Ok((iterations, failure)) => RankSolve {
            iterations,
            failure,
        },
        Err(message) => {
            // an error inside of a collective call leaves the ranks apart
            x.fill(f64::NAN);
            RankSolve {
                iterations: 0,
                failure: Some(message),
            }
        }
    }
}
