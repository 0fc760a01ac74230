//! Waves for 100 000 steps: the quantities that a motion conserves.
//!
//! For a symmetric stiffness, velocity Verlet conserves `½ v_{n+½}ᵀ M v_{n+½} + ½ u_nᵀ K u_{n+1}` to round-off, and a free body its momentum. Splice, blending and
//! partial stress have no energy of their own: theirs is the sum of the bodies' own energies, kinetic and stored, which a seam must leave as it was once a pulse has
//! passed. It is read as `½ vᵀ M v + ½ uᵀ K u` while the pulse is clear of the seams, where the rows in motion are those of one body.

use std::ops::ControlFlow;

use rayon::prelude::*;

use crate::Effort;
use crate::enclosed::{INFLUENCE, Law, Method};
use crate::strip::{Kind, Strip, StripCase};
use bondline::observe::report::{Columns, Table, TableRow};
use bondline::peridynamics::Micromodulus;
use bondline::progress::Progress;
use bondline::solve::explicit::{Explicit, ExplicitParams, State, Undriven};
use bondline::solve::instability_growth::{self, REMEDY, REMEDY_SEAM};
use bondline::solve::krylov::dot;
use bondline::solve::stable_step::{self, StepLimit};
use bondline::system::{LinearMotion, Symmetry};

/// Steps of every motion.
pub const STEPS: u64 = 100_000;
/// Part of the stable step that is taken.
pub const FRACTION: f64 = 0.95;
/// Largest change of the discrete energy of a symmetric model, relative to the energy.
pub const DISCRETE: f64 = 1e-10;
/// Largest change of momentum of a free body, relative to the momentum `Σ |m v|` that comes and goes.
pub const MOMENTUM: f64 = 1e-11;
/// Largest change of the bodies' own energy over the run, and of its trend.
pub const OWN: f64 = 1e-3;
/// The pulse is clear while the seams hold less than this part of the energy.
const CLEAR: f64 = 1e-5;
/// Half width of the pulse in spacings, and length of every zone but the transitions. Over the run the pulse goes to and fro some fifty times: one of 30 h in zones of
/// 300 h, with the inverse distance at m = 3, has spread over all of the strip by then, and is never clear in the last tenth of the readings.
const WIDTH: f64 = 60.0;
const ZONE: u32 = 600;

fn strip_case(kind: Kind, law: Law, ratio: u32) -> StripCase {
    StripCase {
        kind,
        law,
        ratio: f64::from(ratio),
        edge_ratio: f64::from(ratio),
        lengths: [ZONE, 2 * ratio, ZONE, 2 * ratio, ZONE],
        cell: 1,
        across: 1,
    }
}

/// A pulse that runs to the right, in the middle of the left zone.
fn pulse(strip: &Strip) -> State {
    let d = strip.motion.stiffness.block;
    let middle = 0.5 * strip.borders[0];
    let width = WIDTH.min(0.25 * strip.borders[0]);
    let (mut u, mut v) = (vec![0.0; d * strip.x.len()], vec![0.0; d * strip.x.len()]);
    for (i, x) in strip.x.iter().enumerate() {
        let s = (x - middle) / width;
        u[i * d] = (-s * s).exp();
        v[i * d] = 2.0 * s / width * u[i * d];
    }
    State::start(u, v)
}

/// Noise in every dof, without rigid motion: a body that drifts gets far, and the rounding of its internal force grows with its displacement.
fn noise(strip: &Strip) -> State {
    let n = strip.motion.stiffness.dofs();
    let numbers = |seed: usize| {
        let numbers = (0..n)
            .map(|k| ((k * 7919 + seed * 104_729) % 1009) as f64 / 504.0 - 1.0)
            .collect();
        without_rigid_motion(strip, numbers)
    };
    State::start(numbers(1), numbers(2))
}

/// A field less its translation and, in the plane, its rotation, by the masses.
fn without_rigid_motion(strip: &Strip, mut field: Vec<f64>) -> Vec<f64> {
    let (d, mass) = (strip.motion.stiffness.block, &strip.motion.mass);
    let product =
        |a: &[f64], b: &[f64]| -> f64 { (0..a.len()).map(|k| mass[k / d] * a[k] * b[k]).sum() };
    let mut modes: Vec<Vec<f64>> = (0..d)
        .map(|axis| {
            (0..field.len())
                .map(|k| f64::from(u8::from(k % d == axis)))
                .collect()
        })
        .collect();
    if d == 2 {
        let turned = strip.x.iter().zip(&strip.y).flat_map(|(x, y)| [-y, *x]);
        modes.push(turned.collect());
    }
    for k in 0..modes.len() {
        let (known, mode) = modes.split_at_mut(k);
        let mode = &mut mode[0];
        // once more for what rounding leaves
        for _ in 0..2 {
            for other in &*known {
                let c = product(other, mode) / product(other, other);
                mode.iter_mut().zip(other).for_each(|(m, o)| *m -= c * o);
            }
        }
        for _ in 0..2 {
            let c = product(mode, &field) / product(mode, mode);
            field.iter_mut().zip(&*mode).for_each(|(f, m)| *f -= c * m);
        }
    }
    field
}

