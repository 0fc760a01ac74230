//! Memory of each process, as its thread counts the bytes that it has from the allocator, and results for bonds that others hold.
#![allow(unsafe_code)]

use bondline::system::BodyState;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use bondline::coupling::Operator;
use bondline::coupling::semidiscrete::{BondBehaviour, BondThreshold, CoupledSystem};
use bondline::peridynamics::bond_force::{BondKinematics, Storage};
use bondline::progress::Silent;
use bondline::run::{AnyScene, setup};
use bondline::scene::Source;
use bondline::system::{BodyHistory, FailureUpdate, Interval, Ranks, SemiDiscrete, Tangent};

use crate::threads::{alone, folder, on_processes, predicted};

thread_local! {
    /// Bytes that the thread has and the most that it had. What another thread frees stays with it: the threads here share little.
    static HELD: Cell<[isize; 2]> = const { Cell::new([0; 2]) };
}

/// The system's allocator, which counts.
struct Counting;

fn count(size: isize) {
    HELD.with(|held| {
        let [now, most] = held.get();
        held.set([now + size, most.max(now + size)]);
    });
}

// SAFETY: every call is passed to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller keeps the contract of `alloc`
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller keeps the contract of `alloc_zeroed`
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: the caller keeps the contract of `dealloc`
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// The most bytes that this thread holds meanwhile, beyond what it has.
fn most_held(work: impl FnOnce()) -> f64 {
    let before = HELD.with(|held| {
        let [now, _] = held.get();
        held.set([now; 2]);
        now
    });
    work();
    HELD.with(|held| (held.get()[1] - before) as f64)
}

/// Points along the axes of the block.
pub const COUNTS: [i64; 3] = [24, 10, 10];

pub fn block(material: &str, spacings: i64, [x, y, z]: [i64; 3]) -> String {
    let ratio = if material == "lps" {
        "poisson-ratio = 0.3"
    } else {
        ""
    };
    format!(
        r#"
kinematics = "solid"
coupling = "nonlocal"

[mesh.box]
min = [0, 0, 0]
max = [{x}, {y}, {z}]
x = {{ cells = {x} }}
y = {{ cells = {y} }}
z = {{ cells = {z} }}

[materials.block.{material}]
youngs-modulus = 1
density = 1
critical-stretch = 0.1
{ratio}

[peridynamics]
horizon = {spacings}
points.lattice = {{ spacing = 1, origin = [0.5, 0.5, 0.5] }}

[solve.explicit]
duration = 1
outputs = 1
"#
    )
}

