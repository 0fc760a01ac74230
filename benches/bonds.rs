//! Bond passes against the machine and against LAMMPS PERI: `cargo bench --bench bonds -- [roofline|passes|threads|lammps|memory|scaling …]` (all without a name).
//!
//! `scaling` also draws `docs/figures/bond_scaling.svg`.
//!
//! Times of one thread are CPU times, so that other programs on the machine do not count; times of two threads are wall-clock times, the least of many. Markdown comes out.

// the clock of the process, and loops of vector instructions against which passes are measured
#![allow(unsafe_code)]

use bondline::peridynamics::bond_force::{
    BlockSetup, BondCriterion, BondForce, BondKinematics, BondPass, BondSetup, Failure, Layout,
    Storage, block_pass, bond_pass, instructions,
};
use bondline::peridynamics::contact::{Contact, ContactSetup};
use bondline::peridynamics::{Families, TIE_TOLERANCE};
use bondline::system::{FailureUpdate, Interval};
use bondline::tensor::Vector;
use bondline_study::line_plot::{LinePlot, Scale, Series, Stroke};
use std::hint::black_box;
use std::time::Instant;

const H: f64 = 5e-4;

/// Nanoseconds on a processor, all threads of this process together.
fn cpu() -> f64 {
    #[repr(C)]
    struct Time {
        seconds: i64,
        nanoseconds: i64,
    }
    unsafe extern "C" {
        fn clock_gettime(clock: i32, time: *mut Time) -> i32;
    }
    let mut time = Time {
        seconds: 0,
        nanoseconds: 0,
    };
    // SAFETY: 2 is CLOCK_PROCESS_CPUTIME_ID, and the structure is that of 64-bit Linux, where this runs
    unsafe { clock_gettime(2, &mut time) };
    1e9 * time.seconds as f64 + time.nanoseconds as f64
}

/// Bytes of memory that this process holds.
fn resident() -> f64 {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = statm.split(' ').nth(1).and_then(|n| n.parse::<f64>().ok());
    4096.0 * pages.unwrap_or(f64::NAN)
}

fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    x[x.len() / 2]
}

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("threads")
}

fn coefficient<const D: usize>(_: usize, _: usize, xi: &Vector<D>) -> f64 {
    1e10 / xi.norm()
}

fn omega<const D: usize>(_: usize, _: usize, _: &Vector<D>) -> f64 {
    1.0
}

#[derive(Clone, Copy, PartialEq)]
enum Law {
    Pmb,
    Lps,
}

impl Law {
    fn name(self) -> &'static str {
        match self {
            Self::Pmb => "PMB",
            Self::Lps => "LPS",
        }
    }

    fn force<const D: usize>(self) -> BondForce<'static, D> {
        match self {
            Self::Pmb => BondForce::Pairwise {
                coefficient: &coefficient,
            },
            Self::Lps => BondForce::Solid {
                omega: &omega,
                bulk: 14.9e9,
                shear: 8.94e9,
            },
        }
    }

    /// Instructions per bond that only the two multiplying pipes can do, exact bonds in 3D, no bond missing: multiplications and fused ones.
    fn multiplications(self) -> f64 {
        match self {
            // t 4, ψ 5, f 2, sum 3
            Self::Pmb => 14.0,
            // dilatation: t 4, χ 5, sums 3; force: t 4, ψ 5, e, ratio and f 6, sum 3
            Self::Lps => 12.0 + 18.0,
        }
    }
}

/// A block of `counts` points with horizon `m h`.
fn lattice<const D: usize>(
    counts: [usize; D],
    m: f64,
    law: Law,
    critical: Option<f64>,
    kinematics: BondKinematics,
) -> Box<dyn BondPass<D>> {
    block_pass(&BlockSetup {
        counts,
        spacing: [H; D],
        horizon: m * H,
        force: law.force(),
        kinematics,
        critical,
    })
    .expect("a block")
}

/// The same block by lists, its points where `jitter` spacings put them.
fn list<const D: usize>(
    counts: [usize; D],
    m: f64,
    law: Law,
    critical: Option<f64>,
    storage: Storage,
) -> Box<dyn BondPass<D>> {
    let n = counts.iter().product::<usize>();
    let position: Vec<Vector<D>> = (0..n)
        .map(|p| {
            let mut rest = p;
            Vector::from_fn(|a, _| {
                let k = rest % counts[a];
                rest /= counts[a];
                H * k as f64
            })
        })
        .collect();
    let families = Families::search(&position, &vec![m * H; n], TIE_TOLERANCE).expect("families");
    bond_pass(&BondSetup {
        position: &position,
        volume: &vec![H.powi(D as i32); n],
        families: &families,
        rows: &[],
        without_energy: &[],
        force: law.force(),
        kinematics: BondKinematics::Exact,
        failure: critical.map(|s| Failure {
            critical: BondCriterion::Uniform(s),
            no_fail: &[],
            softening: None,
        }),
        precracked: None,
        layout: Layout::List,
        storage,
        shared: None,
    })
    .expect("a list")
}

