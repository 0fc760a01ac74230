//! Partial volumes: sums over full families, other partitions of the ball, and the cost of the closed forms against sampling.
//!
//! Source: [SAND2015-7998] section 5.2.1 and the algorithm of figure 5.7.

mod hexahedron;
mod sampling;

use std::{f64::consts::PI, hint::black_box, time::Instant};

use self::hexahedron::Hexahedron;
use self::sampling::{SAND_LEVELS, SAND_SAMPLES_PER_EDGE, subdivide_and_sample};
use crate::{Effort, convergence::norms::median};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    peridynamics::{
        BoxCell, Micromodulus, PartialVolume, ShellTarget, TIE_TOLERANCE, isotropic_shell_factors,
        partial_volume::{lattice_cells, lattice_shells},
    },
    progress::Progress,
    tensor::{Tensor4, Vector},
};

/// Exact lengths and areas: sum of a full family's weights against the ball, relative.
pub const EXACT_PLANE: f64 = 1e-14;
/// Exact volumes.
pub const EXACT_SOLID: f64 = 1e-10;
/// Factor by which subdivision and sampling take longer, at least, at an error no smaller.
pub const SPEED: f64 = 20.0;
/// The suite `partial-volumes`.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    progress.stage("partial volumes", None);
    let mut sums = Table::new(
        "Weights of a full family, own cell included, against 2 delta, pi delta^2, 4/3 pi delta^3: relative difference over delta/h from 3 to 6",
        Columns::ByQuantity,
    );
    let step = if effort == Effort::Quick { 15 } else { 1 };
    add_sums::<1>(&mut sums, step);
    add_sums::<2>(&mut sums, step);
    add_sums::<3>(&mut sums, step);
    let mut tensors = Table::new(
        "What partial volumes do to a bond-based lattice, lambda = c/|xi|^3: its elastic constants over the typed ones, and the factors that make it isotropic",
        Columns::ByQuantity,
    );
    for ratio in [2.0, 3.0, 3.3, 6.0] {
        add_tensors::<2>(&mut tensors, ratio);
        add_tensors::<3>(&mut tensors, ratio);
    }
    let tables = vec![sums, tensors, partitions(), costs(effort)];
    progress.finish();
    tables
}

/// Plain and isotropic weights of a full lattice family.
fn add_tensors<const D: usize>(table: &mut Table, ratio: f64) {
    let kernel = Micromodulus::InverseDistance;
    let typed = 3.0;
    let constant = kernel.constant::<D>(ratio, typed);
    for algorithm in PartialVolume::ALL {
        let case = format!("{D}D delta/h = {ratio}, {algorithm:?}");
        let (lattice, shares) = match lattice_shells::<D>(algorithm, ratio, TIE_TOLERANCE) {
            Ok(found) => found,
            Err(why) => {
                table.push(TableRow::refused(case, "C1111 over typed", why.to_string()));
                continue;
            }
        };
        let base: Vec<f64> = lattice
            .shells
            .iter()
            .zip(&shares)
            .map(|(s, share)| constant * share * kernel.shape(s.length(1.0), ratio))
            .collect();
        let plain = lattice.fourth_moments(1.0, &base).scaled(0.5);
        let (normal, across) = (plain.get(0, 0, 0, 0), plain.get(0, 0, 1, 1));
        table.push(TableRow::info(&case, "C1111 over typed", normal / typed));
        table.push(TableRow::info(
            &case,
            "C1122 over typed",
            3.0 * across / typed,
        ));
        let target = ShellTarget::Strength(2.0 * typed);
        match isotropic_shell_factors(&lattice, 1.0, &base, target) {
            Ok(factors) => {
                let weighted: Vec<f64> = base.iter().zip(&factors).map(|(b, f)| b * f).collect();
                let mut miss = lattice.fourth_moments(1.0, &weighted).scaled(0.5);
                miss.add_scaled(-1.0, &Tensor4::isotropic(typed / 3.0, typed / 3.0));
                let (least, most) = factors
                    .iter()
                    .fold((f64::INFINITY, 0.0f64), |(a, b), &f| (a.min(f), b.max(f)));
                table.push(TableRow::info(&case, "smallest factor", least));
                table.push(TableRow::info(&case, "largest factor", most));
                table.push(TableRow::at_most(
                    &case,
                    "then off by",
                    miss.amax() / typed,
                    1e-12,
                ));
            }
            Err(why) => table.push(TableRow::refused(&case, "then off by", why.to_string())),
        }
    }
}

