//! Explicit steps allocate nothing: each pass over bonds, rows, elements and contacts works in memory that it has from the start.

// the allocator counts
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use bondline::progress::Progress;
use bondline::run::AnyScene;
use bondline::scene::Source;

/// The system's allocator, which counts.
struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call goes to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Notes how many allocations there have been after each step.
#[derive(Default)]
struct Steps(Mutex<Vec<u64>>);

impl Progress for Steps {
    fn stage(&self, _name: &str, _total: Option<u64>) {
        if let Ok(mut seen) = self.0.lock() {
            seen.clear();
            seen.reserve(1 << 16);
        }
    }

    fn advance(&self, _by: u64) {
        let now = ALLOCATIONS.load(Ordering::Relaxed);
        if let Ok(mut seen) = self.0.lock()
            && seen.len() < seen.capacity()
        {
            seen.push(now);
        }
    }

    fn finish(&self) {}
}

/// Allocations in each step after the first ten, of a run on one thread.
fn allocations(text: &str) -> Vec<u64> {
    let steps = Steps::default();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let folder = tempfile::tempdir().unwrap();
    pool.unwrap().install(|| {
        let source = Source::new("scene.toml", text);
        let here = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        let mut scene = AnyScene::from_source(&source, here, "scene").unwrap();
        scene.set_output_directory(folder.path().to_owned());
        scene.run(&steps).unwrap();
    });
    let seen = steps.0.into_inner().unwrap();
    let each = seen.windows(2).map(|two| two[1] - two[0]);
    each.skip(10).collect()
}

const PLATE: &str = r#"
kinematics = "plane-stress"
coupling = "COUPLING"
mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 40 }, y = { cells = 20 } }
materials.m.MATERIAL
peridynamics = { horizon = 0.15, points = POINTS, BONDS }
ZONE
initial.swing.velocity = { x = "0.01*x", y = "-0.01*y" }
output.vtu = false
solve.explicit = { duration = DURATION, outputs = 0, history-interval = DURATION }
EXTRA
"#;

#[test]
fn steps_allocate_nothing() {
    let brittle = "bond-based = { youngs-modulus = 1, density = 1, critical-stretch = 0.5 }";
    let solid =
        "lps = { youngs-modulus = 1, poisson-ratio = 0.2, density = 1, critical-stretch = 0.5 }";
    let flowing = "plastic-correspondence = { youngs-modulus = 1, poisson-ratio = 0.3, density = 1, yield-stress = 1e-4 }";
    let zone = "zones.nonlocal.box = { min = [0.7, 0.3], max = [1.3, 0.7] }";
    let lattice = "{ lattice = { spacing = 0.05 } }";
    let exact = "bonds = \"exact\"";
    let impactor = "impactors.ball = { sphere = { center = [1, 1.2], radius = 0.2 }, mass = 1, velocity = [0, -0.1] }";
    let cases = [
        ("lattice", "nonlocal", solid, lattice, exact, "", ""),
        ("list", "nonlocal", brittle, "\"cells\"", exact, "", ""),
        (
            "linear seam",
            "splice",
            solid,
            lattice,
            "bonds = \"linear\"",
            zone,
            "",
        ),
        ("seam", "truncated", brittle, lattice, exact, zone, ""),
        ("elements that flow", "local", flowing, lattice, "", "", ""),
        (
            "contact",
            "nonlocal",
            brittle,
            lattice,
            exact,
            "",
            "contact = {}",
        ),
        ("impactor", "nonlocal", solid, lattice, exact, "", impactor),
    ];
    for (name, coupling, material, points, bonds, zone, extra) in cases {
        let text = PLATE
            .replace("COUPLING", coupling)
            .replace("MATERIAL", material)
            .replace("ZONE", zone)
            .replace("EXTRA", extra)
            .replace("DURATION", "4");
        let text = match coupling {
            "local" => text.replace(
                "peridynamics = { horizon = 0.15, points = POINTS, BONDS }",
                "",
            ),
            _ => text.replace("POINTS", points).replace("BONDS", bonds),
        };
        let found = allocations(&text);
        assert!(found.len() > 20, "{name}: {} steps", found.len());
        // the last step writes a row; points that may touch are searched for now and then, and sites below an impactor are listed while its force grows
        let quiet = found.iter().filter(|count| **count == 0).count();
        let share = if name == "impactor" { 6 } else { 8 };
        assert!(10 * quiet >= share * (found.len() - 1), "{name}: {found:?}");
    }
}
