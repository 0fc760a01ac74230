//! Replay of the inputs that fuzzing has found, and random scenes; `docs/stability.md` says how more of both is run.

mod entry;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use bondline::observe::summary::{bytes_text, peak_memory_bytes};
use entry::Outcome;
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};

/// The longest that a case may take: far more than any does, also on a machine in use, so that only a hang exceeds it.
const BUDGET: Duration = Duration::from_secs(300);
/// The most memory that this process may ever hold.
const MOST_MEMORY: u64 = 2 << 30;

/// Every file that is kept for a target ends as it should.
fn replay(target: &str, entry: fn(&[u8]) -> Outcome) {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .join("tests/fuzz/corpus")
        .join(target);
    let mut cases = 0;
    for file in std::fs::read_dir(&folder).expect("the corpus is in the repository") {
        let path = file.expect("the corpus can be read").path();
        let data = std::fs::read(&path).expect("the corpus can be read");
        let begun = Instant::now();
        let ended = catch_unwind(|| entry(&data));
        assert!(ended.is_ok(), "{}", path.display());
        assert!(begun.elapsed() < BUDGET, "{}", path.display());
        cases += 1;
    }
    assert!(cases > 0, "{}", folder.display());
}

#[test]
fn kept_scene_texts() {
    replay("scene_text", entry::scene_text);
}

#[test]
fn kept_mesh_files() {
    replay("mesh_file", entry::mesh_file);
}

#[test]
fn kept_random_scenes() {
    replay("random_scene", entry::random_scene);
}

#[test]
fn kept_binary_files() {
    replay("binary_file", entry::binary_file);
}

/// A genuine checkpoint goes on; with a byte altered, cut or repeated, and its checksum right, it goes on or is refused by name. So are arrays of VTU
/// files that announce anything. `BONDLINE_ALTERED` says how many of each.
#[test]
fn altered_checkpoints_and_arrays_are_refused_by_name() {
    let count = from_environment("BONDLINE_ALTERED", 150);
    let whole = entry::genuine_checkpoint();
    assert_eq!(entry::binary_file(&whole), Outcome::Solved);
    let mut ends: BTreeMap<String, usize> = BTreeMap::new();
    let mut note = |data: &[u8], what: &dyn Fn() -> String| {
        let ended = catch_unwind(|| entry::binary_file(data));
        let ended = ended.unwrap_or_else(|_| panic!("{}: {data:?}", what()));
        *ends.entry(format!("{ended:?}")).or_default() += 1;
    };
    for number in 0..count {
        let random = bytes(number);
        let at = 1 + usize::from(u16::from_le_bytes([random[0], random[1]])) % (whole.len() - 1);
        let mut altered = whole.clone();
        match random[2] % 4 {
            0 => altered[at] = random[3],
            1 => altered.truncate(at),
            2 => altered.insert(at, random[3]),
            _ => altered[at] ^= 1 << (random[3] % 8),
        }
        note(&altered, &|| format!("checkpoint {number}, byte {at}"));
        let length = usize::from(random[4]) % random.len();
        let mut array = random[5..].to_vec();
        array.truncate(2 + length);
        // small numbers in the header let it through more often
        if random[3].is_multiple_of(2) {
            (2..array.len().min(26)).for_each(|k| array[k] &= if k % 4 == 2 { 31 } else { 0 });
        }
        array[0] &= !3;
        note(&array, &|| format!("array {number}"));
    }
    for (end, times) in &ends {
        println!("{times:7}  {end}");
    }
    assert!(peak_memory_bytes().is_none_or(|b| b < MOST_MEMORY));
}

/// A number from the environment, or what a plain `cargo test` takes.
fn from_environment(key: &str, plain: u64) -> u64 {
    std::env::var(key).map_or(plain, |text| text.parse().expect("a whole number"))
}

