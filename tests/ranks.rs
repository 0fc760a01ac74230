//! Scenes on several processes have the results of one: processes are threads here, which gather as those of `mpirun` do. `.ci/petsc` runs the same on MPI.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Barrier, Mutex};

use bondline::observe::checkpoint::Pace;
use bondline::progress::Silent;
use bondline::run::{AnyScene, RunError, RunOptions, StartFrom};
use bondline::scene::Source;
use bondline::system::{RankRows, RankSolve, RankSolver, RankSolverKind, Ranks};
use nalgebra::{DMatrix, DVector};

/// What the threads of a run share.
#[derive(Debug)]
struct Board {
    words: Mutex<Vec<Vec<u64>>>,
    barrier: Barrier,
    /// Gathers of all threads.
    gathers: AtomicUsize,
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
        self.board.words.lock().unwrap()[self.rank] = own.to_vec();
        self.board.barrier.wait();
        let all = self.board.words.lock().unwrap().clone();
        self.board.barrier.wait();
        all
    }

    fn solver(
        &self,
        rows: &RankRows<'_>,
        _: RankSolverKind,
    ) -> Result<Box<dyn RankSolver>, String> {
        // every thread has all rows, and factorises them as one matrix
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
        let size = partition.sites() * d;
        let mut matrix = DMatrix::<f64>::zeros(size, size);
        for entry in self.gather_words(&own).concat().chunks_exact(3) {
            matrix[(entry[0] as usize, entry[1] as usize)] += f64::from_bits(entry[2]);
        }
        for k in 0..size {
            if matrix.row(k).iter().all(|x| *x == 0.0) {
                matrix[(k, k)] = 1.0;
            }
        }
        Ok(Box::new(Dense {
            matrix: matrix.lu(),
            rank: Self {
                rank: self.rank,
                board: Arc::clone(&self.board),
                left: Mutex::new(usize::MAX),
            },
            lengths: partition.lengths(d),
        }))
    }
}

/// All rows, factorised.
struct Dense {
    matrix: nalgebra::LU<f64, nalgebra::Dyn, nalgebra::Dyn>,
    rank: ThreadRank,
    lengths: Vec<usize>,
}

impl RankSolver for Dense {
    fn solve_into(&mut self, b: &[f64], x: &mut [f64], _: f64, _: usize) -> RankSolve {
        let mut all = vec![0.0; self.lengths.iter().sum()];
        self.rank.gather_into(b, &self.lengths, &mut all);
        let found = self
            .matrix
            .solve(&DVector::from_vec(all))
            .expect("a regular matrix");
        let first: usize = self.lengths[..self.rank.rank].iter().sum();
        x.copy_from_slice(&found.as_slice()[first..first + x.len()]);
        RankSolve {
            iterations: 1,
            failure: None,
        }
    }
}

/// How a scene is run.
#[derive(Clone, Copy)]
struct How {
    /// Threads that are its processes; none for a run that knows of no others.
    ranks: usize,
    start: StartFrom,
    every: Option<Pace>,
    /// Gathers until the processes are killed.
    lives: usize,
}

const ALONE: How = How {
    ranks: 0,
    start: StartFrom::Beginning,
    every: None,
    lives: usize::MAX,
};