/// Displacements of strains of some 1e-4.
fn motion(n: usize) -> Vec<f64> {
    let mut s = 1u64;
    (0..n)
        .map(|_| {
            s = s
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            1e-4 * H * ((s >> 11) as f64 / (1u64 << 53) as f64 - 0.5)
        })
        .collect()
}

/// Nanoseconds per directed bond of each of `passes` force passes on one thread.
fn time<const D: usize>(pass: &mut dyn BondPass<D>, passes: usize) -> Vec<f64> {
    let u = motion(pass.points() * D);
    let mut force = vec![0.0; u.len()];
    let bonds = pass.bonds() as f64;
    pool(1).install(|| {
        pass.force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update);
        (0..passes)
            .map(|_| {
                let start = cpu();
                let broken = pass
                    .force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update)
                    .broken;
                assert_eq!(broken, 0);
                (cpu() - start) / bonds
            })
            .collect()
    })
}

/// As [`time`], with contact between all points of a block of `n³`.
fn time_with_contact(pass: &mut dyn BondPass<3>, n: usize, passes: usize) -> Vec<f64> {
    let position: Vec<Vector<3>> = (0..n * n * n)
        .map(|p| Vector::<3>::new((p % n) as f64, (p / n % n) as f64, (p / n / n) as f64) * H)
        .collect();
    let mut contact = Contact::new(&ContactSetup {
        position: &position,
        volume: &vec![H * H * H; position.len()],
        rows: &[],
        spacing: H,
        approach: 0.9,
        stiffness: 1e20,
        skin: 0.25 * H,
        cracks: Vec::new(),
        horizon: 0.0,
    })
    .expect("contact");
    let u = motion(pass.points() * 3);
    let mut force = vec![0.0; u.len()];
    let bonds = pass.bonds() as f64;
    pool(1).install(|| {
        (0..=passes)
            .map(|_| {
                let start = cpu();
                pass.force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update);
                contact.add_force(&u, &|i, j| pass.bonded(i, j), &mut force);
                (cpu() - start) / bonds
            })
            .skip(1)
            .collect()
    })
}

/// Wall-clock nanoseconds per directed bond on 1 and 2 threads, the least of `rounds` in alternation.
fn walls<const D: usize>(pass: &mut dyn BondPass<D>, rounds: usize) -> [f64; 2] {
    let u = motion(pass.points() * D);
    let mut force = vec![0.0; u.len()];
    let pools = [pool(1), pool(2)];
    let mut least = [f64::INFINITY; 2];
    for _ in 0..rounds {
        for (pool, least) in pools.iter().zip(&mut least) {
            let start = Instant::now();
            pool.install(|| {
                pass.force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update)
            });
            *least = least.min(start.elapsed().as_secs_f64() * 1e9 / pass.bonds() as f64);
        }
    }
    least
}

/// Bytes per nanosecond of `a = b + s c` over arrays far larger than the caches, the best of ten.
fn triad(threads: usize) -> f64 {
    use rayon::prelude::*;
    let n = 1 << 24;
    let (mut a, b, c) = (vec![0.0f64; n], vec![1.0f64; n], vec![2.0f64; n]);
    let pool = pool(threads);
    let mut best = f64::INFINITY;
    for _ in 0..12 {
        let (start, busy) = (Instant::now(), cpu());
        pool.install(|| {
            a.par_chunks_mut(1 << 14)
                .zip(b.par_chunks(1 << 14))
                .zip(c.par_chunks(1 << 14))
                .for_each(|((a, b), c)| {
                    for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
                        *a = b + 3.0 * c;
                    }
                });
        });
        best = best.min(match threads {
            1 => cpu() - busy,
            _ => start.elapsed().as_nanos() as f64,
        });
    }
    assert_eq!(a[n / 2], 7.0);
    24.0 * n as f64 / best
}

/// Fused multiplications per nanosecond and thread (lanes, not instructions) out of registers.
fn multiplications() -> f64 {
    const ROUNDS: usize = 2_000_000;
    let mut best = f64::INFINITY;
    let mut lanes = 1.0;
    for _ in 0..10 {
        let start = cpu();
        let (n, sum) = fused(ROUNDS);
        best = best.min(cpu() - start);
        lanes = n;
        assert!(sum.is_finite());
    }
    lanes * ROUNDS as f64 / best
}