/// Random scenes solve or are refused by name, and at least half of them solve.
///
/// `BONDLINE_RANDOM_SCENES` and `BONDLINE_RANDOM_FROM` say how many and from which number on; scene `n` is the same wherever it is made.
#[test]
fn random_scenes_solve_or_are_refused_by_name() {
    // of the first fourteen, which `.ci/run` runs with fifty more, three take ten times as long as all of these
    let count = from_environment("BONDLINE_RANDOM_SCENES", 46);
    let from = from_environment("BONDLINE_RANDOM_FROM", 14);
    let mut tally = Tally::new(from, entry::random_text);
    for number in from..from + count {
        let Some(outcome) = tally.run(number, entry::random_scene) else {
            continue;
        };
        tally.ended(match outcome {
            Outcome::Solved => SOLVED.to_owned(),
            Outcome::Refused(kind) => format!("refused: {kind}"),
            Outcome::Skipped(why) => format!("not run: {why}"),
        });
    }
    tally.print();
    assert!(tally.broken.is_empty(), "scenes {:?}", tally.broken);
    let solved = tally.ends.get(SOLVED).copied().unwrap_or(0) as u64;
    assert!(2 * solved >= count, "{solved} of {count} solve");
}

const SOLVED: &str = "solved";

/// Outcomes of random scenes, and their cost.
struct Tally {
    text: fn(&[u8]) -> String,
    /// The scene that runs, for [`watch`].
    at: Arc<AtomicU64>,
    ends: BTreeMap<String, usize>,
    /// Scenes that panicked.
    broken: Vec<u64>,
    slowest: (Duration, u64),
    total: Duration,
}

impl Tally {
    fn new(from: u64, text: fn(&[u8]) -> String) -> Self {
        let at = Arc::new(AtomicU64::new(from));
        watch(&at, text);
        Self {
            text,
            at,
            ends: BTreeMap::new(),
            broken: Vec::new(),
            slowest: (Duration::ZERO, from),
            total: Duration::ZERO,
        }
    }

    /// Runs a scene; none if it panics.
    fn run<T>(&mut self, number: u64, scene: fn(&[u8]) -> T) -> Option<T> {
        self.at.store(number, Ordering::Relaxed);
        let data = bytes(number);
        let begun = processor_time();
        let ended = catch_unwind(AssertUnwindSafe(|| scene(&data)));
        let took = processor_time().saturating_sub(begun);
        self.total += took;
        self.slowest = self.slowest.max((took, number));
        // what the next ones run into says which one it was
        assert!(
            peak_memory_bytes().is_none_or(|b| b < MOST_MEMORY),
            "scene {number}"
        );
        if ended.is_err() {
            println!("scene {number}:\n{}", (self.text)(&data));
            self.broken.push(number);
        }
        ended.ok()
    }

    fn ended(&mut self, how: String) {
        *self.ends.entry(how).or_default() += 1;
    }

    fn print(&self) {
        for (end, times) in &self.ends {
            println!("{times:7}  {end}");
        }
        println!(
            "{} scenes in {:.1} s of the processor, the slowest (number {}) {:.2} s, peak memory of all {}",
            self.broken.len() + self.ends.values().sum::<usize>(),
            self.total.as_secs_f64(),
            self.slowest.1,
            self.slowest.0.as_secs_f64(),
            peak_memory_bytes().map_or("unknown".to_owned(), bytes_text)
        );
    }
}

