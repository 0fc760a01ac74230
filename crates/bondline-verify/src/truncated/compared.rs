//! Truncated bonds beside the other methods where a crack is: at rest, as it runs, and waves in the plane that meet a seam.
//!
//! Every figure is a difference from one model alone on the same block, with the same supports: peridynamics for cracks, finite elements for waves. Truncated bonds want the lattice halfway inside of faces, the others points on
//! the nodes; the reference always has the method's own lattice.

use std::collections::HashMap;

use rayon::prelude::*;

use super::Material;
use crate::Effort;
use crate::enclosed::{Case, Cells, Enclosed, Law, Method, SPACING, Widths, YOUNGS_MODULUS};
use crate::typed;
use bondline::coupling::semidiscrete::{BondBehaviour, BondThreshold};
use bondline::coupling::semidiscrete::{CoupledSystem, masses, scale_rows};
use bondline::observe::report::{Columns, Table, TableRow};
use bondline::peridynamics::Micromodulus;
use bondline::peridynamics::bond_force::BondKinematics;
use bondline::progress::{Progress, Silent};
use bondline::solve::statics::{self, StaticParams, StaticProblem};
use bondline::system::{
    BodyHistory, BodyState, FailureUpdate, Halfway, Interval, SemiDiscrete, Symmetry,
};
use bondline::tensor::{Vector, padded};
use bondline::{coupling::BlendingFunction, model::FitDegree};

const METHODS: [Method; 7] = [
    Method::Truncated,
    Method::Splice,
    Method::Blending(BlendingFunction::Smooth),
    Method::Balanced,
    Method::BalancedOver(BlendingFunction::Smooth),
    Method::Meshfree,
    Method::Elements(FitDegree::Affine),
];

const RATIO: u32 = 3;
const DENSITY: f64 = 2.5;
const CRITICAL: f64 = 0.002;

/// The crack in peridynamics alone is stopped when half of the bonds across are lost so far from its middle, in spacings; it begins with 4.
const TIP: f64 = 8.0;

/// Most steps until then.
const STEPS: usize = 400;

/// Damage of a point beside a line that all of its bonds across it are broken: 11 of the 28 bonds of m = 3.
const CUT: f64 = 11.0 / 28.0;

fn case(method: Method, widths: Widths) -> Case {
    Case {
        method,
        law: Law::BondBased(Micromodulus::InverseDistance),
        cells: Cells::Matching,
        widths,
        ratio: RATIO,
    }
}

/// A zone of 12 h to either side; what surrounds it, if the method wants it, is 6 h wide.
fn widths(method: Method) -> Widths {
    let transition = if method.has_transition() { 6 } else { 0 };
    Widths {
        nonlocal: 12,
        transition,
        local: 12 - transition,
    }
}

/// A line between two rows of points, `rows` spacings above the middle one.
fn line(method: Method, rows: i32) -> f64 {
    let half = if method == Method::Truncated {
        0.0
    } else {
        0.5
    };
    (f64::from(rows) + half) * SPACING
}

/// A crack along x, as long to either side of the middle.
fn crack(x: f64, y: f64) -> String {
    let (from, to) = (typed::place([-x, y]), typed::place([x, y]));
    format!("[cracks.c]\nsegment = {{ from = {from}, to = {to} }}\n")
}

/// A position as a number of half spacings.
fn key(x: &Vector<2>) -> [i64; 2] {
    std::array::from_fn(|a| (2.0 * x[a] / SPACING).round() as i64)
}

const ALONE: &str = "\"nonlocal\"";

/// Returns true if a site is within so many horizons of the outer boundary.
fn is_band(e: &Enclosed<2>, x: &Vector<2>, horizons: u32) -> bool {
    x.amax() > e.half - (f64::from(horizons * RATIO) - 0.25) * SPACING
}