/// Twelve chains of fused multiplications; returns how many numbers one round multiplies, and a sum that keeps them alive.
fn fused(rounds: usize) -> (f64, f64) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::*;
        #[target_feature(enable = "avx512f")]
        fn wide(rounds: usize) -> f64 {
            let (a, b) = (
                _mm512_set1_pd(black_box(0.999_999)),
                _mm512_set1_pd(black_box(1e-6)),
            );
            let mut x: [_; 12] = std::array::from_fn(|k| _mm512_set1_pd(black_box(k as f64)));
            for _ in 0..rounds {
                for x in &mut x {
                    *x = _mm512_fmadd_pd(*x, a, b);
                }
            }
            x.iter().map(|x| _mm512_reduce_add_pd(*x)).sum()
        }
        #[target_feature(enable = "avx2,fma")]
        fn half(rounds: usize) -> f64 {
            let (a, b) = (
                _mm256_set1_pd(black_box(0.999_999)),
                _mm256_set1_pd(black_box(1e-6)),
            );
            let mut x: [_; 12] = std::array::from_fn(|k| _mm256_set1_pd(black_box(k as f64)));
            for _ in 0..rounds {
                for x in &mut x {
                    *x = _mm256_fmadd_pd(*x, a, b);
                }
            }
            x.iter().map(|x| _mm256_cvtsd_f64(*x)).sum()
        }
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: detected
            return (96.0, unsafe { wide(rounds) });
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: detected
            return (48.0, unsafe { half(rounds) });
        }
    }
    let mut x = [1.0f64; 12];
    for _ in 0..rounds {
        for x in &mut x {
            *x = x.mul_add(0.999_999, 1e-6);
        }
    }
    (12.0, x.iter().sum())
}

fn roofline() {
    let (one, two, peak) = (triad(1), triad(2), multiplications());
    println!(
        "\n### Roofline, {} (3D, m = 3, 80³ points, exact bonds, damage on)\n",
        instructions()
    );
    println!(
        "STREAM triad {one:.1} GB/s on one thread, {two:.1} on two; {peak:.1} fused multiplications per ns and thread.\n"
    );
    println!(
        "| law | bytes per bond | ns by bandwidth | multiplications per bond | ns by arithmetic | measured | of the tighter |"
    );
    println!("|---|---|---|---|---|---|---|");
    for law in [Law::Pmb, Law::Lps] {
        let mut pass = lattice([80; 3], 3.0, law, Some(0.01), BondKinematics::Exact);
        let bonds = pass.bonds() as f64 / pass.points() as f64;
        // per point: u read, force written, both also in the box (once more read), numbers of points twice; LPS: dilatation, two coefficients and what neighbours see
        let point = 4.0 * 24.0
            + 24.0
            + 8.0
            + if law == Law::Lps {
                5.0 * 8.0 + 24.0
            } else {
                0.0
            };
        let bytes = point / bonds + if law == Law::Lps { 0.25 } else { 0.125 };
        let (by_bytes, by_work) = (bytes / one, law.multiplications() / peak);
        let measured = median(time(&mut *pass, 9));
        println!(
            "| {} | {bytes:.2} | {by_bytes:.3} | {} | {by_work:.3} | {measured:.3} | {:.0} % |",
            law.name(),
            law.multiplications(),
            100.0 * by_bytes.max(by_work) / measured
        );
    }
}

fn row<const D: usize>(counts: [usize; D], m: f64) {
    for law in [Law::Pmb, Law::Lps] {
        let mut cells = Vec::new();
        let exact = BondKinematics::Exact;
        for (critical, kinematics) in [
            (Some(0.01), exact),
            (None, exact),
            (None, BondKinematics::Linear),
        ] {
            let mut pass = lattice(counts, m, law, critical, kinematics);
            cells.push(median(time(&mut *pass, 7)));
        }
        for storage in [Storage::Double, Storage::Single] {
            let mut pass = list(counts, m, law, Some(0.01), storage);
            cells.push(median(time(&mut *pass, 5)));
        }
        let cells: Vec<String> = cells.iter().map(|c| format!("{c:.2}")).collect();
        println!("| {D}D, m = {m}, {} | {} |", law.name(), cells.join(" | "));
    }
}