/// Scenes as users type them, with defaults left out, zones drawn across the mesh and meshes from Gmsh: each is proved, warned of or refused by name, and
/// where bondline warns of nothing a scene at rest agrees with its elements alone within what was predicted.
///
/// `BONDLINE_TYPED_SCENES` and `BONDLINE_RANDOM_FROM` say how many and from which number on; scene `n` is the same wherever it is made. With
/// `BONDLINE_SHOW` set the text of each that disagrees is shown; in the folder `BONDLINE_KEEP` the last one stays.
#[test]
fn typed_scenes_are_proved_warned_of_or_refused() {
    let count = from_environment("BONDLINE_TYPED_SCENES", 40);
    let from = from_environment("BONDLINE_RANDOM_FROM", 0);
    let show = std::env::var_os("BONDLINE_SHOW").is_some();
    let mut apart = Vec::new();
    let mut tally = Tally::new(from, entry::typed_text);
    for number in from..from + count {
        let Some(told) = tally.run(number, entry::typed_scene) else {
            continue;
        };
        let end = match (told.outcome, told.warned, told.agreement) {
            (Outcome::Refused(kind), ..) => format!("refused: {kind}"),
            (Outcome::Skipped(why), ..) => format!("not run: {why}"),
            (_, true, _) => "solved, warned of".to_owned(),
            (_, _, None) => "solved without a warning, not compared".to_owned(),
            (_, _, Some(a)) if a.from_elements < 0.01 => {
                "solved without a warning, agrees within 1 %".to_owned()
            }
            (_, _, Some(a)) if a.from_elements < 0.05 && a.holds() => {
                "solved without a warning, agrees within 5 %".to_owned()
            }
            (_, _, Some(a)) if a.holds() => {
                println!("scene {number} agrees as predicted: {a:?}");
                "solved without a warning, agrees as far as predicted".to_owned()
            }
            (_, _, Some(a)) => {
                println!("scene {number} is apart: {a:?}");
                if show {
                    println!("{}", entry::typed_text(&bytes(number)));
                }
                apart.push(number);
                "solved without a warning, is apart".to_owned()
            }
        };
        tally.ended(end);
    }
    tally.print();
    if show {
        println!(
            "the slowest:\n{}",
            entry::typed_text(&bytes(tally.slowest.1))
        );
    }
    assert!(tally.broken.is_empty(), "scenes {:?}", tally.broken);
    assert!(apart.is_empty(), "scenes {apart:?}");
}

/// Time that the threads of this process have computed for; the time of day where the system does not tell.
fn processor_time() -> Duration {
    let of_all = || -> Option<f64> {
        let text = std::fs::read_to_string("/proc/self/stat").ok()?;
        // after the name in brackets: state, ten numbers, then ticks in the program and in the system
        let (_, numbers) = text.rsplit_once(')')?;
        let ticks = numbers.split_whitespace().skip(11).take(2);
        let ticks: Vec<f64> = ticks.filter_map(|t| t.parse().ok()).collect();
        Some(ticks.iter().sum::<f64>() / 100.0)
    };
    static BEGUN: LazyLock<Instant> = LazyLock::new(Instant::now);
    of_all().map_or_else(|| BEGUN.elapsed(), Duration::from_secs_f64)
}

/// Ends the process, with the scene at hand, where one takes longer than the budget: a scene that hangs cannot be unwound.
fn watch(at: &Arc<AtomicU64>, text: fn(&[u8]) -> String) {
    let at = Arc::downgrade(at);
    std::thread::spawn(move || {
        let mut since = (u64::MAX, Instant::now(), processor_time());
        while let Some(at) = at.upgrade() {
            let number = at.load(Ordering::Relaxed);
            if since.0 != number {
                since = (number, Instant::now(), processor_time());
            } else if processor_time().saturating_sub(since.2) > BUDGET
                || since.1.elapsed() > 10 * BUDGET
            {
                let text = text(&bytes(number));
                eprintln!("scene {number} takes longer than {BUDGET:?}:\n{text}");
                std::process::abort();
            }
            drop(at);
            std::thread::sleep(Duration::from_millis(100));
        }
    });
}

/// The bytes of random scene `number`.
fn bytes(number: u64) -> Vec<u8> {
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&number.to_le_bytes());
    let mut rng = TestRng::from_seed(RngAlgorithm::ChaCha, &seed);
    let mut data = vec![0; 200];
    rng.fill_bytes(&mut data);
    data
}
