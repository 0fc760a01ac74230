//! Shared code of the transient examples: runs a scene with some keys set otherwise, and reads its tables.

#![allow(dead_code)]

use std::path::Path;
use std::process::ExitCode;

use bondline::observe::{
    report::{Format, Table, TableRow, exit_code, render},
    summary::RunSummary,
};
use bondline_terminal::progress::TerminalProgress;

pub type Failure = Box<dyn std::error::Error>;

/// Prints tables, as JSON if the command line asks for it; what the program ends with.
pub fn printed(tables: Result<Vec<Table>, Failure>) -> ExitCode {
    match tables {
        Ok(tables) => {
            let format = if std::env::args().any(|a| a == "--json") {
                Format::Json
            } else {
                Format::Text
            };
            println!("{}", render(&tables, format).trim_end());
            ExitCode::from(exit_code(&tables))
        }
        Err(e) => {
            eprintln!("{e}");
            ExitCode::FAILURE
        }
    }
}

/// Columns of numbers with names, as `bondline run` writes them.
pub struct Columns {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Columns {
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
        let mut lines = text.lines();
        let names = lines
            .next()
            .unwrap_or_default()
            .split(',')
            .map(str::to_owned)
            .collect();
        let rows = lines
            .map(|line| line.split(',').map(str::parse).collect())
            .collect::<Result<_, _>>()?;
        Ok(Self { names, rows })
    }

    pub fn column(&self, name: &str) -> Result<Vec<f64>, Failure> {
        let k = self
            .names
            .iter()
            .position(|n| n == name)
            .ok_or_else(|| format!("no column {name} among {}", self.names.join(", ")))?;
        Ok(self.rows.iter().map(|row| row[k]).collect())
    }

    /// `(time, value)` of a column.
    pub fn history(&self, name: &str) -> Result<Vec<(f64, f64)>, Failure> {
        Ok(self
            .column("time")?
            .into_iter()
            .zip(self.column(name)?)
            .collect())
    }
}

/// Runs a scene of the folder `examples` with overrides; its files go to `output/name`.
pub fn run(
    scene: &str,
    overrides: &[String],
    output: &Path,
    name: &str,
) -> Result<RunSummary, Failure> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .join("examples")
        .join(scene);
    let mut scene = bondline_study::load(&path, overrides)
        .map_err(|e| format!("{:?}", bondline_terminal::report(e)))?;
    scene.set_output_directory(output.join(name));
    Ok(scene.run(&TerminalProgress::on_stderr())?)
}

/// A figure that must lie from `low` to `high`.
pub fn between(
    case: &str,
    quantity: impl Into<String>,
    value: f64,
    low: f64,
    high: f64,
) -> TableRow {
    let middle = 0.5 * (low + high);
    TableRow::within(
        case,
        quantity,
        value,
        middle,
        0.5 * (high - low) / middle.abs(),
    )
}

/// The value after a flag, if it was given.
pub fn argument(flag: &str) -> Option<String> {
    let arguments: Vec<String> = std::env::args().collect();
    let at = arguments.iter().position(|a| a == flag)?;
    arguments.get(at + 1).cloned()
}

/// Linear interpolation in a history.
pub fn at(history: &[(f64, f64)], time: f64) -> f64 {
    let k = history
        .partition_point(|p| p.0 < time)
        .clamp(1, history.len() - 1);
    let ((t0, v0), (t1, v1)) = (history[k - 1], history[k]);
    v0 + (v1 - v0) * (time - t0) / (t1 - t0)
}

/// Means over windows of `width` around each entry that has a whole one.
pub fn running_mean(history: &[(f64, f64)], width: f64) -> Vec<(f64, f64)> {
    let (first, last) = (history[0].0, history[history.len() - 1].0);
    history
        .iter()
        .filter(|p| p.0 - 0.5 * width >= first && p.0 + 0.5 * width <= last)
        .map(|&(time, _)| {
            let (a, b) = (
                history.partition_point(|p| p.0 < time - 0.5 * width),
                history.partition_point(|p| p.0 <= time + 0.5 * width),
            );
            (
                time,
                history[a..b].iter().map(|p| p.1).sum::<f64>() / (b - a) as f64,
            )
        })
        .collect()
}