/// Displacement of the points less that of the body without a crack, under tension across a crack of 8 h in the middle of the zone.
fn opened(e: &Enclosed<2>, symmetry: Symmetry) -> Result<HashMap<[i64; 2], Vector<2>>, String> {
    let strain = 1e-3;
    let affine = |x: &Vector<2>| Vector::<2>::new(0.0, strain * x[1]);
    let places: Vec<Vector<2>> = e.positions().copied().collect();
    let prescribed: Vec<Option<f64>> = places
        .iter()
        .flat_map(|x| {
            let u = affine(x);
            // where bonds are missing, and where dilatations know of it
            let held = is_band(e, x, 2);
            [0, 1].map(|a| held.then_some(u[a]))
        })
        .collect();
    let positions: Vec<[f64; 3]> = places.iter().map(padded).collect();
    let problem = StaticProblem {
        stiffness: &e.stiffness,
        symmetry,
        positions: &positions,
        load: &vec![0.0; prescribed.len()],
        prescribed: &prescribed,
    };
    let solved = statics::solve(&problem, &StaticParams::default(), &Silent)
        .map_err(|e| e.to_string())?
        .displacement;
    Ok(places
        .iter()
        .enumerate()
        .filter(|(_, x)| x.amax() < 12.25 * SPACING)
        .map(|(s, x)| {
            let u = Vector::<2>::from_column_slice(&solved[2 * s..2 * s + 2]);
            (key(x), u - affine(x))
        })
        .collect())
}

fn at_rest(method: Method, material: Material) -> Result<[f64; 2], String> {
    let case = case(method, widths(method));
    let y = line(method, 0);
    let with = |coupling| {
        let built = material.block(&case, coupling, &crack(4.0 * SPACING, y));
        built.map_err(|e| e.to_string())
    };
    let whole = opened(&with(Some(ALONE))?, Symmetry::Unsymmetric)?;
    let coupled = opened(&with(None)?, Symmetry::Unsymmetric)?;
    let (mut error, mut size) = (0.0, 0.0);
    for (at, u) in &coupled {
        // nodes at the seam that carry no point
        let Some(v) = whole.get(at) else { continue };
        error += (u - v).norm_squared();
        size += v.norm_squared();
    }
    // how far the two rows beside the crack move apart in its middle
    let opening = |of: &HashMap<[i64; 2], Vector<2>>| {
        let rows = [y - 0.5 * SPACING, y + 0.5 * SPACING];
        let [low, high] = rows.map(|y| {
            let row = of
                .iter()
                .filter(|(k, _)| k[1] == (2.0 * y / SPACING).round() as i64);
            row.map(|(_, u)| u[1])
                .fold((0.0f64, 0.0f64), |(a, b), u| (a.min(u), b.max(u)))
        });
        high.1 - low.0
    };
    Ok([
        (error / size).sqrt(),
        opening(&coupled) / opening(&whole) - 1.0,
    ])
}

/// Results of the run of a crack.
struct Run {
    /// Energy that it took, over that which was stored.
    taken: f64,
    /// Growth of its length, in spacings, seen from the points above it and below it.
    longer: [f64; 2],
    /// Largest distance from the middle, in spacings, of a point beside it that has lost half, or 85 %, of its bonds across.
    tip: [f64; 2],
    steps: usize,
    /// Energy that is not accounted for, over that which was stored.
    missing: f64,
}

/// Bonds that may break.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Breaks {
    All,
    /// Those between points of the zone, in peridynamics alone too.
    WithinZone,
}

/// Damage along the row of points on one side of the line at `y`.
fn damage_beside(x: &[Vector<2>], y: f64, damage: &[f64], side: f64) -> Vec<(f64, f64)> {
    let beside = x.iter().zip(damage);
    let beside = beside.filter(|(x, _)| (x[1] - y - side * SPACING).abs() < 0.1 * SPACING);
    beside.map(|(x, d)| (x[0], *d)).collect()
}

/// Returns the largest distance from the middle, in spacings, of points that have lost a `part` of the bonds that a crack cuts.
fn tip_of(x: &[Vector<2>], y: f64, damage: &[f64], part: f64) -> f64 {
    let both = [0.5, -0.5].map(|side| damage_beside(x, y, damage, side));
    let lost = both.iter().flatten().filter(|(_, d)| *d >= part * CUT);
    lost.map(|(x, _)| x.abs() / SPACING).fold(0.0, f64::max)
}