/// Runs a scene in a folder: the gathers of each process, or why they did not come to the end.
fn run(text: &str, folder: &Path, how: How) -> Result<usize, String> {
    let one = |ranks: Option<&dyn Ranks>| -> Result<(), RunError> {
        let source = Source::new("scene.toml", text.to_owned());
        let mut scene = AnyScene::from_source(&source, folder, "scene").expect("a valid scene");
        scene.set_output_directory(folder.to_owned());
        let options = RunOptions {
            start: how.start,
            checkpoint_every: how.every,
            ranks,
            ..RunOptions::default()
        };
        scene.run_with(&options, &Silent).map(drop)
    };
    if how.ranks == 0 {
        return one(None).map(|()| 0).map_err(|e| e.to_string());
    }
    let board = Arc::new(Board {
        words: Mutex::new(vec![Vec::new(); how.ranks]),
        barrier: Barrier::new(how.ranks),
        gathers: AtomicUsize::new(0),
    });
    let ends: Vec<Result<(), String>> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..how.ranks)
            .map(|rank| {
                let rank = ThreadRank {
                    rank,
                    board: Arc::clone(&board),
                    left: Mutex::new(how.lives),
                };
                let one = &one;
                scope.spawn(move || {
                    // a pool of its own: a thread that waits for others must not hold up theirs
                    let pool = rayon::ThreadPoolBuilder::new()
                        .num_threads(1)
                        .build()
                        .unwrap();
                    pool.install(|| one(Some(&rank))).map_err(|e| e.to_string())
                })
            })
            .collect();
        let ends = threads.into_iter().map(|t| t.join());
        ends.map(|end| end.unwrap_or_else(|_| Err("killed".to_owned())))
            .collect()
    });
    // all of them tell the same
    assert!(ends.iter().all(|end| *end == ends[0]), "{ends:?}");
    let end = ends.into_iter().next().expect("a process");
    end.map(|()| board.gathers.load(Ordering::Relaxed) / how.ranks)
}

/// The files of a folder.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
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

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder")
}

/// A scene has the same bytes on any number of processes.
fn assert_same(text: &str, ranks: &[usize]) -> BTreeMap<String, Vec<u8>> {
    let one = folder();
    run(text, one.path(), ALONE).expect("one process");
    let wanted = files(one.path());
    assert!(
        wanted.keys().any(|name| name.ends_with("_history.csv")),
        "{:?}",
        wanted.keys()
    );
    for &ranks in ranks {
        let several = folder();
        run(text, several.path(), How { ranks, ..ALONE }).expect("several processes");
        let found = files(several.path());
        assert!(found.keys().eq(wanted.keys()), "{:?}", found.keys());
        for (name, bytes) in &found {
            assert!(*bytes == wanted[name], "{name} on {ranks} processes");
        }
    }
    wanted
}

const PULLED_PLATE: &str = r#"
kinematics = "plane-stress"

[mesh.rectangle]
min = [0, 0]
max = [0.04, 0.02]
x = { cells = 40 }
y = { cells = 20 }

[peridynamics]
horizon = 1e-3
points.lattice = { spacing = "1e-3/3" }

[zones]
damage-at-edge = "warn"

[zones.nonlocal]
box = { min = [0, 0.0061], max = [0.0401, 0.0141] }

[cracks.notch]
segment = { from = [-0.01, 0.01], to = [0.015, 0.01] }

[solve.explicit]
duration = 10e-6
outputs = 3
history-interval = 0.5e-6

[conditions.below.traction]
on = "bottom"
y = -4e6

[conditions.above.traction]
on = "top"
y = 4e6

[output]
tips.front = { direction = [1, 0] }
sections.cut = { point = [0.02, 0.01], normal = [1, 0] }
"#;

/// A plate whose crack runs, with its material and coupling.
fn plate(material: &str, coupling: &str, more: &str) -> String {
    format!(
        "{more}\n{PULLED_PLATE}\n[materials.glass.{material}]\nyoungs-modulus = 72e9\ndensity = 2440\nfracture-energy = 3.8\n{}\n{coupling}\n",
        if material == "lps" {
            "poisson-ratio = 0.25"
        } else {
            ""
        }
    )
}

#[test]
fn cracks_run_alike_on_any_number_of_processes() {
    let text = plate("bond-based", "[coupling.truncated]", "");
    let one = assert_same(&text, &[1, 2, 5]);
    // bonds have broken, or nothing was compared
    let table = String::from_utf8(one["scene_tip_front.csv"].clone()).unwrap();
    assert!(table.lines().count() > 3, "{table}");
}

