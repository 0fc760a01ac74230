//! Kalthoff and Winkler's plate: the angle at which cracks leave the notches, coupled against full peridynamics.
//!
//!     cargo run --release --example kalthoff_winkler
//!     cargo run --release --example kalthoff_winkler -- --output out/kalthoff --json

use std::{path::PathBuf, process::ExitCode};

use bondline::observe::report::{self, Table, TableRow};
use shared::{Columns, Failure, argument, between, run};

mod shared;

/// Distance of the crack tip from that of the notch at which the angle is taken \[m\].
const RUN: f64 = 0.03;

fn main() -> ExitCode {
    shared::printed(tables())
}

/// Horizon of the scene \[m\].
const HORIZON: f64 = 2e-3;

/// Distance of the crack tip from that of the notch at the end \[m\].
fn advance(tip: &Columns, notch: [f64; 2]) -> Result<f64, Failure> {
    let end = |name| Ok::<_, Failure>(*tip.column(name)?.last().ok_or("an empty table")?);
    Ok((end("x")? - notch[0]).hypot(end("y")? - notch[1]))
}

/// Angle in degrees between the notch and the way from its tip to that of the crack, when this is `RUN` away; and the time.
fn angle(tip: &Columns, notch: [f64; 2]) -> Result<(f64, f64), Failure> {
    let (time, x, y) = (tip.column("time")?, tip.column("x")?, tip.column("y")?);
    (0..time.len())
        .map(|k| (time[k], x[k] - notch[0], (y[k] - notch[1]).abs()))
        .find(|(_, dx, dy)| dx.hypot(*dy) >= RUN)
        .map(|(time, dx, dy)| (dy.atan2(dx).to_degrees(), time))
        .ok_or_else(|| "the crack has not run 30 mm".into())
}

fn tables() -> Result<Vec<Table>, Failure> {
    let output = PathBuf::from(argument("--output").unwrap_or("out/kalthoff_winkler".into()));
    let mut table = Table::new(
        "Kalthoff-Winkler, secant angle after 30 mm",
        report::Columns::default(),
    );
    let mut reference: Option<([f64; 2], f64)> = None;
    for (name, overrides) in [("full PD", &["coupling=nonlocal"][..]), ("truncated", &[])] {
        let mut all: Vec<String> = overrides.iter().map(|s| (*s).to_owned()).collect();
        // pictures cost more than the motion, and alike for both
        all.push("solve.explicit.outputs=1".into());
        let folder = name.replace(' ', "_");
        let summary = run("kalthoff_winkler.toml", &all, &output, &folder)?;
        let read = |end: &str| {
            Columns::read(
                &output
                    .join(&folder)
                    .join(format!("kalthoff_winkler_{end}.csv")),
            )
        };
        let tips = [("tip_lower", [0.05, 0.075]), ("tip_upper", [0.05, 0.125])];
        let [(lower, time), (upper, _)] = [
            angle(&read(tips[0].0)?, tips[0].1)?,
            angle(&read(tips[1].0)?, tips[1].1)?,
        ];
        // the ways are almost straight
        let advances = tips.map(|(tip, notch)| advance(&read(tip)?, notch));
        let [lower_advance, upper_advance] = advances;
        let advanced = lower_advance? + upper_advance?;
        let cracks = summary.motion.as_ref().and_then(|motion| motion.cracks);
        let length = cracks.ok_or("no bond has broken")?.area;
        table.push(TableRow::at_most(
            name,
            "crack length beyond the advance of the tips, horizons a crack",
            0.5 * (length - advanced).abs() / HORIZON,
            1.0,
        ));
        for (which, angle) in [("lower", lower), ("upper", upper)] {
            table.push(between(
                name,
                format!("angle of the {which} crack, degrees"),
                angle,
                63.0,
                73.0,
            ));
        }
        table.push(TableRow::info(
            name,
            "time at which it has run 30 mm, us",
            time * 1e6,
        ));
        match reference {
            None => reference = Some(([lower, upper], summary.total_seconds)),
            Some((angles, seconds)) => {
                let off = (lower - angles[0]).abs().max((upper - angles[1]).abs());
                table.push(TableRow::at_most(
                    name,
                    "angle against full PD, degrees",
                    off,
                    4.0,
                ));
                table.push(TableRow::info(
                    name,
                    "total time of full PD over coupled",
                    seconds / summary.total_seconds,
                ));
            }
        }
    }
    Ok(vec![table])
}
