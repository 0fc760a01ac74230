//! The program that runs the suites; `bondline verify` starts it with the same arguments.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use bondline::observe::report::{Format, Table, exit_code, render};
use bondline_terminal::memory::{self, Allocator};
use bondline_terminal::{TerminalProgress, print, tell};
use bondline_verify::figures::{FIGURES, figures};
use bondline_verify::report_page::{Outcome, page};
use bondline_verify::{Effort, LONG_SUITES, SUITES, Suite, suite};
use clap::Parser;
use clap::builder::{PossibleValue, PossibleValuesParser};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// Measure what the code claims, as tables with limits; the exit status is 1 if any row is short.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// One suite; all of them if left out, but for those that take an hour.
    #[arg(value_parser = suites())]
    name: Option<String>,
    /// Print one JSON array of all rows.
    #[arg(long)]
    json: bool,
    /// Only a part, in less than three minutes.
    #[arg(long)]
    quick: bool,
    /// Also write the tables as a page in Markdown.
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Also draw the figures of the suites that have some, as SVG.
    #[arg(long, value_name = "FOLDER")]
    figures: Option<PathBuf>,
}

fn main() -> ExitCode {
    match execute(&Arguments::parse()) {
        Ok(code) => code,
        Err(report) => {
            tell(format_args!("{report:?}"));
            ExitCode::FAILURE
        }
    }
}

fn execute(arguments: &Arguments) -> miette::Result<ExitCode> {
    memory::limit(None);
    let effort = if arguments.quick {
        Effort::Quick
    } else {
        Effort::Full
    };
    let progress = TerminalProgress::on_stderr();
    let chosen: Vec<&'static Suite> = match &arguments.name {
        None => SUITES.iter().collect(),
        Some(name) => suite(name).into_iter().collect(),
    };
    let mut outcomes: Vec<Outcome> = Vec::new();
    for suite in chosen {
        let start = Instant::now();
        let tables = (suite.run)(effort, &progress);
        let seconds = start.elapsed().as_secs_f64();
        tell(format_args!("{}: {seconds:.1} s", suite.name));
        // at once: suites that follow may take an hour
        if !arguments.json {
            if !outcomes.is_empty() {
                print("")?;
            }
            print(render(&tables, Format::Text).trim_end())?;
        }
        outcomes.push(Outcome {
            suite,
            tables,
            seconds,
        });
    }
    let total: f64 = outcomes.iter().map(|o| o.seconds).sum();
    tell(format_args!("{} suite(s): {total:.1} s", outcomes.len()));
    if let Some(path) = &arguments.markdown {
        std::fs::write(path, page(&outcomes, effort)).map_err(|e| {
            miette::miette!("cannot write {}: {e}; check the folder", path.display())
        })?;
        tell(format_args!("wrote {}", path.display()));
    }
    if let Some(folder) = &arguments.figures {
        draw(folder, &outcomes, &progress)?;
    }
    let tables: Vec<Table> = outcomes.into_iter().flat_map(|o| o.tables).collect();
    if arguments.json {
        print(render(&tables, Format::Json).trim_end())?;
    }
    Ok(ExitCode::from(exit_code(&tables)))
}

/// Draws the figures of the suites that were run.
fn draw(folder: &Path, outcomes: &[Outcome], progress: &TerminalProgress) -> miette::Result<()> {
    let mut drawn = 0;
    for outcome in outcomes {
        let Some(draw) = figures(outcome.suite.name) else {
            continue;
        };
        for path in draw(folder, progress).map_err(|e| miette::miette!("{e}"))? {
            tell(format_args!("wrote {}", path.display()));
            drawn += 1;
        }
    }
    if drawn == 0 {
        let with: Vec<&str> = FIGURES.iter().map(|(name, _)| *name).collect();
        return Err(miette::miette!(
            "no suite that was run has figures; those of {} have some",
            with.join(", ")
        ));
    }
    Ok(())
}

fn suites() -> PossibleValuesParser {
    PossibleValuesParser::new(
        SUITES
            .iter()
            .chain(LONG_SUITES)
            .map(|s| PossibleValue::new(s.name).help(s.about)),
    )
}
