//! The program that runs the suites; `bondline verify` starts it with the same arguments.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use bondline::observe::report::{Format, Table, exit_code, render};
use bondline::progress::{Progress, Silent};
use bondline::system::Ranks;
use bondline_terminal::memory::{self, Allocator};
use bondline_terminal::{Processes, TerminalProgress, print, tell};
use bondline_verify::figures::{FIGURES, figures};
use bondline_verify::report_page::{Outcome, page};
use bondline_verify::{Effort, LONG_SUITES, ON_PROCESSES, SUITES, Suite, suite};
use clap::Parser;
use clap::builder::{PossibleValue, PossibleValuesParser};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// Exit status of what is short, wrong or impossible.
const WRONG: u8 = 1;

/// Measure the claims of the code, as tables with limits; the exit status is 1 if any row is short.
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
    let arguments = Arguments::parse();
    let code = Processes::start().and_then(|processes| {
        let result = execute(&arguments, processes.ranks());
        processes.end(result, WRONG)
    });
    ExitCode::from(code.unwrap_or_else(|report| {
        tell(format_args!("{report:?}"));
        WRONG
    }))
}

/// Runs the suites, and gives the exit status. Of several processes the first tells of it.
fn execute(arguments: &Arguments, ranks: Option<&dyn Ranks>) -> miette::Result<u8> {
    memory::limit(None);
    let effort = if arguments.quick {
        Effort::Quick
    } else {
        Effort::Full
    };
    let chosen = chosen(arguments.name.as_deref(), ranks)?;
    let is_first = ranks.is_none_or(|ranks| ranks.rank() == 0);
    let progress: &dyn Progress = match is_first {
        true => &TerminalProgress::on_stderr(),
        false => &Silent,
    };
    let mut outcomes: Vec<Outcome> = Vec::new();
    for (suite, run) in chosen {
        let start = Instant::now();
        let tables = run(effort, progress);
        let seconds = start.elapsed().as_secs_f64();
        // at once: suites that follow may take an hour
        if is_first {
            tell(format_args!("{}: {seconds:.1} s", suite.name));
            if !arguments.json {
                if !outcomes.is_empty() {
                    print("")?;
                }
                print(render(&tables, Format::Text).trim_end())?;
            }
        }
        outcomes.push(Outcome {
            suite,
            tables,
            seconds,
        });
    }
    if is_first {
        write(arguments, effort, &outcomes, progress)?;
    }
    let tables: Vec<Table> = outcomes.into_iter().flat_map(|o| o.tables).collect();
    if arguments.json && is_first {
        print(render(&tables, Format::Json).trim_end())?;
    }
    Ok(exit_code(&tables))
}

/// A suite, and how it is run.
type Chosen<'a> = (
    &'static Suite,
    Box<dyn Fn(Effort, &dyn Progress) -> Vec<Table> + 'a>,
);

/// The suites that were asked for; of several processes one that these can run together.
fn chosen<'a>(name: Option<&str>, ranks: Option<&'a dyn Ranks>) -> miette::Result<Vec<Chosen<'a>>> {
    let named = name.and_then(suite);
    if ranks.is_none() {
        let suites: Vec<&Suite> = match named {
            None => SUITES.iter().collect(),
            Some(suite) => vec![suite],
        };
        // on one of the threads that compute: begun from another, each loop would put that to sleep and wake it again
        let on_one = |suite: &'static Suite| -> Chosen<'a> {
            let run =
                |effort, progress: &dyn Progress| rayon::scope(|_| (suite.run)(effort, progress));
            (suite, Box::new(run))
        };
        return Ok(suites.into_iter().map(on_one).collect());
    }
    let run = ON_PROCESSES.iter().find(|(n, _)| Some(*n) == name);
    match (named, run) {
        (Some(suite), Some((_, run))) => {
            let on_all = move |effort, progress: &dyn Progress| run(effort, progress, ranks);
            Ok(vec![(suite, Box::new(on_all))])
        }
        _ => Err(miette::miette!(
            help = "name one of these, or leave out mpirun",
            "several processes run one suite together, which is {}",
            ON_PROCESSES.map(|(n, _)| n).join(" or ")
        )),
    }
}

/// Writes the page and the figures that were asked for.
fn write(
    arguments: &Arguments,
    effort: Effort,
    outcomes: &[Outcome],
    progress: &dyn Progress,
) -> miette::Result<()> {
    let total: f64 = outcomes.iter().map(|o| o.seconds).sum();
    tell(format_args!("{} suite(s): {total:.1} s", outcomes.len()));
    if let Some(path) = &arguments.markdown {
        std::fs::write(path, page(outcomes, effort)).map_err(|e| {
            miette::miette!("cannot write {}: {e}; check the folder", path.display())
        })?;
        tell(format_args!("wrote {}", path.display()));
    }
    if let Some(folder) = &arguments.figures {
        draw(folder, outcomes, progress)?;
    }
    Ok(())
}

/// Draws the figures of the suites that were run.
fn draw(folder: &Path, outcomes: &[Outcome], progress: &dyn Progress) -> miette::Result<()> {
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