#[test]
fn so_do_those_of_a_solid_and_of_listed_bonds() {
    assert_same(&plate("lps", "[coupling.truncated]", ""), &[3]);
    let listed = plate("lps", "[coupling.splice]", "")
        .replace("points.lattice", "precision = \"single\"\npoints.lattice");
    assert_same(&listed, &[4]);
}

/// A ball strikes the upper edge, across sites of several processes.
#[test]
fn an_impactor_pushes_sites_of_all_processes_alike() {
    let ball = "[impactors.ball]\nsphere = { center = [0.019, 0.0221], radius = 0.002 }\nmass = 0.03\nvelocity = { y = -40 }\n";
    let text = plate("bond-based", "[coupling.truncated]", "") + ball;
    let cut = "sections.cut = { point = [0.02, 0.01], normal = [1, 0] }\n";
    assert!(text.contains(cut));
    let text = text.replace(cut, "");
    let one = assert_same(&text, &[2, 3]);
    let table = String::from_utf8(one["scene_history.csv"].clone()).unwrap();
    let force = |row: &str| -> f64 { row.rsplit(',').next().unwrap().parse().unwrap() };
    assert!(table.lines().skip(1).any(|row| force(row) < 0.0), "{table}");
}

/// A pulse through a bar.
const WAVE: &str = r#"
kinematics = "bar"

[mesh.line]
min = 0
max = 100
x = { cells = 400 }

[materials.bar.bond-based]
youngs-modulus = 1
density = 1

[peridynamics]
horizon = 0.75

[zones.nonlocal]
box = { min = 60, max = 80 }

[coupling.splice]

[solve.explicit]
duration = 20
outputs = 4
history-interval = 0.25

[initial.hump.displacement]
x = "0.01 * exp(-((x - 55) / 4)^2)"

[conditions.left.displacement]
on = "left"
x = 0

[output]
probes.within = { at = 70 }
"#;

#[test]
fn a_pulse_crosses_seams_alike_also_where_there_are_more_processes_than_sites() {
    assert_same(WAVE, &[2, 3]);
    let few = WAVE
        .replace("cells = 400", "cells = 4")
        .replace("[coupling.splice]", "");
    let few = few.replace("[peridynamics]\nhorizon = 0.75\n", "coupling = \"local\"\n");
    let few = few.replace("[zones.nonlocal]\nbox = { min = 60, max = 80 }\n", "");
    let few = format!(
        "coupling = \"local\"\n{}",
        few.replace("coupling = \"local\"\n", "")
    );
    assert_same(&few, &[7]);
}

#[test]
fn a_run_that_was_killed_goes_on_with_other_processes() {
    let text = plate("bond-based", "[coupling.truncated]", "");
    let every = Some(Pace::Steps(20));
    let one = folder();
    run(&text, one.path(), How { every, ..ALONE }).expect("one process");
    let whole = How {
        ranks: 2,
        every,
        ..ALONE
    };
    let gathers = run(&text, folder().path(), whole).expect("two processes");
    let several = folder();
    let killed = How {
        lives: gathers * 9 / 10,
        ..whole
    };
    assert_eq!(run(&text, several.path(), killed), Err("killed".to_owned()));
    let left = files(several.path());
    assert!(left.contains_key("scene.checkpoint"), "{:?}", left.keys());
    assert!(left["scene_history.csv"].len() < files(one.path())["scene_history.csv"].len());
    for ranks in [4, 0] {
        let resumed = folder();
        for (name, bytes) in &left {
            std::fs::write(resumed.path().join(name), bytes).unwrap();
        }
        let how = How {
            ranks,
            start: StartFrom::Checkpoint,
            every,
            lives: usize::MAX,
        };
        run(&text, resumed.path(), how).expect("the rest of the run");
        for (name, bytes) in files(one.path()) {
            assert!(
                files(resumed.path())[&name] == bytes,
                "{name} resumed on {ranks}"
            );
        }
    }
}