fn ball<const D: usize>(radius: f64) -> f64 {
    match D {
        1 => 2.0 * radius,
        2 => PI * radius * radius,
        _ => 4.0 / 3.0 * PI * radius.powi(3),
    }
}

fn add_sums<const D: usize>(table: &mut Table, step: usize) {
    let names = [
        ["FL", "PL-PDLAMMPS", "PL-HHB", "exact lengths"],
        ["FA", "PA-PDLAMMPS", "PA-HHB", "exact areas"],
        ["FV", "PV-PDLAMMPS", "PV-HHB", "exact volumes"],
    ];
    for (algorithm, name) in PartialVolume::ALL.into_iter().zip(names[D - 1]) {
        let case = format!("{D}D {name}");
        let defects: Result<Vec<f64>, _> = (75..=150)
            .step_by(step)
            .map(|n| {
                let ratio = 0.04 * f64::from(n);
                lattice_cells::<D>(algorithm, ratio, TIE_TOLERANCE).map(|cells| {
                    let sum = 1.0 + cells.iter().map(|c| c.share).sum::<f64>();
                    (sum / ball::<D>(ratio) - 1.0).abs()
                })
            })
            .collect();
        match defects {
            Err(why) => table.push(TableRow::refused(case, "largest", why.to_string())),
            Ok(defects) => {
                let largest = defects.iter().copied().fold(0.0, f64::max);
                let exact = algorithm == PartialVolume::Exact
                    || (algorithm == PartialVolume::Hhb && D == 1);
                let limit = if D == 3 { EXACT_SOLID } else { EXACT_PLANE };
                table.push(if exact {
                    TableRow::at_most(&case, "largest", largest, limit)
                } else {
                    TableRow::info(&case, "largest", largest)
                });
                table.push(TableRow::info(&case, "median", median(defects)));
            }
        }
    }
}

/// Reproducible numbers in [0, 1).
fn random(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1u64 << 53) as f64
}

/// Non-uniform cells: boxes of all sizes that fill the ball, and boxes turned about its centre.
fn partitions() -> Table {
    let mut table = Table::new(
        "Cells of other shapes: boxes between uneven planes that fill the ball, hexahedra that are boxes turned about its centre",
        Columns::Full,
    );
    let mut state = 2015;
    let mut planes = || {
        let mut at: Vec<f64> = (0..11).map(|_| 2.0 * random(&mut state) - 1.0).collect();
        at.extend([-1.1, 1.1]);
        at.sort_by(f64::total_cmp);
        at
    };
    let (x, y, z) = (planes(), planes(), planes());
    let (mut area, mut volume) = (0.0, 0.0);
    for i in x.windows(2) {
        for j in y.windows(2) {
            if let Ok(cell) =
                BoxCell::new(Vector::<2>::new(i[0], j[0]), Vector::<2>::new(i[1], j[1]))
            {
                area += cell.ball_measure(&Vector::zeros(), 1.0);
            }
            for k in z.windows(2) {
                let low = Vector::<3>::new(i[0], j[0], k[0]);
                let high = Vector::<3>::new(i[1], j[1], k[1]);
                if let Ok(cell) = BoxCell::new(low, high) {
                    volume += cell.ball_measure(&Vector::zeros(), 1.0);
                }
            }
        }
    }
    let relative = |sum: f64, whole: f64| (sum / whole - 1.0).abs();
    table.push(TableRow::at_most(
        "144 rectangles",
        "sum against the disc, relative",
        relative(area, ball::<2>(1.0)),
        EXACT_PLANE,
    ));
    table.push(TableRow::at_most(
        "1728 boxes",
        "sum against the ball, relative",
        relative(volume, ball::<3>(1.0)),
        EXACT_SOLID,
    ));
    let (mut worst, mut count) = (0.0f64, 0);
    for _ in 0..200 {
        let low = Vector::<3>::from_fn(|_, _| random(&mut state));
        let edges = Vector::<3>::from_fn(|_, _| 0.2 + 0.2 * random(&mut state));
        let Ok(cell) = BoxCell::new(low, low + edges) else {
            continue;
        };
        let Some(hexahedron) = turned(&cell) else {
            continue;
        };
        let exact = cell.ball_measure(&Vector::zeros(), 1.0);
        let measured = hexahedron.ball_volume(&Vector::zeros(), 1.0);
        worst = worst.max((measured - exact).abs() / cell.measure());
        count += 1;
    }
    table.push(TableRow::at_most(
        format!("{count} hexahedra"),
        "largest difference from the box's closed form, over the cell's volume",
        worst,
        EXACT_SOLID,
    ));
    table
}