fn passes() {
    println!("\n### Nanoseconds of CPU per directed bond, one thread\n");
    println!(
        "| | lattice, damage on | damage off | linear | list, f64 weights, damage on | f32 weights |"
    );
    println!("|---|---|---|---|---|---|");
    for m in [3.0, 4.0, 6.0] {
        row([500, 500], m);
    }
    for m in [3.0, 4.0, 6.0] {
        let n = if m > 5.0 { 30 } else { 46 };
        row([n; 3], m);
    }
}

fn threads() {
    println!(
        "\n### Two threads: wall-clock nanoseconds per directed bond, the least of 40 in alternation (3D, m = 3, damage on)\n"
    );
    println!("| | 1 | 2 | ratio |");
    println!("|---|---|---|---|");
    for law in [Law::Pmb, Law::Lps] {
        let mut cases: Vec<(&str, Box<dyn BondPass<3>>)> = vec![
            (
                "lattice 80³",
                lattice([80; 3], 3.0, law, Some(0.01), BondKinematics::Exact),
            ),
            (
                "list 46³",
                list([46; 3], 3.0, law, Some(0.01), Storage::Double),
            ),
        ];
        for (name, pass) in &mut cases {
            let [one, two] = walls(&mut **pass, 40);
            println!(
                "| {} {name} | {one:.2} | {two:.2} | {:.2} |",
                law.name(),
                one / two
            );
        }
    }
}

/// CPU seconds of LAMMPS in its pair style, and the number of directed bonds that it reports.
fn lammps(law: Law, n: usize, steps: usize) -> Option<f64> {
    let (style, coefficients) = match law {
        Law::Pmb => ("pmb", "1.6863e22 0.0015001 0.01 0.25"),
        Law::Lps => ("lps", "14.9e9 8.94e9 0.0015001 0.01 0.25"),
    };
    let input = format!(
        "units si\nboundary s s s\natom_style peri\natom_modify map array\nneighbor 0.0005 bin\nlattice sc {H}\n\
         region box block 0 {end} 0 {end} 0 {end} units lattice\ncreate_box 1 box\ncreate_atoms 1 box\n\
         pair_style peri/{style}\npair_coeff * * {coefficients}\nset group all density 2200\nset group all volume 1.25e-10\n\
         velocity all ramp vx 0 0.1 x 0 0.02 units box\nfix 1 all nve\ntimestep 1.0e-8\nthermo {steps}\nrun {steps}\n",
        end = n as f64 - 0.5,
    );
    let folder = std::env::temp_dir().join(format!("bondline-lammps-{}", std::process::id()));
    std::fs::create_dir_all(&folder).ok()?;
    let file = folder.join("in.peri");
    std::fs::write(&file, input).ok()?;
    let output = std::process::Command::new("lmp")
        .args(["-log", "none", "-in"])
        .arg(&file)
        .env("OMP_NUM_THREADS", "1")
        .current_dir(&folder)
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    std::fs::remove_dir_all(&folder).ok()?;
    let number = |line: &str, k: usize, by: char| {
        let part = line.split(by).nth(k)?.trim().trim_end_matches('%');
        part.parse::<f64>().ok()
    };
    let pair = number(text.lines().find(|l| l.starts_with("Pair "))?, 2, '|')?;
    let usage = number(text.lines().find(|l| l.contains("% CPU use"))?, 0, ' ')?;
    let atoms = text.lines().find(|l| l.starts_with("Loop time"))?;
    assert!(atoms.contains(&format!("{} atoms", n * n * n)), "{atoms}");
    Some(pair * usage / 100.0)
}

fn against_lammps() {
    let (n, steps, rounds) = (40, 10, 5);
    println!(
        "\n### LAMMPS PERI (`lmp`, one process): simple cubic block of {n}³, m = 3, {steps} force passes, one thread each, in alternation, medians of {rounds}\n"
    );
    println!(
        "Nanoseconds of CPU per directed bond; theirs is the time in the pair style, which includes its short-range contact.\n"
    );
    println!(
        "| law | LAMMPS | lattice, damage and contact on | ratio | damage on | ratio | no damage | ratio | list, f64 | ratio | list, f32 | ratio |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    for law in [Law::Pmb, Law::Lps] {
        let mut passes = [
            lattice([n; 3], 3.0, law, Some(0.01), BondKinematics::Exact),
            lattice([n; 3], 3.0, law, None, BondKinematics::Exact),
            list([n; 3], 3.0, law, Some(0.01), Storage::Double),
            list([n; 3], 3.0, law, Some(0.01), Storage::Single),
        ];
        let bonds = passes[0].bonds() as f64;
        assert_eq!(passes[0].bonds(), passes[2].bonds());
        let mut times = vec![Vec::new(); 6];
        for _ in 0..rounds {
            let Some(seconds) = lammps(law, n, steps) else {
                println!(
                    "| {} | no `lmp` on the path, or its output is not understood |",
                    law.name()
                );
                return;
            };
            times[0].push(seconds * 1e9 / (bonds * steps as f64));
            let mean = |all: Vec<f64>| all.iter().sum::<f64>() / all.len() as f64;
            times[1].push(mean(time_with_contact(&mut *passes[0], n, steps)));
            for (times, pass) in times[2..].iter_mut().zip(&mut passes) {
                times.push(mean(time(&mut **pass, steps)));
            }
        }
        let times: Vec<f64> = times.into_iter().map(median).collect();
        print!("| {} | {:.2} ", law.name(), times[0]);
        for t in &times[1..] {
            print!("| {t:.2} | {:.1} ", times[0] / t);
        }
        println!("|");
    }
}

