//! Threads as processes, and runs of scenes by them.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Barrier, Mutex};

use bondline::observe::checkpoint::Pace;
use bondline::predict::{Prediction, Processes, predict, processes};
use bondline::progress::Silent;
use bondline::run::{AnyScene, RunError, RunOptions, StartFrom};
use bondline::scene::Source;
use bondline::system::{
    Exchange, NeighbourGraph, RankRows, RankSolve, RankSolver, RankSolverKind, Ranks, Traffic,
};
use nalgebra::{DMatrix, DVector};

use crate::pieces::assert_same_numbers;

/// State that the threads of a run share.
#[derive(Debug)]
struct Board {
    words: Mutex<Vec<Vec<u64>>>,
    barrier: Barrier,
    /// Gathers of all threads.
    gathers: AtomicUsize,
    /// Calls of all threads that gather numbers of all sites, or the like.
    of_all: AtomicUsize,
    /// Solvers of all threads.
    solvers: AtomicUsize,
    /// Bytes that came to each thread by exchanges.
    received: Mutex<Vec<u64>>,
}

impl Board {
    fn of(count: usize) -> Self {
        Self {
            words: Mutex::new(vec![Vec::new(); count]),
            barrier: Barrier::new(count),
            gathers: AtomicUsize::new(0),
            of_all: AtomicUsize::new(0),
            solvers: AtomicUsize::new(0),
            received: Mutex::new(vec![0; count]),
        }
    }
}

/// One thread as a process.
#[derive(Debug)]
struct ThreadRank {
    rank: usize,
    board: Arc<Board>,
    /// Gathers that are left until all are killed.
    left: Mutex<usize>,
}

impl Ranks for ThreadRank {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.board.words.lock().unwrap().len()
    }

    fn gather_into(&self, own: &[f64], lengths: &[usize], all: &mut [f64]) {
        self.board.of_all.fetch_add(1, Ordering::Relaxed);
        assert_eq!(own.len(), lengths[self.rank]);
        let words: Vec<u64> = own.iter().map(|x| x.to_bits()).collect();
        let found = self.gather_words(&words).concat();
        assert_eq!(found.len(), all.len());
        all.iter_mut()
            .zip(found)
            .for_each(|(to, word)| *to = f64::from_bits(word));
    }

    fn gather_words(&self, own: &[u64]) -> Vec<Vec<u64>> {
        let mut left = self.left.lock().unwrap();
        assert!(*left > 0, "killed");
        *left -= 1;
        self.board.gathers.fetch_add(1, Ordering::Relaxed);
        self.told_to_all(own)
    }

    fn add_into(&self, sums: &mut [i64]) {
        let words: Vec<u64> = sums.iter().map(|n| n.cast_unsigned()).collect();
        sums.fill(0);
        for part in self.gather_words(&words) {
            sums.iter_mut()
                .zip(part)
                .for_each(|(sum, n)| *sum += n.cast_signed());
        }
    }

    fn exchange(&self, own: usize, wanted: &[u64], block: usize) -> Box<dyn Exchange> {
        assert!(wanted.is_sorted());
        self.gather_words(&[own as u64]);
        Box::new(Told {
            rank: self.another(),
            wanted: wanted.to_vec(),
            block,
            own: None,
        })
    }

    fn parts(&self, graph: &NeighbourGraph, count: usize) -> Result<Vec<u32>, String> {
        // by rings of neighbours around the first site
        let sites = graph.starts.len() - 1;
        let (mut order, mut seen) = (Vec::new(), vec![false; sites]);
        for first in 0..sites as u32 {
            let mut next = order.len();
            if !std::mem::replace(&mut seen[first as usize], true) {
                order.push(first);
            }
            while next < order.len() {
                for &j in graph.of(order[next]) {
                    if !std::mem::replace(&mut seen[j as usize], true) {
                        order.push(j);
                    }
                }
                next += 1;
            }
        }
        let mut parts = vec![0; sites];
        (order.iter().enumerate())
            .for_each(|(k, &s)| parts[s as usize] = (k * count / sites) as u32);
        Ok(parts)
    }

    fn solver<'a>(
        &'a self,
        rows: RankRows<'a>,
        _: RankSolverKind,
    ) -> Result<Box<dyn RankSolver + 'a>, String> {
        self.board.solvers.fetch_add(1, Ordering::Relaxed);
        // the first thread has all rows, and factorises them as one matrix
        let (d, partition) = (rows.matrix.block, rows.partition);
        let mut own = Vec::new();
        for (r, &site) in partition.of(self.rank).iter().enumerate() {
            let (columns, blocks) = rows.matrix.row(r);
            for (c, block) in columns.iter().zip(blocks.chunks_exact(d * d)) {
                for (k, value) in block.iter().enumerate() {
                    let row = partition.number(site) as usize * d + k / d;
                    let column = partition.number(*c) as usize * d + k % d;
                    let free = |s: u32, a: usize| !rows.prescribed[s as usize * d + a];
                    if free(site, k / d) && free(*c, k % d) {
                        own.extend([row as u64, column as u64, value.to_bits()]);
                    }
                }
            }
        }
        let entries = self.gather_words(&own).concat();
        let factors = (self.rank == 0).then(|| {
            let size = partition.sites() * d;
            let mut matrix = DMatrix::<f64>::zeros(size, size);
            for entry in entries.chunks_exact(3) {
                matrix[(entry[0] as usize, entry[1] as usize)] += f64::from_bits(entry[2]);
            }
            for k in 0..size {
                if matrix.row(k).iter().all(|x| *x == 0.0) {
                    matrix[(k, k)] = 1.0;
                }
            }
            matrix.lu()
        });
        Ok(Box::new(Dense {
            factors,
            rank: self.another(),
            lengths: partition.lengths(d),
        }))
    }
}