fn run_crack(
    case: &Case,
    coupling: Option<&str>,
    y: f64,
    breaks: Breaks,
    steps: Option<usize>,
) -> Result<Run, String> {
    let material = Material::Pairwise(Micromodulus::InverseDistance);
    let built = material.block::<2>(case, coupling, &crack(4.0 * SPACING, y));
    let e = built.map_err(|e| e.to_string())?;
    let operator = e.coupling.operator(&e.model).map_err(|e| e.to_string())?;
    let outside = 12.25 * SPACING;
    let never =
        |x: &Vector<2>| is_band(&e, x, 1) || (breaks == Breaks::WithinZone && x.amax() > outside);
    let behaviour = BondBehaviour {
        kinematics: BondKinematics::Exact,
        failure: Some(BondThreshold::Uniform(CRITICAL)),
        softening: None,
        no_fail: &never,
        contact: None,
        storage: bondline::peridynamics::bond_force::Storage::Double,
        broken: None,
        heat: None,
    };
    let mut motion = CoupledSystem::new(
        &e.model,
        &operator,
        e.coupling.symmetry(),
        |_| DENSITY,
        &behaviour,
    )
    .map_err(|e| e.to_string())?;
    let x: Vec<Vector<2>> = e.positions().copied().collect();
    let mut u: Vec<f64> = x
        .iter()
        .flat_map(|x| [0.0, 0.62 * CRITICAL * x[1]])
        .collect();
    let (mut v, mut force) = (vec![0.0; u.len()], vec![0.0; u.len()]);
    let mass = motion.mass().to_vec();
    let stored = motion.stored_energy(&u);
    let step = 0.25 * SPACING / (YOUNGS_MODULUS / DENSITY).sqrt();
    let kick = |v: &mut [f64], force: &[f64]| {
        for (dof, (v, f)) in v.iter_mut().zip(force).enumerate() {
            if x[dof / 2][1].abs() < e.half - (f64::from(RATIO) - 0.25) * SPACING {
                *v -= 0.5 * step * f / mass[dof / 2];
            }
        }
    };
    motion.internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Frozen);
    let tip = |damage: &[f64], part: f64| tip_of(&x, y, damage, part);
    let mut done = 0;
    while done < steps.unwrap_or(STEPS) {
        done += 1;
        kick(&mut v, &force);
        u.iter_mut().zip(&v).for_each(|(u, v)| *u += step * v);
        motion.internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update);
        let back = 0.5 * step;
        motion.account_for_breaks(&Halfway { u: &u, v: &v, back });
        kick(&mut v, &force);
        let arrived =
            |motion: &CoupledSystem<'_, 2>| tip(&motion.damage().unwrap_or_default(), 0.5) >= TIP;
        if steps.is_none() && done % 5 == 0 && arrived(&motion) {
            break;
        }
    }
    let kinetic: f64 = (0..v.len()).map(|d| 0.5 * mass[d / 2] * v[d] * v[d]).sum();
    let taken = motion.dissipation().map_or(0.0, |d| d.total());
    let damage = motion.damage().unwrap_or_default();
    let longer = [0.5, -0.5].map(|side| {
        let row = damage_beside(&x, y, &damage, side);
        row.iter().map(|(_, d)| (d / CUT).min(1.0)).sum()
    });
    Ok(Run {
        taken: taken / stored,
        longer,
        tip: [0.5, 0.85].map(|part| tip(&damage, part)),
        steps: done,
        missing: (kinetic + motion.stored_energy(&u) + taken) / stored - 1.0,
    })
}

