//! A crack that branches in glass: coupled against full peridynamics, by branch point, branch time, energy, and total time.
//!
//!     cargo run --release --example branching
//!     cargo run --release --example branching -- --figures docs/figures
//!     cargo run --release --example branching -- --output out/branching --json
//!     cargo run --release --example branching -- --couplings                     every coupling instead, without times

use std::{path::PathBuf, process::ExitCode};

use bondline::observe::{
    report::{self, Table, TableRow},
    summary::{Ended, MotionSummary},
};
use bondline_study::{
    line_plot::{LinePlot, Series, Stroke},
    pareto::distance_from_path,
};
use shared::{Columns, Failure, argument, run};

mod shared;

/// Runs of each model, of which the fastest counts.
const TURNS: usize = 3;

/// Mass of the plate, per thickness \[kg/m\].
const MASS: f64 = 2440.0 * 0.1 * 0.04;

/// Every coupling that joins the two, on the zone of the scene; a transition zone lies outside of it.
const COUPLINGS: [(&str, &[&str]); 8] = [
    ("truncated, cut bonds linear", &[]),
    (
        "truncated, cut bonds break",
        &["coupling.truncated.cut-bonds=breaking"],
    ),
    ("splice", &["coupling=splice"]),
    (
        "blending, smooth",
        &["coupling=blending", "zones.transition.around=3e-3"],
    ),
    ("balanced", &["coupling=balanced"]),
    (
        "balanced, smooth",
        &[
            "coupling.balanced.beta=smooth",
            "zones.transition.around=3e-3",
        ],
    ),
    (
        "partial stress, elements",
        &["coupling=partial-stress", "zones.transition.around=1e-3"],
    ),
    (
        "partial stress, meshfree",
        &[
            "coupling.partial-stress.form=meshfree",
            "zones.transition.around=1e-3",
        ],
    ),
];

/// Results of a run.
struct Crack {
    time: f64,
    point: f64,
    tips: [(f64, f64); 2],
    thickness: f64,
    dissipated: f64,
    broken: f64,
    /// Of the whole run, and of its steps alone.
    seconds: [f64; 2],
    points: usize,
    sites: usize,
    paths: [Vec<(f64, f64)>; 2],
    /// Largest momentum, relative to that of the plate with its kinetic energy; loads give it none.
    drift: f64,
    motion: MotionSummary,
}

impl Crack {
    /// Largest difference of the two tips at the end from mirror images \[m\].
    fn asymmetry(&self) -> f64 {
        let [upper, lower] = self.tips;
        (upper.0 - lower.0)
            .abs()
            .max((upper.1 + lower.1 - 0.04).abs())
    }

    /// Largest distance of a point of this path from the paths of another run, half for half \[m\].
    fn path_distance(&self, other: &Self) -> f64 {
        let flat = |path: &[(f64, f64)]| path.iter().map(|p| [p.0, p.1]).collect::<Vec<_>>();
        let halves = self.paths.iter().zip(&other.paths);
        let distances = halves.flat_map(|(own, other)| {
            let other = flat(other);
            let own = flat(own).into_iter();
            own.map(move |x| distance_from_path(&x, &other).unwrap_or(f64::NAN))
        });
        distances.fold(0.0, f64::max)
    }

    /// Energy that came from nowhere, over the work of the loads.
    fn surplus(&self) -> f64 {
        let m = &self.motion;
        (self.dissipated - m.missing_energy) / m.external_work
    }

    /// Returns the reason that the run ended before its time, if it did.
    fn stopped(&self) -> Option<String> {
        let m = &self.motion;
        let (time, place) = m.edge_reached.as_ref()?;
        (m.ended != Ended::Finished).then(|| {
            format!(
                "damage reaches the edge of the zone at {:.3} us, ({:.2}, {:.2}) mm; kinetic energy {:.3} J/m after work of {:.3}",
                time * 1e6,
                place[0] * 1e3,
                place[1] * 1e3,
                m.kinetic_energy,
                m.external_work
            )
        })
    }
}

fn main() -> ExitCode {
    let every = std::env::args().any(|a| a == "--couplings");
    shared::printed(if every { couplings() } else { tables() })
}