impl ThreadRank {
    /// Returns the words of all threads, each giving its own.
    fn told_to_all(&self, own: &[u64]) -> Vec<Vec<u64>> {
        self.board.words.lock().unwrap()[self.rank] = own.to_vec();
        self.board.barrier.wait();
        let all = self.board.words.lock().unwrap().clone();
        self.board.barrier.wait();
        all
    }

    /// The same, of which another part of a run makes its calls.
    fn another(&self) -> Self {
        Self {
            rank: self.rank,
            board: Arc::clone(&self.board),
            left: Mutex::new(usize::MAX),
        }
    }
}

/// Blocks on their way.
#[derive(Debug)]
struct Told {
    rank: ThreadRank,
    wanted: Vec<u64>,
    block: usize,
    own: Option<Vec<f64>>,
}

impl Exchange for Told {
    fn begin(&mut self, own: &[f64]) {
        assert!(self.own.replace(own.to_vec()).is_none(), "begun twice");
    }

    fn end(&mut self, wanted: &mut [f64]) {
        let own = self.own.take().expect("an exchange that has begun");
        let own: Vec<u64> = own.iter().map(|x| x.to_bits()).collect();
        let all = self.rank.told_to_all(&own).concat();
        assert_eq!(wanted.len(), self.wanted.len() * self.block);
        for (to, &block) in wanted.chunks_exact_mut(self.block).zip(&self.wanted) {
            let from = &all[block as usize * self.block..][..self.block];
            to.iter_mut()
                .zip(from)
                .for_each(|(to, word)| *to = f64::from_bits(*word));
        }
        let received = &mut self.rank.board.received.lock().unwrap()[self.rank.rank];
        *received += 8 * wanted.len() as u64;
    }
}

/// All rows, factorised by the first thread.
struct Dense {
    factors: Option<nalgebra::LU<f64, nalgebra::Dyn, nalgebra::Dyn>>,
    rank: ThreadRank,
    lengths: Vec<usize>,
}