/// The rows of cracks that run.
fn running(table: &mut Table) {
    let mut cases = Vec::new();
    for (place, rows) in [("middle of the zone", 0), ("one row inside the seam", -11)] {
        for method in METHODS {
            let all = [Breaks::All, Breaks::WithinZone];
            for breaks in all.into_iter().take(if rows == 0 { 1 } else { 2 }) {
                cases.push((place, rows, method, breaks));
            }
        }
    }
    let found: Vec<Vec<TableRow>> = cases
        .par_iter()
        .map(|&(place, rows, method, breaks)| {
            let case = case(method, widths(method));
            let y = line(method, rows);
            let which = match breaks {
                Breaks::All => "",
                Breaks::WithinZone => ", bonds out of the zone whole",
            };
            let name = format!("{}, crack in the {place}{which}", method.name());
            let alone = run_crack(&case, Some(ALONE), y, breaks, None);
            let measured = alone.and_then(|whole| {
                let steps = Some(whole.steps);
                run_crack(&case, None, y, breaks, steps).map(|run| (whole, run))
            });
            match measured {
                Err(why) => vec![TableRow::refused(&name, "energy taken", why)],
                Ok((_, run)) if run.missing.abs() > 1.0 => vec![TableRow::refused(
                    &name,
                    "energy taken",
                    format!(
                        "the motion grows: energy not accounted for is {:.1e} times that stored",
                        run.missing
                    ),
                )],
                Ok((whole, run)) => vec![
                    TableRow::info(&name, "energy taken", run.taken / whole.taken - 1.0),
                    TableRow::info(&name, "longer above", run.longer[0] - whole.longer[0]),
                    TableRow::info(&name, "longer below", run.longer[1] - whole.longer[1]),
                    TableRow::info(&name, "tip at 50 %", run.tip[0] - whole.tip[0]),
                    TableRow::info(&name, "tip at 85 %", run.tip[1] - whole.tip[1]),
                    TableRow::info(&name, "alone: longer above", whole.longer[0]),
                    TableRow::info(&name, "alone: below", whole.longer[1]),
                    TableRow::info(&name, "alone: tip", whole.tip[0]),
                    TableRow::info(&name, "steps", whole.steps as f64),
                    TableRow::info(&name, "energy missing", run.missing),
                    TableRow::info(&name, "alone: missing", whole.missing),
                ],
            }
        })
        .collect();
    found.into_iter().flatten().for_each(|row| table.push(row));
}

/// Direction from which a plane wave meets the zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meets {
    Face,
    Corner,
}

impl Meets {
    fn direction(self) -> Vector<2> {
        match self {
            Self::Face => Vector::<2>::new(1.0, 0.0),
            Self::Corner => Vector::<2>::new(0.5f64.sqrt(), 0.5f64.sqrt()),
        }
    }

    /// Returns the extent of the zone against the wave.
    fn reach(self, zone: f64) -> f64 {
        match self {
            Self::Face => zone,
            Self::Corner => zone * 2f64.sqrt(),
        }
    }
}

/// A longitudinal pulse of width w that starts 3 w before the zone, until its middle is 2 δ beyond the zone's first face or corner.
fn pulse(e: &Enclosed<2>, meets: Meets, width: f64, zone: f64, step: f64) -> Vec<f64> {
    let direction = meets.direction();
    let mass = masses(&e.model, |_| DENSITY);
    let start = -meets.reach(zone) - 3.0 * width;
    let along: Vec<f64> = e.positions().map(|x| x.dot(&direction) - start).collect();
    let speed = (e.tensor.get(0, 0, 0, 0) / DENSITY).sqrt();
    let shape = |s: f64| (-(s / width).powi(2)).exp();
    let field = |f: &dyn Fn(f64) -> f64| -> Vec<f64> {
        along
            .iter()
            .flat_map(|&s| [0, 1].map(|a| f(s) * direction[a]))
            .collect()
    };
    let mut u = field(&shape);
    let mut v = field(&|s| speed * 2.0 * s / (width * width) * shape(s));
    // a run moves by scaled rows
    let mut force = e.stiffness.multiply(&u);
    scale_rows(&e.model, &mut force);
    let time = (3.0 * width + 2.0 * f64::from(RATIO) * SPACING + 2.0 * width) / speed;
    for _ in 0..(time / step).ceil() as usize {
        for (dof, (v, f)) in v.iter_mut().zip(&force).enumerate() {
            *v -= step * f / mass[dof / 2];
        }
        u.iter_mut().zip(&v).for_each(|(u, v)| *u += step * v);
        e.stiffness.multiply_into(&u, &mut force);
        scale_rows(&e.model, &mut force);
    }
    u
}

