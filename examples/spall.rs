//! Spall after SAND2015-7998 section 2.6: do coupled bars break where and when full peridynamics does, and does the free surface show the same pullback?
//!
//!     cargo run --release --example spall
//!     cargo run --release --example spall -- --figures docs/figures
//!     cargo run --release --example spall -- --output out/spall --json

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use bondline::observe::report::{self, Table, TableRow};
use bondline_study::line_plot::{LinePlot, Series, Stroke};
use shared::{Columns, Failure, argument, at, between, run, running_mean};

mod shared;

const IMPACT: f64 = 0.1;

/// A way to model the bar.
struct Variant {
    name: &'static str,
    overrides: &'static [&'static str],
}

const VARIANTS: &[Variant] = &[
    Variant {
        name: "full PD",
        overrides: &["coupling=nonlocal"],
    },
    Variant {
        name: "splice 37-43",
        overrides: &[],
    },
    Variant {
        name: "splice 35-45",
        overrides: &["zones.nonlocal.box={min=35,max=45}"],
    },
    Variant {
        name: "partial stress 37-43",
        overrides: &[
            "coupling={partial-stress={form=\"meshfree\"}}",
            "zones.transition.around=4",
        ],
    },
    Variant {
        name: "partial stress 35-45",
        overrides: &[
            "coupling={partial-stress={form=\"meshfree\"}}",
            "zones.nonlocal.box={min=35,max=45}",
            "zones.transition.around=4",
        ],
    },
    Variant {
        name: "truncated 37-43",
        overrides: &["coupling=truncated"],
    },
];

fn main() -> ExitCode {
    shared::printed(tables())
}

/// Time and place of the first break, by the tips of the crack on both sides.
fn push_break(table: &mut Table, name: &str, [right, left]: &[Columns; 2]) -> Result<(), Failure> {
    let (time, place) = (right.column("time")?[0], right.column("x")?[0]);
    let left = left.column("x")?[0];
    table.push(between(name, "time of the first break", time, 60.2, 60.7));
    table.push(between(
        name,
        "its place, rightmost damaged point",
        place,
        39.6,
        40.4,
    ));
    table.push(between(
        name,
        "its place, leftmost damaged point",
        left,
        39.6,
        40.4,
    ));
    Ok(())
}

/// The velocity of the free surface: its plateau, its dip, and against full peridynamics.
fn push_surface(
    table: &mut Table,
    name: &str,
    mean: &[(f64, f64)],
    reference: Option<&[(f64, f64)]>,
) {
    let plateau: Vec<f64> = mean
        .iter()
        .filter(|p| p.0 > 48.0 && p.0 < 78.0)
        .map(|p| p.1)
        .collect();
    let level = plateau.iter().sum::<f64>() / plateau.len() as f64;
    table.push(between(
        name,
        "plateau of the free surface, mean of t = 48 to 78",
        level,
        0.0995,
        0.1005,
    ));
    let dip = mean
        .iter()
        .filter(|p| p.0 > 70.0 && p.0 < 90.0)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .copied()
        .unwrap_or_default();
    table.push(between(name, "time of the pullback dip", dip.0, 79.5, 82.0));
    table.push(TableRow::info(
        name,
        "depth of the dip, running mean over 1.2",
        level - dip.1,
    ));
    if let Some(reference) = reference {
        let worst = mean
            .iter()
            .filter(|p| !(39.0..45.0).contains(&p.0) && !(79.0..90.0).contains(&p.0))
            .map(|p| (p.1 - at(reference, p.0)).abs() / IMPACT)
            .fold(0.0, f64::max);
        table.push(TableRow::at_most(
            name,
            "surface velocity against full PD, relative to the impact, running mean over 1.2",
            worst,
            0.02,
        ));
    }
}

/// Draws figures 2.2 and 2.4.
fn write_figures(
    folder: &Path,
    histories: Vec<Series>,
    profiles: Vec<Series>,
) -> Result<(), Failure> {
    LinePlot {
        title: "Spall: velocity of the free surface (figure 2.4)".into(),
        x_label: "time".into(),
        y_label: "velocity".into(),
        series: histories,
        ..LinePlot::default()
    }
    .write(&folder.join("spall_surface.svg"))?;
    LinePlot {
        title: "Spall: velocity at t = 70 (figure 2.2)".into(),
        x_label: "x".into(),
        y_label: "velocity".into(),
        series: profiles,
        ..LinePlot::default()
    }
    .write(&folder.join("spall_profile.svg"))?;
    Ok(())
}

fn tables() -> Result<Vec<Table>, Failure> {
    let output = PathBuf::from(argument("--output").unwrap_or("out/spall".into()));
    let mut table = Table::new(
        "spall, SAND2015-7998 section 2.6",
        report::Columns::default(),
    );
    let mut reference: Option<Vec<(f64, f64)>> = None;
    let (mut histories, mut profiles) = (Vec::new(), Vec::new());
    for variant in VARIANTS {
        let mut overrides: Vec<String> =
            variant.overrides.iter().map(|s| (*s).to_owned()).collect();
        overrides.push("solve.explicit.outputs=1".into());
        overrides.push("output.tips.right={direction=[1],threshold=0.1}".into());
        overrides.push("output.tips.left={direction=[-1],threshold=0.1}".into());
        // a probe at each unit of length, for the velocity against x
        overrides.extend((0..=60).map(|x| format!("output.probes.x{x}={{at={x}}}")));
        let folder = variant.name.replace(' ', "_");
        run("spall.toml", &overrides, &output, &folder)?;
        let read =
            |end: &str| Columns::read(&output.join(&folder).join(format!("spall_{end}.csv")));
        let columns = read("history")?;
        let surface = columns.history("surface_vx")?;
        let mean = running_mean(&surface, 1.2);

        let crack = [read("tip_right")?, read("tip_left")?];
        push_break(&mut table, variant.name, &crack)?;
        let name = variant.name;
        push_surface(&mut table, name, &mean, reference.as_deref());
        reference.get_or_insert_with(|| mean.clone());
        let stroke = if histories.is_empty() {
            Stroke::Dashed
        } else {
            Stroke::Line
        };
        let profile = (0..=60)
            .map(|x| {
                Ok((
                    f64::from(x),
                    at(&columns.history(&format!("x{x}_vx"))?, 70.0),
                ))
            })
            .collect::<Result<Vec<_>, Failure>>()?;
        // the crack is a jump of velocity, both sides of it behind the release pulses at rest relative to each other
        let jump = at(&columns.history("x42_vx")?, 70.0) - at(&columns.history("x38_vx")?, 70.0);
        table.push(TableRow::info(
            name,
            "velocity at x = 42 less that at x = 38, t = 70",
            jump,
        ));
        histories.push(Series::new(
            name,
            stroke,
            surface.into_iter().filter(|p| p.0 > 35.0).collect(),
        ));
        profiles.push(Series::new(name, stroke, profile));
    }
    if let Some(folder) = argument("--figures") {
        write_figures(&PathBuf::from(folder), histories, profiles)?;
    }
    Ok(vec![table])
}