fn memory() {
    println!(
        "\n### Memory: resident size of the process, pass with u and force less before, per directed bond (3D, m = 3, damage on)\n"
    );
    println!("| | bonds | bytes per bond |");
    println!("|---|---|---|");
    let measure = |name: &str, make: &dyn Fn() -> Box<dyn BondPass<3>>| {
        let before = resident();
        let mut pass = make();
        let u = motion(pass.points() * 3);
        let mut force = vec![0.0; u.len()];
        pass.force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update);
        let bytes = (resident() - before) / pass.bonds() as f64;
        println!("| {name} | {:.1e} | {bytes:.2} |", pass.bonds() as f64);
    };
    for law in [Law::Pmb, Law::Lps] {
        measure(&format!("{} lattice", law.name()), &|| {
            lattice([80; 3], 3.0, law, Some(0.01), BondKinematics::Exact)
        });
    }
    for law in [Law::Pmb, Law::Lps] {
        for (name, storage) in [("f64", Storage::Double), ("f32", Storage::Single)] {
            measure(&format!("{} list, {name} weights", law.name()), &|| {
                list([60; 3], 3.0, law, Some(0.01), storage)
            });
        }
    }
}

fn scaling() {
    println!(
        "\n### Time per bond against the number of bonds (lattice, 3D, m = 3, damage on, one thread)\n"
    );
    println!("| bonds | PMB | LPS |");
    println!("|---|---|---|");
    let laws = [Law::Pmb, Law::Lps];
    let mut curves = laws.map(|_| Vec::new());
    for n in [10, 12, 23, 46, 94, 97] {
        let mut cells = Vec::new();
        let mut bonds = 0.0;
        for (law, curve) in laws.into_iter().zip(&mut curves) {
            let mut pass = lattice([n; 3], 3.0, law, Some(0.01), BondKinematics::Exact);
            bonds = pass.bonds() as f64;
            let nanoseconds = median(time(&mut *pass, if n < 50 { 25 } else { 7 }));
            // a pass over all bonds, which is what a step waits for
            curve.push((bonds, nanoseconds * bonds * 1e-9));
            cells.push(nanoseconds);
        }
        println!("| {bonds:.2e} | {:.3} | {:.3} |", cells[0], cells[1]);
    }
    let largest = curves.each_ref().map(|c| c[c.len() - 1]);
    let mut series: Vec<Series> = laws
        .iter()
        .zip(&curves)
        .map(|(law, curve)| Series::new(law.name(), Stroke::Line, curve.clone()))
        .collect();
    for (law, (bonds, seconds)) in laws.iter().zip(largest) {
        let straight = [1e5, bonds].map(|b| (b, seconds * b / bonds));
        let name = format!("{}, linear", law.name());
        series.push(Series::new(name, Stroke::Dashed, straight.to_vec()));
    }
    let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .join("docs/figures/bond_scaling.svg");
    let plot = LinePlot {
        title: "One force pass, 3D, m = 3, damage on, one thread".into(),
        x_label: "directed bonds".into(),
        y_label: "seconds of CPU".into(),
        x_scale: Scale::Log,
        y_scale: Scale::Log,
        series,
    };
    plot.write(&path).expect("a figure");
}

fn main() {
    let names: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with('-'))
        .collect();
    let sections: [(&str, fn()); 6] = [
        ("roofline", roofline),
        ("passes", passes),
        ("threads", threads),
        ("lammps", against_lammps),
        ("memory", memory),
        ("scaling", scaling),
    ];
    for (name, section) in sections {
        if names.is_empty() || names.iter().any(|n| n == name) {
            section();
        }
    }
}