/// A box turned about the origin, by the angle of a 3-4-5 triangle about z and then about x.
fn turned(cell: &BoxCell<3>) -> Option<Hexahedron> {
    let (low, high) = cell.corners();
    let (c, s) = (0.8, 0.6);
    Hexahedron::new(
        [
            [0, 0, 0],
            [1, 0, 0],
            [1, 1, 0],
            [0, 1, 0],
            [0, 0, 1],
            [1, 0, 1],
            [1, 1, 1],
            [0, 1, 1],
        ]
        .map(|k| {
            let x = Vector::<3>::from_fn(|a, _| if k[a] == 1 { high[a] } else { low[a] });
            let y = Vector::<3>::new(c * x.x - s * x.y, s * x.x + c * x.y, x.z);
            Vector::<3>::new(y.x, c * y.y - s * y.z, s * y.y + c * y.z)
        }),
    )
}

/// Time of a family's cut cells by the closed form and by subdivision and sampling, alternating within one run.
fn costs(effort: Effort) -> Table {
    let ratio = 3.3;
    let mut table = Table::new(
        format!(
            "Ball against the cut cubes of a family, delta/h = {ratio}: subdivision and sampling against the closed form"
        ),
        Columns::ByQuantity,
    );
    let cells: Vec<BoxCell<3>> = lattice_cells::<3>(PartialVolume::Exact, ratio, TIE_TOLERANCE)
        .unwrap_or_default()
        .into_iter()
        .filter(|c| c.share < 1.0)
        .filter_map(|c| BoxCell::cube(Vector::<3>::from_fn(|a, _| f64::from(c.offset[a])), 1.0))
        .collect();
    let origin = Vector::<3>::zeros();
    let closed = |cell: &BoxCell<3>| cell.ball_measure(&origin, ratio);
    let exact: Vec<f64> = cells.iter().map(closed).collect();
    let levels: &[u32] = if effort == Effort::Quick {
        &[4]
    } else {
        &[0, 1, 2, 3, 4, 5, SAND_LEVELS]
    };
    for &level in levels {
        let (mut sampling_time, mut closed_time) = (0.0, 0.0);
        let (mut largest, mut sum) = (0.0f64, 0.0);
        for (cell, exact) in cells.iter().zip(&exact) {
            let start = Instant::now();
            let sampled = subdivide_and_sample(
                black_box(cell),
                &origin,
                ratio,
                level,
                SAND_SAMPLES_PER_EDGE,
            );
            sampling_time += start.elapsed().as_secs_f64();
            // many times, or the clock is all that is measured
            let start = Instant::now();
            for _ in 0..100 {
                black_box(closed(black_box(cell)));
            }
            closed_time += start.elapsed().as_secs_f64() / 100.0;
            largest = largest.max((sampled - exact).abs());
            sum += sampled - exact;
        }
        let case = format!("{level} levels, {SAND_SAMPLES_PER_EDGE}^3 samples");
        table.push(TableRow::info(&case, "largest error of a cell", largest));
        table.push(TableRow::info(
            &case,
            "error of the family",
            sum.abs() / ball::<3>(ratio),
        ));
        table.push(TableRow::info(
            &case,
            "microseconds a cell",
            1e6 * sampling_time / cells.len() as f64,
        ));
        table.push(TableRow::info(
            &case,
            "closed form",
            1e6 * closed_time / cells.len() as f64,
        ));
        let times = sampling_time / closed_time;
        // with fewer levels the error of a cell is 0.1 % of its volume and more
        table.push(if level >= 3 {
            TableRow::at_least(&case, "times as long", times, SPEED)
        } else {
            TableRow::info(&case, "times as long", times)
        });
    }
    table
}