fn crack(name: &str, overrides: &[&str], output: &std::path::Path) -> Result<Crack, Failure> {
    let mut all: Vec<String> = overrides.iter().map(|s| (*s).to_owned()).collect();
    // pictures cost more than the motion, and alike for both
    all.push("solve.explicit.outputs=1".into());
    // where the branches begin, and how thick one of them is further on
    for (tip, direction, low, high) in [
        ("root", "[-1, 0]", "[0, 0.021]", "[0.1, 0.04]"),
        ("over", "[0, 1]", "[0.085, 0.021]", "[0.086, 0.04]"),
        ("under", "[0, -1]", "[0.085, 0.021]", "[0.086, 0.04]"),
    ] {
        all.push(format!(
            "output.tips.{tip}={{direction={direction},inside={{box={{min={low},max={high}}}}}}}"
        ));
    }
    let summary = run("branching.toml", &all, output, name)?;
    let read = |end: &str| Columns::read(&output.join(name).join(format!("branching_{end}.csv")));
    let history = read("history")?;
    let last = |values: Vec<f64>| values.last().copied().unwrap_or(f64::NAN);
    // where no bond is broken there is no file: of branches that a run which stopped early has not
    let tip = |tip: &str| -> Result<Vec<[f64; 3]>, Failure> {
        if !output
            .join(name)
            .join(format!("branching_tip_{tip}.csv"))
            .exists()
        {
            return Ok(vec![]);
        }
        let tip = read(&format!("tip_{tip}"))?;
        let place = tip.column("x")?.into_iter().zip(tip.column("y")?);
        let rows = tip.column("time")?.into_iter().zip(place);
        Ok(rows.map(|(t, (x, y))| [t, x, y]).collect())
    };
    let path = |name: &str| -> Result<Vec<(f64, f64)>, Failure> {
        Ok(tip(name)?.into_iter().map(|[_, x, y]| (x, y)).collect())
    };
    let paths = [path("upper")?, path("lower")?];
    let none = (f64::NAN, f64::NAN);
    let end = |k: usize| paths[k].last().copied().unwrap_or(none);
    let height = |name: &str| Ok::<_, Failure>(path(name)?.last().unwrap_or(&none).1);
    let root = tip("root")?;
    let tips = [end(0), end(1)];
    let motion = summary
        .motion
        .ok_or("a scene in time tells of its motion")?;
    let momentum = [history.column("momentum_x")?, history.column("momentum_y")?];
    let largest = momentum
        .iter()
        .flatten()
        .fold(0.0, |m: f64, p| m.max(p.abs()));
    Ok(Crack {
        time: root.first().map_or(f64::NAN, |r| r[0]),
        point: root.last().map_or(f64::NAN, |r| r[1]),
        tips,
        thickness: height("over")? - height("under")?,
        dissipated: last(history.column("dissipated_energy")?),
        broken: last(history.column("broken_bonds")?),
        seconds: [summary.total_seconds, summary.timings.seconds("steps")],
        points: summary.sizes.points,
        sites: summary.sizes.sites,
        paths,
        drift: largest / (2.0 * MASS * motion.kinetic_energy).sqrt(),
        motion,
    })
}

/// Every coupling beside full peridynamics.
fn couplings() -> Result<Vec<Table>, Failure> {
    let output = PathBuf::from(argument("--output").unwrap_or("out/branching".into()));
    let full = crack("full", &["coupling=nonlocal"], &output)?;
    let mut table = Table::new(
        "branching, every coupling. off in path: largest distance from the path of full PD; asymmetry: of the tips at the end from mirror images; momentum: the most, of that of the plate with its kinetic energy; surplus: energy that \
         came from nowhere, over the work of the loads",
        report::Columns::ByQuantity,
    );
    let mut push = |name: &str, run: &Crack| {
        let mut rows = vec![
            ("branch point, mm", run.point * 1e3),
            ("time, us", run.time * 1e6),
        ];
        if run.stopped().is_none() {
            rows.extend([
                ("dissipated, J/m", run.dissipated),
                ("asymmetry, mm", run.asymmetry() * 1e3),
                ("momentum", run.drift),
                ("surplus", run.surplus()),
            ]);
            if name != "full PD" {
                rows.push(("off in path, mm", run.path_distance(&full) * 1e3));
            }
        }
        rows.extend([
            ("steps", run.motion.of_steps as f64),
            ("points", run.points as f64),
        ]);
        for (quantity, value) in rows {
            // what stopped early may have no branches
            if value.is_finite() {
                table.push(TableRow::info(name, quantity, value));
            }
        }
        if let Some(why) = run.stopped() {
            table.push(TableRow::refused(name, "dissipated, J/m", why));
        }
    };
    push("full PD", &full);
    let mut refused = vec![];
    for (number, (name, overrides)) in COUPLINGS.into_iter().enumerate() {
        match crack(&format!("coupling-{number}"), overrides, &output) {
            Ok(run) => push(name, &run),
            Err(why) => refused.push(TableRow::refused(name, "dissipated, J/m", why.to_string())),
        }
    }
    refused.into_iter().for_each(|row| table.push(row));
    Ok(vec![table])
}