impl RankSolver for Dense {
    fn solve_into(&mut self, b: &[f64], x: &mut [f64], _: f64, _: usize) -> RankSolve {
        let mut all = vec![0.0; self.lengths.iter().sum()];
        self.rank.gather_into(b, &self.lengths, &mut all);
        let found = self.factors.as_ref().map_or_else(Vec::new, |factors| {
            let found = factors.solve(&DVector::from_vec(all));
            let found = found.expect("a regular matrix");
            found.iter().map(|x| x.to_bits()).collect()
        });
        let found = self.rank.told_to_all(&found).concat();
        let first: usize = self.lengths[..self.rank.rank].iter().sum();
        for (x, word) in x.iter_mut().zip(&found[first..]) {
            *x = f64::from_bits(*word);
        }
        RankSolve {
            iterations: 1,
            failure: None,
        }
    }
}

/// Settings of the run of a scene.
#[derive(Clone, Copy)]
pub struct How {
    /// Threads that are its processes; none for a run that knows of no others.
    pub ranks: usize,
    pub start: StartFrom,
    pub every: Option<Pace>,
    /// Gathers until the processes are killed.
    pub lives: usize,
}

pub const ALONE: How = How {
    ranks: 0,
    start: StartFrom::Beginning,
    every: None,
    lives: usize::MAX,
};

/// A run that has come to its end.
#[derive(Debug, PartialEq)]
pub struct Done {
    /// Gathers of each process.
    pub gathers: usize,
    /// Its sizes, proof and warnings: what is printed of the proof, as figures end in other digits where rows are gathered.
    pub told: String,
    /// Exchange of each process in steps, and the number of these, by the summary.
    pub traffic: (Vec<Traffic>, u64),
    /// Bytes that exchanges brought to each process, as the threads count them.
    pub received: Vec<u64>,
    /// Number of times that each process gathered numbers of all sites, or the like.
    pub of_all: usize,
    /// Solvers that each process set up.
    pub solvers: usize,
}

/// Report of a process on its run.
type ToldByProcess = (String, (Vec<Traffic>, u64));

/// Runs a scene in a folder, or says why it did not come to its end.
pub fn run(text: &str, folder: &Path, how: How) -> Result<Done, String> {
    let one = |ranks: Option<&dyn Ranks>| -> Result<ToldByProcess, RunError> {
        let source = Source::new("scene.toml", text.to_owned());
        let mut scene = AnyScene::from_source(&source, folder, "scene").expect("a valid scene");
        scene.set_output_directory(folder.to_owned());
        let options = RunOptions {
            start: how.start,
            checkpoint_every: how.every,
            ranks,
            ..RunOptions::default()
        };
        let done = scene.run_with(&options, &Silent)?;
        let parts = done.proof.parts.iter();
        let proof: Vec<_> = parts.map(|part| (part.name, &part.line)).collect();
        let motion = done.motion.as_ref();
        let ended = motion.map(|m| (m.steps, m.broken_bonds, &m.edge_reached));
        let told = format!("{:?} {proof:?} {:?} {ended:?}", done.sizes, done.warnings);
        let traffic = motion.map_or((Vec::new(), 0), |m| (m.processes.clone(), m.steps));
        Ok((told, traffic))
    };
    if how.ranks == 0 {
        // one thread, as each process has
        let [told] = &on_processes(1, |_| one(None).map_err(|e| e.to_string()))[..] else {
            unreachable!("one thread");
        };
        let (told, traffic) = told.clone()?;
        return Ok(Done {
            gathers: 0,
            told,
            traffic,
            received: Vec::new(),
            of_all: 0,
            solvers: 0,
        });
    }
    let [gathers, solvers] = [(); 2].map(|()| AtomicUsize::new(0));
    let (of_all, received) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let ends = on_processes_for(how.ranks, how.lives, |rank| {
        let end = one(Some(rank)).map_err(|e| e.to_string());
        gathers.store(
            rank.board.gathers.load(Ordering::Relaxed),
            Ordering::Relaxed,
        );
        for (sum, to) in [
            (&rank.board.of_all, &of_all),
            (&rank.board.solvers, &solvers),
        ] {
            to.store(sum.load(Ordering::Relaxed), Ordering::Relaxed);
        }
        rank.board
            .received
            .lock()
            .unwrap()
            .clone_into(&mut received.lock().unwrap());
        end
    });
    let ends: Vec<Result<ToldByProcess, String>> = ends
        .into_iter()
        .map(|end| end.unwrap_or_else(|| Err("killed".to_owned())))
        .collect();
    // all of them tell the same
    assert!(ends.iter().all(|end| *end == ends[0]), "{ends:?}");
    let end = ends.into_iter().next().expect("a process");
    let gathers = gathers.load(Ordering::Relaxed) / how.ranks;
    end.map(|(told, traffic)| Done {
        gathers,
        told,
        traffic,
        received: received.into_inner().unwrap(),
        of_all: of_all.load(Ordering::Relaxed) / how.ranks,
        solvers: solvers.load(Ordering::Relaxed) / how.ranks,
    })
}