/// Steps `STEPS` times and hands every `every`-th state to `look`.
fn go(
    motion: &mut LinearMotion,
    limit: &StepLimit,
    state: State,
    every: u64,
    look: &mut dyn FnMut(&Explicit<'_>),
) -> Result<(), String> {
    let params = ExplicitParams::with_step(FRACTION * limit.stable);
    let mut run = Explicit::new(motion, &Undriven, params, state).map_err(|e| e.to_string())?;
    run.run(STEPS, &mut |m| {
        if m.state().step % every == 0 {
            look(m);
        }
        ControlFlow::Continue(())
    })
    .map(|_| ())
    .map_err(|e| e.to_string())
}

/// Discrete energy and momentum of a symmetric model in noise.
fn symmetric_rows(name: &str, strip: Result<Strip, String>) -> Vec<TableRow> {
    let measured = || -> Result<Vec<TableRow>, String> {
        let strip = strip?;
        let start = noise(&strip);
        let mut motion = strip.motion;
        let limit = stable_step::stable_step(&motion, &[]).map_err(|e| e.to_string())?;
        let d = motion.stiffness.block;
        let (mut first, mut change) = (None, 0.0_f64);
        let (mut momentum, mut drift): (Option<Vec<f64>>, f64) = (None, 0.0);
        let scale: f64 = start
            .v
            .chunks_exact(d)
            .zip(&motion.mass)
            .map(|(v, m)| m * v.iter().map(|v| v.abs()).sum::<f64>())
            .sum();
        go(&mut motion, &limit, start, 1, &mut |m| {
            let energy = m.energies().discrete;
            let reference = *first.get_or_insert(energy);
            change = change.max((energy / reference - 1.0).abs());
            if m.state().step % 100 == 1 {
                let now = m.momentum();
                let then = momentum.get_or_insert_with(|| now.clone());
                for (now, then) in now.iter().zip(then.iter()) {
                    drift = drift.max((now - then).abs() / scale);
                }
            }
        })?;
        Ok(vec![
            TableRow::at_most(name, "discrete energy", change, DISCRETE),
            TableRow::at_most(name, "momentum", drift, MOMENTUM),
        ])
    };
    measured().unwrap_or_else(|reason| vec![TableRow::refused(name, "discrete energy", reason)])
}

/// Change of a pulse's energy while it was clear of the seams.
#[derive(Clone, Copy, Debug)]
pub struct OwnEnergy {
    /// Largest change, relative.
    pub change: f64,
    /// Mean of the last tenth of the run less mean of the first, relative.
    pub trend: f64,
    /// Part of the readings in which the pulse was clear.
    pub clear: f64,
}

/// The bodies' own energy of a strip through which a pulse runs.
///
/// # Errors
/// The reason why the motion cannot start or go on.
pub fn own_energy(strip: &mut Strip, reach: f64) -> Result<OwnEnergy, String> {
    let limit = stable_step::stable_step(&strip.motion, &[]).map_err(|e| e.to_string())?;
    let start = pulse(strip);
    let Strip {
        motion, x, borders, ..
    } = strip;
    let d = motion.stiffness.block;
    let mut readings: Vec<(u64, f64)> = Vec::new();
    let mut count = 0;
    let seam: Vec<bool> = x
        .iter()
        .map(|x| {
            (borders[0] - reach < *x && *x < borders[1] + reach)
                || (borders[2] - reach < *x && *x < borders[3] + reach)
        })
        .collect();
    go(motion, &limit, start, 20, &mut |m| {
        let State { u, v, .. } = m.state();
        let (mut all, mut near) = (0.0, 0.0);
        for (i, mass) in m.system().mass().iter().enumerate() {
            let here: f64 = (i * d..(i + 1) * d)
                .map(|k| mass * v[k] * v[k] + (u[k] * m.internal_force()[k]))
                .sum();
            all += here;
            if seam[i] {
                near += here.abs();
            }
        }
        count += 1;
        if near <= CLEAR * all {
            let stored = dot(u, m.internal_force());
            readings.push((m.state().step, m.energies().kinetic + 0.5 * stored));
        }
    })?;
    let Some(&(_, first)) = readings.first() else {
        return Err("the pulse was never clear of the seams".to_owned());
    };
    let mean = |from: u64, to: u64| {
        let some: Vec<f64> = readings
            .iter()
            .filter(|(step, _)| (from..=to).contains(step))
            .map(|r| r.1)
            .collect();
        some.iter().sum::<f64>() / some.len() as f64
    };
    Ok(OwnEnergy {
        change: readings
            .iter()
            .fold(0.0_f64, |m, (_, e)| m.max((e / first - 1.0).abs())),
        trend: (mean(STEPS - STEPS / 10, STEPS) - mean(0, STEPS / 10)) / first,
        clear: readings.len() as f64 / f64::from(count),
    })
}

fn coupled_rows(name: &str, case: &StripCase) -> Vec<TableRow> {
    let remedy = match case.kind {
        Kind::Coupled(Method::Meshfree | Method::Elements(_)) => REMEDY,
        _ => REMEDY_SEAM,
    };
    let measured = || -> Result<Vec<TableRow>, String> {
        let mut strip = Strip::new::<1>(case)?;
        let limit = stable_step::stable_step(&strip.motion, &[]).map_err(|e| e.to_string())?;
        let step = FRACTION * limit.stable;
        let growth = instability_growth::growth(&strip.motion, &[], step, STEPS, None)
            .map_err(|e| e.to_string())?;
        growth
            .admit(step * STEPS as f64, remedy)
            .map_err(|e| e.to_string())?;
        let own = own_energy(&mut strip, 2.0 * case.ratio)?;
        let mut rows = vec![
            TableRow::at_most(name, "own energy", own.change, OWN),
            TableRow::at_most(name, "trend", own.trend.abs(), OWN),
            TableRow::info(name, "clear", own.clear),
        ];
        if strip.motion.symmetry == Symmetry::Symmetric {
            rows.extend(symmetric_rows(name, Ok(strip)));
        }
        Ok(rows)
    };
    measured().unwrap_or_else(|reason| vec![TableRow::refused(name, "own energy", reason)])
}

/// Runs the suite.
pub fn run(effort: Effort, _progress: &dyn Progress) -> Vec<Table> {
    let laws = [
        ("bond-based", Law::BondBased(Micromodulus::InverseDistance)),
        ("LPS P1/r", Law::StateBased(INFLUENCE)),
    ];
    let small = |kind, law, across: u32| StripCase {
        lengths: [8, 4, 8, 4, 8],
        across,
        ..strip_case(kind, law, 2)
    };
    let mut symmetric: Vec<(String, Result<Strip, String>)> = Vec::new();
    for (law_name, law) in laws {
        for kind in [
            Kind::Local,
            Kind::Nonlocal,
            Kind::Coupled(Method::Truncated),
        ] {
            let line = StripCase {
                lengths: [100, 6, 100, 6, 100],
                ..strip_case(kind, law, 3)
            };
            symmetric.push((
                format!("{}, {law_name}, 1D", kind.name()),
                Strip::new::<1>(&line),
            ));
            symmetric.push((
                format!("{}, {law_name}, 2D", kind.name()),
                Strip::new::<2>(&small(kind, law, 8)),
            ));
        }
    }
    let mut first = Table::new(
        "symmetric models, free, in noise, 100 000 steps at 0.95 of the stable step: largest relative change",
        Columns::ByQuantity,
    );
    let rows: Vec<Vec<TableRow>> = symmetric
        .into_par_iter()
        .map(|(name, strip)| symmetric_rows(&name, strip))
        .collect();
    rows.into_iter().flatten().for_each(|row| first.push(row));

    let ratios: &[u32] = match effort {
        Effort::Quick => &[3],
        Effort::Full => &[2, 3, 4, 6],
    };
    let mut cases = Vec::new();
    for &ratio in ratios {
        for (law_name, law) in laws {
            for method in Method::ALL {
                let kind = Kind::Coupled(method);
                let name = format!("{}, {law_name}, m={ratio}", kind.name());
                cases.push((name, strip_case(kind, law, ratio)));
            }
        }
    }
    let rows: Vec<Vec<TableRow>> = cases
        .par_iter()
        .map(|(name, case)| coupled_rows(name, case))
        .collect();
    let mut second = Table::new(
        "coupled bars, a pulse of width 60 h in zones of 600 h, 100 000 steps at 0.95 of the stable step: the bodies' own energy while the pulse is clear of the seams",
        Columns::ByQuantity,
    );
    rows.into_iter().flatten().for_each(|row| second.push(row));
    vec![first, second]
}

#[cfg(test)]
mod tests {
    use super::*;
    use bondline::observe::report::Verdict;

    #[test]
    fn finite_elements_conserve_energy_and_momentum() {
        let case = StripCase {
            lengths: [30, 6, 30, 6, 30],
            ..strip_case(
                Kind::Local,
                Law::BondBased(Micromodulus::InverseDistance),
                3,
            )
        };
        let rows = symmetric_rows("", Strip::new::<1>(&case));
        assert!(
            rows.len() == 2 && rows.iter().all(|r| r.verdict == Verdict::Pass),
            "{rows:?}"
        );
    }
}
