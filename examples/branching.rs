//! A crack that branches in glass: coupled against full peridynamics, by branch point, branch time, energy, and total time.
//!
//!     cargo run --release --example branching
//!     cargo run --release --example branching -- --figures docs/figures
//!     cargo run --release --example branching -- --output out/branching --json

use std::{path::PathBuf, process::ExitCode};

use bondline::observe::{
    figure::{LinePlot, Series, Stroke},
    report::{self, Row, Table},
};
use shared::{Columns, Failure, argument, run};

mod shared;

/// Runs of each model, of which the fastest counts.
const TURNS: usize = 3;

/// What a run tells.
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
}

fn main() -> ExitCode {
    shared::printed(tables())
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
    let (upper, lower, root) = (read("tip_upper")?, read("tip_lower")?, read("tip_root")?);
    let path = |tip: &Columns| -> Result<Vec<(f64, f64)>, Failure> {
        Ok(tip.column("x")?.into_iter().zip(tip.column("y")?).collect())
    };
    let paths = [path(&upper)?, path(&lower)?];
    let end = |k: usize| paths[k].last().copied().unwrap_or((f64::NAN, f64::NAN));
    let tips = [end(0), end(1)];
    Ok(Crack {
        time: root.column("time")?[0],
        point: last(root.column("x")?),
        tips,
        thickness: last(read("tip_over")?.column("y")?) - last(read("tip_under")?.column("y")?),
        dissipated: last(history.column("dissipated_energy")?),
        broken: last(history.column("broken_bonds")?),
        seconds: [summary.total_seconds, summary.timings.seconds("steps")],
        points: summary.sizes.points,
        sites: summary.sizes.sites,
        paths,
    })
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
    table.push(Row::info(alone, "branch point, mm", full.point * 1e3));
    table.push(Row::info(alone, "branch time, us", full.time * 1e6));
    table.push(Row::info(alone, "dissipated energy, J/m", full.dissipated));
    let mut paths = |name: &str, crack: &Crack, stroke| {
        for (half, path) in ["upper", "lower"].iter().zip(&crack.paths) {
            let path = path.iter().map(|p| (p.0 * 1e3, p.1 * 1e3)).collect();
            series.push(Series::new(format!("{name}, {half}"), stroke, path));
        }
    };
    paths("full PD", &full, Stroke::Dashed);
    paths(name, &coupled, Stroke::Line);
    let percent = |a: f64, b: f64| 100.0 * (a / b - 1.0).abs();
    table.push(Row::at_most(
        name,
        "branch point against full PD, mm",
        1e3 * (coupled.point - full.point).abs(),
        2.0,
    ));
    table.push(Row::at_most(
        name,
        "branch time against full PD, us",
        1e6 * (coupled.time - full.time).abs(),
        2.0,
    ));
    table.push(Row::at_most(
        name,
        "dissipated energy against full PD, %",
        percent(coupled.dissipated, full.dissipated),
        5.0,
    ));
    table.push(Row::info(
        name,
        "broken bonds against full PD, %",
        percent(coupled.broken, full.broken),
    ));
    let [upper, lower] = coupled.tips;
    table.push(Row::at_most(
        name,
        "asymmetry of the two tips at the end, mm",
        1e3 * (upper.0 - lower.0)
            .abs()
            .max((upper.1 + lower.1 - 0.04).abs()),
        1.0,
    ));
    table.push(Row::at_most(
        name,
        "extent of the upper branch across at x = 85 mm: one branch, mm",
        1e3 * coupled.thickness,
        2.0,
    ));
    // a time is no reason to fail, but a miss is not to be read as a pass
    for (k, what) in ["total time", "time of the steps alone"].iter().enumerate() {
        let ratio = full.seconds[k] / coupled.seconds[k];
        let what = format!("{what}, full PD over coupled");
        let row = Row::info(name, &what, ratio);
        table.push(if ratio < 1.8 {
            row.differs("1.8 is wanted; docs/fracture.md says what it is lost to")
        } else {
            row
        });
    }
    table.push(Row::info(
        name,
        "points over those of full PD",
        coupled.points as f64 / full.points as f64,
    ));
    table.push(Row::info(
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
