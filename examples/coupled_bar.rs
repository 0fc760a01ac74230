//! The coupled bar of [SAND2015-7998] section 7.3: finite elements | transition | peridynamics | transition | finite elements, pulled at its ends.
//!
//! In one dimension every coupling gives the straight line to round-off. In three, the bar with free sides shows the surface effect of peridynamics,
//! and the same bar with its peridynamic zone enclosed sideways shows that the seam adds nothing.
//!
//! ```sh
//! cargo run --release --example coupled_bar
//! cargo run --release --example coupled_bar -- --set coupling=splice --set peridynamics.horizon=0.025
//! cargo run --release --example coupled_bar -- --json --output out --figures docs/figures
//! ```

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use bondline::model::Zone;
use bondline::observe::report::{Columns, Format, Table, TableRow, exit_code, render};
use bondline_terminal::progress::TerminalProgress;
use bondline_verify::bar::{self, Bar, ENCLOSED, EXACT, METHODS, PLANE_MEANS, Write};
use bondline_verify::variable_horizon;
use clap::Parser;

const ABOUT: &str = "A bar of finite elements with a peridynamic middle, pulled at its two ends; the answer is the straight line u = 1e-3 x.";

#[derive(Parser)]
#[command(about = ABOUT)]
struct Arguments {
    /// Set a key of the scene in one dimension; with a coupling among them, only that one is run.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Print all rows as one JSON array.
    #[arg(long)]
    json: bool,
    /// Write a VTU and a CSV line for each bar into this folder.
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Draw the figures of docs/bars.md into this folder.
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(tables) => {
            let format = if arguments.json {
                Format::Json
            } else {
                println!("{ABOUT}\n");
                Format::Text
            };
            print!("{}", render(&tables, format));
            ExitCode::from(exit_code(&tables))
        }
        Err(report) => {
            eprintln!("{report:?}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> miette::Result<Vec<Table>> {
    let mut line = Table::new(
        "1D, half of the length peridynamic, delta = 3h",
        Columns::Full,
    );
    let chosen = |o: &String| o.starts_with("coupling");
    if arguments.overrides.iter().any(chosen) {
        let bar = solve(arguments, "coupled_bar", "line", &[])?;
        line.rows.extend(rows_1d(&bar.summary.coupling, &bar, true));
    } else {
        let single = [
            ("finite elements alone", &["coupling=local"] as &[&str]),
            ("peridynamics alone", &["coupling=nonlocal"]),
        ];
        for (method, choice) in METHODS.into_iter().chain(single) {
            let bar = solve(arguments, "coupled_bar", method, choice)?;
            let exact = method != "peridynamics alone";
            line.rows.extend(rows_1d(method, &bar, exact));
        }
    }

    let mut solid = Table::new(
        "3D, LPS, partial stress in finite elements, delta = 2h",
        Columns::Full,
    );
    let free = solve(arguments, "coupled_bar_3d", "free sides", &[])?;
    solid.rows.extend(rows_3d("free sides", &free, false));
    let enclosed = solve(arguments, "coupled_bar_3d", "enclosed", ENCLOSED)?;
    solid
        .rows
        .extend(rows_3d("enclosed sideways", &enclosed, true));

    if let Some(folder) = &arguments.figures {
        let progress = TerminalProgress::on_stderr();
        bar::figures(folder, &progress).map_err(|e| miette::miette!("{e}"))?;
        variable_horizon::figures(folder, &progress).map_err(|e| miette::miette!("{e}"))?;
    }
    Ok(vec![line, solid])
}

fn solve(arguments: &Arguments, scene: &str, name: &str, choice: &[&str]) -> miette::Result<Bar> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .join(format!("examples/{scene}.toml"));
    let mut overrides: Vec<String> = choice.iter().map(|&o| o.to_owned()).collect();
    if scene == "coupled_bar" {
        overrides.extend(arguments.overrides.iter().cloned());
    }
    let name = name.replace([' ', ','], "_").replace("__", "_");
    overrides.push(format!("output.name=\"{scene}_{name}\""));
    let mut scene = bondline_study::load(&path, &overrides).map_err(bondline_terminal::report)?;
    let write = match &arguments.output {
        Some(folder) => {
            scene.set_output_directory(folder.clone());
            Write::Outputs
        }
        None => Write::Nothing,
    };
    bar::solve_and(scene, write, &TerminalProgress::on_stderr()).map_err(|e| miette::miette!("{e}"))
}

fn rows_1d(case: &str, bar: &Bar, exact: bool) -> Vec<TableRow> {
    let error = "largest distance from the straight line, of the largest displacement";
    let value = bar.pointwise(|_| true);
    let first = if exact {
        TableRow::at_most(case, error, value, EXACT)
    } else {
        TableRow::info(case, error, value)
            .because("bonds are missing at the two ends of the bar: a surface effect of peridynamics, not of a seam")
    };
    let mut rows = vec![first];
    rows.extend(common(case, bar));
    rows
}

fn rows_3d(case: &str, bar: &Bar, exact: bool) -> Vec<TableRow> {
    let all = |_| true;
    let means = "plane means: distance from the straight line";
    let mut rows = vec![TableRow::at_most(
        case,
        means,
        bar.plane_means(all),
        PLANE_MEANS,
    )];
    let sites = "every site: distance from the straight line";
    rows.push(if exact {
        TableRow::at_most(case, sites, bar.pointwise(all), EXACT)
    } else {
        TableRow::info(case, sites, bar.pointwise(all))
            .because("bonds are missing at the free sides: a surface effect of peridynamics, which the enclosed bar does not have")
    });
    for zone in [Zone::Local, Zone::Transition, Zone::Nonlocal] {
        let name = bar::model_name(zone);
        let of = |z| z == zone;
        rows.push(TableRow::info(
            case,
            format!("{name}: plane means"),
            bar.plane_means(of),
        ));
        rows.push(TableRow::info(
            case,
            format!("{name}: every site"),
            bar.pointwise(of),
        ));
    }
    if let Some(pull) = bar.pull {
        rows.push(TableRow::info(case, "pulling force / (E A u')", pull).with_reference(1.0));
    }
    rows.extend(common(case, bar));
    rows
}

fn common(case: &str, bar: &Bar) -> Vec<TableRow> {
    let summary = &bar.summary;
    vec![
        TableRow::info(
            case,
            "out-of-balance force, of the applied force",
            summary.out_of_balance_relative,
        )
        .with_reference(0.0),
        TableRow::info(case, "bonds", summary.sizes.bonds as f64),
        TableRow::info(case, "sites", summary.sizes.sites as f64),
    ]
}