#[test]
fn clocks_pace_no_checkpoints_of_several_processes() {
    let how = How {
        ranks: 2,
        every: Some(Pace::Clock(std::time::Duration::from_secs(1))),
        ..ALONE
    };
    let told = run(WAVE, folder().path(), how).expect_err("refused");
    assert!(told.contains("count steps"), "{told}");
}

/// A bar at rest.
fn bar(coupling: &str) -> String {
    format!(
        r#"
kinematics = "bar"

[mesh.line]
min = -0.5
max = 0.5
x = {{ cells = 100 }}

[materials.bar.lps]
youngs-modulus = 200e9
poisson-ratio = 0

[peridynamics]
horizon = 0.03

[zones.nonlocal]
box = {{ min = -0.25, max = 0.25 }}

[zones.transition]
around = 0.1

{coupling}

[conditions.left.displacement]
on = "left"
x = "1e-3*x"

[conditions.right.traction]
on = "right"
x = 200e6

[output]
lines.axis = {{ from = -0.5, to = 0.5, samples = 41 }}
sections.middle = {{ point = 0.003, normal = 1 }}
"#
    )
}

/// The rows of a CSV file of a folder.
fn rows(folder: &Path, name: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(folder.join(name)).expect("a table");
    let numbers = |line: &str| line.split(',').map(|x| x.parse().unwrap_or(0.0)).collect();
    text.lines().skip(1).map(numbers).collect()
}

#[test]
fn bars_at_rest_are_straight_on_any_number_of_processes() {
    for coupling in [
        "[coupling.splice]",
        "[coupling.blending]",
        "[coupling.balanced]",
        "[coupling.truncated]",
        "[coupling.partial-stress]\nform = \"meshfree\"",
    ] {
        for ranks in [1, 3] {
            let folder = folder();
            run(&bar(coupling), folder.path(), How { ranks, ..ALONE }).expect(coupling);
            for row in rows(folder.path(), "scene_axis.csv") {
                let off = (row[1] - 1e-3 * row[0]).abs();
                assert!(off < 1e-9 * 5e-4, "{coupling} on {ranks}: {row:?}");
            }
            let force = rows(folder.path(), "scene_sections.csv")[0][0];
            assert!(
                (force / 200e6 - 1.0).abs() < 1e-9,
                "{coupling} on {ranks}: {force}"
            );
        }
    }
}

#[test]
fn springs_swing_alike_and_are_refused_at_rest() {
    let spring = "[conditions.bed.spring]\ninside.box = { min = 40, max = 75 }\nx = 0.01\n";
    assert_same(&format!("{WAVE}\n{spring}"), &[3]);
    let still = format!("{}\n{spring}", bar("[coupling.splice]"));
    let still = still.replace("min = 40, max = 75", "min = 0, max = 0.5");
    let how = How { ranks: 2, ..ALONE };
    let told = run(&still, folder().path(), how).expect_err("refused");
    assert!(
        told.contains("springs in a static scene of several processes"),
        "{told}"
    );
}

#[test]
fn what_is_free_to_move_is_told_by_all() {
    let free = PULLED_PLATE
        .split("[solve.explicit]")
        .next()
        .expect("a plate");
    let free = free.replace("damage-at-edge = \"warn\"\n", "");
    let free = format!(
        "{free}\n[materials.glass.lps]\nyoungs-modulus = 1\npoisson-ratio = 0.25\n[coupling.splice]\n[conditions.below.displacement]\non = \"bottom\"\ny = 0\n"
    );
    let alone = run(&free, folder().path(), ALONE).expect_err("free");
    let several = run(&free, folder().path(), How { ranks: 3, ..ALONE }).expect_err("free");
    assert!(alone.contains("free to move"), "{alone}");
    assert_eq!(alone, several);
}