/// Lays the model out and makes its bond pass, as one of the processes does, for some work on the system.
fn lay_out<T>(
    text: &str,
    ranks: Option<&dyn Ranks>,
    work: impl FnOnce(&mut CoupledSystem<'_, 3>) -> T,
) -> T {
    let folder = folder();
    let source = Source::new("scene.toml", text.to_owned());
    let scene = AnyScene::from_source(&source, folder.path(), "scene").expect("a valid scene");
    let AnyScene::Solid(scene) = scene else {
        panic!("a scene in 3D");
    };
    let (problem, _) = setup::problem(scene.scene);
    let (model, coupling) = problem.lay_out(ranks, &Silent).expect("a model");
    let operator: Operator<'_, 3> = coupling.operator(&model).expect("rows");
    let system = CoupledSystem::of_processes(
        &model,
        &operator,
        coupling.symmetry(),
        |_| 1.0,
        &BondBehaviour {
            kinematics: BondKinematics::Exact,
            failure: Some(BondThreshold::Uniform(0.1)),
            softening: None,
            no_fail: &|_| false,
            contact: None,
            storage: Storage::Double,
            broken: None,
            heat: None,
        },
        ranks,
    );
    let mut system = system.expect("a pass").with_ranks(ranks);
    work(&mut system)
}

/// Returns the results for bonds that may lie with other processes: rows, broken bonds, energy and sums, as bits.
fn told(text: &str, pass: &str, ranks: Option<&dyn Ranks>) -> Vec<u64> {
    lay_out(text, ranks, |system| {
        assert_eq!(system.pass().expect("a body").name(), pass);
        let sites = system.mass().len() as u32;
        let u: Vec<f64> = (0..3 * sites)
            .map(|k| 0.15 * f64::from(k * k % 11).sin())
            .collect();
        let mut force = vec![0.0; u.len()];
        let update = FailureUpdate::Update;
        let broken = system
            .internal_force_into(&u, &mut force, Interval::AT_ONCE, update)
            .broken;
        let pairs = system.broken_bonds();
        assert!(broken > 100 && pairs.len() as u64 == broken, "{broken}");
        // rows of bonds at rest, of some sites in all parts
        let some: Vec<u32> = (0..sites).step_by(97).collect();
        let rows = system.tangent_rows(&some);
        let mut words: Vec<u64> = vec![system.stored_energy(&u).to_bits()];
        words.extend(
            pairs
                .iter()
                .flat_map(|&(i, j)| [u64::from(i), u64::from(j)]),
        );
        words.extend(rows.columns.iter().map(|&c| u64::from(c)));
        for r in 0..rows.rows() {
            words.extend(rows.row(r).1.iter().map(|x| x.to_bits()));
        }
        words.extend(force.iter().chain(&system.row_sums()).map(|x| x.to_bits()));
        words.extend(
            system
                .damage()
                .expect("bonds that break")
                .iter()
                .map(|x| x.to_bits()),
        );
        words.extend(system.damage_state());
        words
    })
}

#[test]
fn processes_tell_of_bonds_what_one_does() {
    // a plate two points thick fills too few of the eight lanes of a row: its pass has lists
    let bodies = [(COUNTS, "lattice"), ([2, 70, 72], "list")];
    for (material, (counts, pass)) in ["bond-based", "lps"]
        .into_iter()
        .flat_map(|m| bodies.map(|b| (m, b)))
    {
        let text = block(material, 2, counts);
        let one = &on_processes(1, |_| told(&text, pass, None))[0];
        for ranks in [1, 3] {
            let found = on_processes(ranks, |rank| told(&text, pass, Some(rank)));
            for (rank, found) in found.iter().enumerate() {
                let same = found.iter().zip(one).take_while(|(a, b)| a == b).count();
                assert!(
                    found == one,
                    "{material}, {pass}: process {rank} of {ranks} differs at word {same} of {}",
                    one.len()
                );
            }
        }
    }
}

/// Directed bonds of the points of some layers across the long axis, beyond those of a horizon of two spacings.
fn bonds(layers: std::ops::Range<i64>) -> f64 {
    (bonds_within(layers.clone(), 9) - bonds_within(layers, 4)) as f64
}

/// Directed bonds of the points of some layers across the long axis, whose length has at most this square.
fn bonds_within(layers: std::ops::Range<i64>, most: i64) -> i64 {
    let mut count = 0;
    for x in layers {
        for (i, j, k) in
            (-3..=3i64).flat_map(|i| (-3..=3).flat_map(move |j| (-3..=3).map(move |k| (i, j, k))))
        {
            let square = i * i + j * j + k * k;
            // points whose neighbour lies in the block
            let across = (COUNTS[1] - j.abs()) * (COUNTS[2] - k.abs());
            if square > 0 && square <= most && (0..COUNTS[0]).contains(&(x + i)) {
                count += across;
            }
        }
    }
    count
}

/// Returns the memory of the bonds beyond two spacings: bytes of each process.
fn bytes_of_bonds(material: &str, ranks: usize) -> Vec<f64> {
    let is_lattice = |system: &mut CoupledSystem<'_, 3>| {
        assert_eq!(system.pass().expect("a body").name(), "lattice");
    };
    let most = |spacings: i64| -> Vec<f64> {
        let text = block(material, spacings, COUNTS);
        match ranks {
            // in a thread of its own, too, which works alone
            0 => on_processes(1, |_| most_held(|| lay_out(&text, None, is_lattice))),
            _ => on_processes(ranks, |rank| {
                most_held(|| lay_out(&text, Some(rank), is_lattice))
            }),
        }
    };
    let (few, many) = (most(2), most(3));
    many.iter().zip(few).map(|(many, few)| many - few).collect()
}

/// A process holds the families of its points and, of a law whose force takes the states of neighbours, of the points in these. Of all other bonds it holds two bits each, which is
/// what the fifth is for.
#[test]
fn a_process_holds_the_families_of_its_own_points_and_ghosts() {
    let all = bonds(0..COUNTS[0]);
    for (material, ghosts) in [("bond-based", 0), ("lps", 3)] {
        let one = bytes_of_bonds(material, 0)[0];
        assert!(one > 10.0 * all, "{material}: {one} bytes of {all} bonds");
        let text = block(material, 3, COUNTS) + "[output]\nvtu = false\n";
        let alone = alone(&text);
        let whole = &predicted(&text, 1).with_memory(&alone)[0];
        for ranks in [2, 4] {
            let layers = COUNTS[0] / ranks;
            let shares = predicted(&text, ranks as usize).with_memory(&alone);
            for (rank, found) in bytes_of_bonds(material, ranks as usize).iter().enumerate() {
                let first = rank as i64 * layers;
                let held = (first - ghosts).max(0)..(first + layers + ghosts).min(COUNTS[0]);
                let wanted = one * bonds(held.clone()) / all;
                println!(
                    "{material} process {rank} of {ranks}: {:.1} bytes for each bond, {:.3} of its share",
                    found / all,
                    found / wanted
                );
                assert!(
                    *found < 1.2 * wanted,
                    "{material}: process {rank} of {ranks} holds {found} bytes, {wanted} are its share of {one}"
                );
                let (share, held) = (&shares[rank], bonds_within(held, 9));
                assert_eq!(
                    share.bonds as i64, held,
                    "{material}: process {rank} of {ranks}"
                );
                // what is predicted to be saved for each bond that others hold; real processes save 32 bytes of LPS, threads count less
                let saved = (whole.memory_bytes - share.memory_bytes) as f64;
                let per_bond = saved / (whole.bonds - share.bonds) as f64;
                let found = one / all;
                assert!(
                    (0.9 * found..1.6 * found).contains(&per_bond),
                    "{material}: {per_bond} bytes for each bond are predicted, {found} found"
                );
            }
        }
    }
}