/// Adds the errors of the branch point and time, of the dissipated energy and of the width of the branch, against full peridynamics.
fn push_accuracy(table: &mut Table, name: &str, full: &Crack, coupled: &Crack) {
    let percent = |a: f64, b: f64| 100.0 * (a / b - 1.0).abs();
    table.push(TableRow::at_most(
        name,
        "branch point against full PD, mm",
        1e3 * (coupled.point - full.point).abs(),
        2.0,
    ));
    table.push(TableRow::at_most(
        name,
        "branch time against full PD, us",
        1e6 * (coupled.time - full.time).abs(),
        2.0,
    ));
    table.push(TableRow::at_most(
        name,
        "dissipated energy against full PD, %",
        percent(coupled.dissipated, full.dissipated),
        5.0,
    ));
    table.push(TableRow::info(
        name,
        "broken bonds against full PD, %",
        percent(coupled.broken, full.broken),
    ));
    table.push(TableRow::at_most(
        name,
        "asymmetry of the two tips at the end, mm",
        1e3 * coupled.asymmetry(),
        1.0,
    ));
    table.push(TableRow::at_most(
        name,
        "extent of the upper branch across at x = 85 mm: one branch, mm",
        1e3 * coupled.thickness,
        2.0,
    ));
}

fn tables() -> Result<Vec<Table>, Failure> {
    let output = PathBuf::from(argument("--output").unwrap_or("out/branching".into()));
    // in turn, so that what else the machine does meets both; the least disturbed run of each tells its time
    let (name, pure): (_, &[&str]) = ("truncated", &["coupling=nonlocal"]);
    let (mut full, mut coupled) = (crack("full", pure, &output)?, crack(name, &[], &output)?);
    let fastest = |of: &mut Crack, again: Crack| {
        for (known, seconds) in of.seconds.iter_mut().zip(again.seconds) {
            *known = known.min(seconds);
        }
    };
    for _ in 1..TURNS {
        fastest(&mut full, crack("full", pure, &output)?);
        fastest(&mut coupled, crack(name, &[], &output)?);
    }
    let mut table = Table::new(
        "branching, coupled against full PD",
        report::Columns::default(),
    );
    let mut series = vec![];
    let alone = "full PD";
    table.push(TableRow::info(alone, "branch point, mm", full.point * 1e3));
    table.push(TableRow::info(alone, "branch time, us", full.time * 1e6));
    table.push(TableRow::info(
        alone,
        "dissipated energy, J/m",
        full.dissipated,
    ));
    let mut paths = |name: &str, crack: &Crack, stroke| {
        for (half, path) in ["upper", "lower"].iter().zip(&crack.paths) {
            let path = path.iter().map(|p| (p.0 * 1e3, p.1 * 1e3)).collect();
            series.push(Series::new(format!("{name}, {half}"), stroke, path));
        }
    };
    paths("full PD", &full, Stroke::Dashed);
    paths(name, &coupled, Stroke::Line);
    push_accuracy(&mut table, name, &full, &coupled);
    // a time is no reason to fail, but a miss is not to be read as a pass
    for (k, what) in ["total time", "time of the steps alone"].iter().enumerate() {
        let ratio = full.seconds[k] / coupled.seconds[k];
        let what = format!("{what}, full PD over coupled");
        let row = TableRow::info(name, &what, ratio);
        table.push(if ratio < 1.8 {
            row.differs("1.8 is wanted; docs/fracture.md says what it is lost to")
        } else {
            row
        });
    }
    table.push(TableRow::info(
        name,
        "points over those of full PD",
        coupled.points as f64 / full.points as f64,
    ));
    table.push(TableRow::info(
        name,
        "sites over those of full PD",
        coupled.sites as f64 / full.sites as f64,
    ));
    if let Some(folder) = argument("--figures") {
        LinePlot {
            title: "Paths of the tips".into(),
            x_label: "x (mm)".into(),
            y_label: "y (mm)".into(),
            series,
            ..LinePlot::default()
        }
        .write(&PathBuf::from(folder).join("branching_paths.svg"))?;
    }
    Ok(vec![table])
}