/// Largest displacement, over that of the pulse, which the seam sends back to the finite elements.
fn sent_back(
    method: Method,
    meets: Meets,
    horizons: u32,
    material: Material,
) -> Result<f64, String> {
    let size = RATIO * horizons;
    let zone = 3 * RATIO;
    let transition = if method.has_transition() {
        2 * RATIO
    } else {
        0
    };
    let local = 6 * size + 3 * RATIO;
    let total = zone + 2 * RATIO + local;
    let case = case(
        method,
        Widths {
            nonlocal: zone,
            transition,
            local: total - zone - transition,
        },
    );
    let block = |coupling| {
        let built = material.block::<2>(&case, coupling, "");
        built.map_err(|e| e.to_string())
    };
    let (e, alone) = (block(None)?, block(Some("\"local\""))?);
    let speed = (e.tensor.get(0, 0, 0, 0) / DENSITY).sqrt();
    let step = 0.3 * SPACING / speed;
    let (width, edge) = (
        f64::from(size) * SPACING,
        f64::from(zone + transition) * SPACING,
    );
    let ours = pulse(&e, meets, width, edge, step);
    let pure = pulse(&alone, meets, width, edge, step);
    let there: HashMap<[i64; 2], usize> = alone
        .positions()
        .enumerate()
        .map(|(s, x)| (key(x), s))
        .collect();
    let limit = -meets.reach(edge) - 2.0 * f64::from(RATIO) * SPACING;
    let mut largest = 0.0f64;
    for (s, x) in e.positions().enumerate() {
        let Some(&t) = there.get(&key(x)) else {
            continue;
        };
        if x.dot(&meets.direction()) < limit {
            for a in 0..2 {
                largest = largest.max((ours[2 * s + a] - pure[2 * t + a]).abs());
            }
        }
    }
    // more than came in
    if largest > 1.0 {
        return Err(format!("the motion grows, to {largest:.0} times the pulse"));
    }
    Ok(largest)
}

/// The slit at rest, and cracks that run.
pub(super) fn cracks(progress: &dyn Progress) -> Vec<Table> {
    progress.stage("cracks", None);
    let mut rest = Table::new(
        "A crack of 8 h at rest in a zone of 24 h inside of 48 h, m = 3, tension across it, against peridynamics alone: displacement of the points less the uniform one (relative root mean square), and the opening",
        Columns::ByQuantity,
    );
    let materials = [
        Material::Pairwise(Micromodulus::InverseDistance),
        Material::Lps(0.3),
    ];
    let cases: Vec<(Method, Material)> = METHODS
        .into_iter()
        .flat_map(|m| materials.map(|l| (m, l)))
        .collect();
    let found: Vec<Result<[f64; 2], String>> =
        cases.par_iter().map(|(m, l)| at_rest(*m, *l)).collect();
    for ((method, material), found) in cases.iter().zip(found) {
        let name = format!("{}, {}", method.name(), material.name());
        match found {
            Ok([field, opening]) => {
                rest.push(TableRow::info(&name, "field", field));
                rest.push(TableRow::info(&name, "opening", opening));
            }
            Err(why) => rest.push(TableRow::refused(&name, "field", why)),
        }
    }
    let mut moving = Table::new(
        "The same crack as it runs (bond-based; the block stretched by 0.62 of the critical stretch and let go until it is twice as long), against peridynamics alone at the same time: energy taken, relative; how much longer, in h, by the bonds that the \
         points above and below have lost; the farthest point that has lost 50 % and 85 % of its bonds across; energy not accounted for, over that stored",
        Columns::ByQuantity,
    );
    running(&mut moving);
    vec![rest, moving]
}

/// Plane waves in the plane.
pub(super) fn waves(effort: Effort, progress: &dyn Progress) -> Table {
    progress.stage("waves in the plane", None);
    let mut table = Table::new(
        "Displacement that a zone of 6 delta by 6 delta sends back of a longitudinal pulse of width w, over its height: largest difference from finite elements alone, two horizons and more before the seam; m = 3",
        Columns::ByQuantity,
    );
    let widths: &[u32] = match effort {
        Effort::Quick => &[2],
        Effort::Full => &[1, 2, 4],
    };
    let mut cases = Vec::new();
    for meets in [Meets::Face, Meets::Corner] {
        for method in METHODS {
            for &w in widths {
                cases.push((meets, method, w));
            }
        }
    }
    let material = Material::Pairwise(Micromodulus::InverseDistance);
    let found: Vec<Result<f64, String>> = cases
        .par_iter()
        .map(|&(meets, method, w)| sent_back(method, meets, w, material))
        .collect();
    for ((meets, method, w), found) in cases.iter().zip(found) {
        let name = match meets {
            Meets::Face => format!("{}, onto a face", method.name()),
            Meets::Corner => format!("{}, onto a corner", method.name()),
        };
        let quantity = format!("w = {w} delta");
        table.push(match found {
            Ok(v) => TableRow::info(&name, quantity, v),
            Err(why) => TableRow::refused(&name, quantity, why),
        });
    }
    table
}