/// Returns the result of the work of each of some processes.
pub fn on_processes<T: Send>(count: usize, work: impl Fn(&dyn Ranks) -> T + Sync) -> Vec<T> {
    let done = on_processes_for(count, usize::MAX, |rank| work(rank));
    done.into_iter()
        .map(|done| done.expect("no panic"))
        .collect()
}

/// As [`on_processes`], until all have gathered so often; none of those that are killed then.
fn on_processes_for<T: Send>(
    count: usize,
    lives: usize,
    work: impl Fn(&ThreadRank) -> T + Sync,
) -> Vec<Option<T>> {
    let board = Arc::new(Board::of(count));
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..count)
            .map(|rank| {
                let rank = ThreadRank {
                    rank,
                    board: Arc::clone(&board),
                    left: Mutex::new(lives),
                };
                let work = &work;
                scope.spawn(move || {
                    // a pool of its own: a thread that waits for others must not hold up theirs
                    let pool = rayon::ThreadPoolBuilder::new()
                        .num_threads(1)
                        .build()
                        .unwrap();
                    pool.install(|| work(&rank))
                })
            })
            .collect();
        threads.into_iter().map(|t| t.join().ok()).collect()
    })
}

/// The files of a folder.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    entries
        .map(|e| e.expect("an entry"))
        .map(|e| {
            let name = e.file_name().to_string_lossy().into_owned();
            (name, std::fs::read(e.path()).expect("a file"))
        })
        .filter(|(name, _)| !name.ends_with(".lock"))
        .collect()
}

pub fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder")
}

/// A scene has the same numbers on any number of processes, and the same bytes but for VTU files, of which each process has its part. Returns the files of one.
pub fn assert_same(text: &str, ranks: &[usize]) -> BTreeMap<String, Vec<u8>> {
    let one = folder();
    let told = run(text, one.path(), ALONE).expect("one process").told;
    let wanted = files(one.path());
    assert!(
        wanted.keys().any(|name| name.ends_with("_history.csv")),
        "{:?}",
        wanted.keys()
    );
    for &ranks in ranks {
        let several = folder();
        let done = run(text, several.path(), How { ranks, ..ALONE }).expect("several processes");
        assert_eq!(done.told, told, "on {ranks} processes");
        let sizes = assert_same_numbers(one.path(), several.path());
        assert_eq!(sizes.is_empty(), ranks == 1, "on {ranks} processes");
    }
    wanted
}

fn scene(text: &str, folder: &Path) -> AnyScene {
    let source = Source::new("scene.toml", text.to_owned());
    AnyScene::from_source(&source, folder, "scene").expect("a valid scene")
}

/// Returns the prediction for one process.
pub fn alone(text: &str) -> Prediction {
    let folder = folder();
    predict(scene(text, folder.path()), &Silent).expect("a prediction")
}

/// Returns the prediction for some processes.
pub fn predicted(text: &str, ranks: usize) -> Processes {
    let predict = |partitioner: &dyn Ranks| predicted_by(text, ranks, Some(partitioner));
    on_processes(1, predict).remove(0)
}

/// Returns the prediction for some processes, with a partitioner of graphs or by bisection.
pub fn predicted_by(text: &str, ranks: usize, partitioner: Option<&dyn Ranks>) -> Processes {
    let scene = scene(text, Path::new("."));
    processes(scene, ranks, partitioner, &Silent).expect("a prediction")
}
