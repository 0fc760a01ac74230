//! The command line: arguments to a scene, its run, a report and an exit status. The program and the Python package call it.

mod command;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use bondline::observe::checkpoint::Pace;
use bondline::observe::provenance::Program;
use bondline::observe::report as tables;
use bondline::observe::summary::Ended;
use bondline::observe::warning::Code;
use bondline::progress::Silent;
use bondline::run::{AnyScene, RunOptions, StartFrom};
use bondline::scene::{self, Template};
use bondline::system::Ranks;
use bondline_study::pareto::{self, CostBy, Reference, TradeEnd, TradeParams};
use bondline_study::{CheckError, ConvergeError, ConvergeParams, Prediction, Refinement};
use bondline_terminal::memory;
use bondline_terminal::{Processes, TerminalProgress, print, refuse_several, report, tell};
use clap::builder::PossibleValuesParser;
use clap::{Parser, Subcommand, ValueEnum};

use command::fields;
use command::help::{EXAMPLES, TRADE};
use command::interrupt::{self, INTERRUPTED};
use command::threads::{self, Oversubscribe};
use command::verify;

/// Commit that this package was built from, `-modified` where its clone had changes; none where it was not built from a clone.
pub const COMMIT: Option<&str> = option_env!("BONDLINE_COMMIT");

/// Version, and the commit where it is known.
const VERSION: &str = env!("BONDLINE_VERSION");

/// Exit status of success.
const DONE: u8 = 0;
/// Exit status of a wrong or impossible request.
const WRONG: u8 = 1;
/// Exit status of a run that stopped where damage reached the edge of the nonlocal zone.
const AT_EDGE: u8 = 3;

/// Couples classical finite elements to meshfree peridynamics.
#[derive(Parser)]
#[command(name = "bondline", version = VERSION, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Solve a scene and write its results.
    #[command(
        after_help = "Any key of the scene can be set: --set mesh.rectangle.x.cells=240, --set coupling=local, \
                            --set 'conditions.top.displacement.y=\"1e-3*x\"'. A choice that differs replaces the whole table.\n\n\
                            Exit status: 0 done, 1 wrong, impossible, or with a warning that the scene denies, 2 wrong arguments, 3 stopped at a limit (damage at the edge of the nonlocal zone, energy gained without work, rotation), 4 memory exhausted, 130 interrupted."
    )]
    Run {
        #[command(flatten)]
        scene: SceneArguments,
        /// Print the summary as JSON.
        #[arg(long)]
        json: bool,
        /// Folder for all files, instead of the scene's.
        #[arg(long, value_name = "DIR")]
        output: Option<PathBuf>,
        /// Number of threads; all cores if left out.
        #[arg(long, value_name = "N")]
        threads: Option<usize>,
        /// Start more than four threads per core, if --threads says so.
        #[arg(long)]
        oversubscribe: bool,
        /// Write a checkpoint after so many steps, or so much time: 1000, 30s, 10min, 2h.
        #[arg(long, value_name = "PACE")]
        checkpoint_every: Option<Pace>,
        /// Go on from the last checkpoint in the output folder; from the beginning if there is none yet.
        #[arg(long)]
        resume: bool,
    },
    /// Validate a scene and predict its size, memory, time and error, without solving it.
    Check {
        #[command(flatten)]
        scene: SceneArguments,
        /// Seconds that runs with other spacings may take, which the error is predicted from; by default a second, or 0.15 of the predicted time.
        #[arg(long, value_name = "SECONDS", value_parser = seconds)]
        pilots: Option<f64>,
        /// Tell what each of so many processes would have: sites, ghosts, memory.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
        processes: Option<u32>,
        /// Print the prediction as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Solve a scene at several refinements; prints observed orders, writes them as a plot and a table.
    Converge {
        #[command(flatten)]
        scene: SceneArguments,
        /// Lengths that shrink from level to level: horizon, spacing, or both.
        #[arg(long, value_enum, default_value = "delta")]
        kind: RefinementName,
        /// Number of levels, the scene itself the first.
        #[arg(long, value_name = "N", default_value_t = 3)]
        levels: usize,
        /// Factor by which they shrink from level to level.
        #[arg(long, value_name = "R", default_value_t = 2.0)]
        factor: f64,
        /// Folder for SCENE-KIND.svg and SCENE-KIND.csv, instead of the current one.
        #[arg(long, value_name = "DIR", default_value = ".")]
        output: PathBuf,
        /// Print the rows as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Write a commented scene to start from; never overwrites.
    New {
        /// The file to write.
        #[arg(default_value = "scene.toml")]
        path: PathBuf,
        /// Template of the new scene.
        #[arg(long, value_enum, default_value = "plate")]
        template: TemplateName,
    },
    /// Print the JSON Schema of scenes, for editors.
    Schema,
    /// List the fields of a solution that files and tables have, with their units and the keys that ask for them.
    Fields,
    /// Explain a code of a warning: its cause, the meaning of its number, and what helps.
    Explain {
        /// The code, as messages have it: W32.
        code: Code,
    },
    /// Run a scene with its knobs turned, and show the cost of speed in accuracy.
    #[command(after_help = TRADE)]
    Trade(TradeArguments),
    /// Measure the claims of the code, as tables with limits; the exit status is 1 if any row is short.
    #[command(disable_help_flag = true)]
    Verify {
        /// Arguments of the program bondline-verify; --help prints them.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<OsString>,
    },
}

impl Command {
    /// The most memory to use, if it is typed.
    fn memory(&self) -> Option<u64> {
        match self {
            Self::Run { scene, .. } | Self::Check { scene, .. } | Self::Converge { scene, .. } => {
                scene.memory
            }
            Self::Trade(arguments) => arguments.scene.memory,
            Self::New { .. }
            | Self::Schema
            | Self::Fields
            | Self::Explain { .. }
            | Self::Verify { .. } => None,
        }
    }
}

#[derive(clap::Args)]
struct SceneArguments {
    /// The scene, a TOML file.
    scene: PathBuf,
    /// Set a key of the scene; the value is TOML, or else text.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// The most memory to use: 500MB, 4GiB; what is free if left out.
    #[arg(long, value_name = "SIZE", value_parser = memory::size)]
    memory: Option<u64>,
}

#[derive(clap::Args)]
struct TradeArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Knobs to turn, and no others; all that apply if left out.
    #[arg(long = "knob", value_name = "NAME", value_delimiter = ',', value_parser = PossibleValuesParser::new(pareto::KNOBS))]
    knobs: Vec<String>,
    /// A key of the scene with other values: 'solver.tolerance=[1e-4, 1e-8]'.
    #[arg(long, value_name = "KEY=[...]", value_parser = pareto::typed)]
    vary: Vec<pareto::Knob>,
    /// A relative error that is wanted, of a quantity or of those that suit the outputs: probe:tip.u=1%, reaction=2%, 1%. May be given several times.
    #[arg(
        long = "want",
        value_name = "QUANTITY=ERROR",
        value_delimiter = ',',
        value_parser = pareto::Want::parse,
        default_value = "1%"
    )]
    wants: Vec<pareto::Want>,
    /// Reference of the comparison: full-pd (peridynamics everywhere), fe (elements alone, half as large, or those of a mesh file of second order), finer (half the horizon and spacing; half the spacing where cracks run), or another scene file. If left out full-pd where bonds break in time, fe where nothing breaks on the mesh of a file, else finer.
    #[arg(long, value_name = "NAME|FILE", value_parser = reference)]
    reference: Option<Reference>,
    /// A key of the reference, instead of --reference.
    #[arg(
        long = "reference-set",
        value_name = "KEY=VALUE",
        conflicts_with = "reference"
    )]
    reference_keys: Vec<String>,
    /// Measure of the cost of a case.
    #[arg(long, value_enum, default_value = "time")]
    cost: CostName,
    /// Time for all cases together: 90s, 10min, 2h.
    #[arg(long, value_name = "TIME", default_value = "10min")]
    budget: Pace,
    /// Folder for tables, plot and scenes; out/trade/SCENE if left out.
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print the path of each file that was written, and nothing else.
    #[arg(long)]
    quiet: bool,
}

/// The reference of a trade, as typed.
fn reference(text: &str) -> Result<Reference, String> {
    match text {
        "full-pd" => Ok(Reference::FullPd),
        "fe" => Ok(Reference::Elements),
        "finer" => Ok(Reference::Finer),
        path if path.ends_with(".toml") => Ok(Reference::Scene(PathBuf::from(path))),
        _ => Err(
            "possible values: full-pd, fe, finer, or a scene file, whose name ends with .toml"
                .to_owned(),
        ),
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum CostName {
    /// Seconds.
    Time,
    /// The most memory held.
    Memory,
    /// Bonds times steps: without noise.
    BondVisits,
}

#[derive(Clone, Copy, ValueEnum)]
enum RefinementName {
    /// Horizon and spacing together; delta/h stays.
    Delta,
    /// The spacing under a fixed horizon.
    M,
    /// The spacing by the factor, the horizon by its square root.
    DeltaM,
}

impl From<RefinementName> for Refinement {
    fn from(name: RefinementName) -> Self {
        match name {
            RefinementName::Delta => Self::Delta,
            RefinementName::M => Self::M,
            RefinementName::DeltaM => Self::DeltaM,
        }
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum TemplateName {
    /// A coupled bar in one dimension.
    Bar,
    /// A plate with a slit, on a generated mesh.
    Plate,
    /// A plate on a mesh from a file.
    File,
    /// A crack that runs and branches, in explicit dynamics.
    Dynamics,
    /// A crack that is opened in load steps.
    LoadSteps,
}

/// Carries out the command of the arguments, and returns the exit status; the first one is the name of the program.
///
/// `program` starts this command line once more: studies run their scenes in programs of their own.
pub fn command(
    program: std::io::Result<PathBuf>,
    arguments: impl IntoIterator<Item = OsString>,
) -> u8 {
    #[cfg(feature = "umat")]
    bondline_umat::register();
    let parsed = match Arguments::try_parse_from(arguments) {
        Ok(parsed) => parsed,
        // help and the version are printed in the same way
        Err(told) => {
            return match told.print() {
                Ok(()) => u8::try_from(told.exit_code()).unwrap_or(WRONG),
                Err(_) => WRONG,
            };
        }
    };
    match execute(parsed.command, program) {
        Ok(code) => code,
        Err(report) => {
            tell(format_args!("{report:?}"));
            WRONG
        }
    }
}

/// A time that something may take.
fn seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if seconds > 0.0 && f64::is_finite(seconds) => Ok(seconds),
        _ => Err("seconds are a number above zero".to_owned()),
    }
}

/// Runs a scene and prints its summary.
fn run(
    scene: SceneArguments,
    json: bool,
    output: Option<PathBuf>,
    (threads, oversubscribe): (Option<usize>, bool),
    checkpoint_every: Option<Pace>,
    resume: bool,
    ranks: Option<&dyn Ranks>,
) -> miette::Result<u8> {
    let oversubscribe = match oversubscribe {
        true => Oversubscribe::Allowed,
        false => Oversubscribe::Refused,
    };
    threads::start(threads, oversubscribe)?;
    let mut scene = load(&scene)?;
    if let Some(directory) = output {
        scene.set_output_directory(directory);
    }
    if !scene.moves() && (resume || checkpoint_every.is_some()) {
        return Err(miette::miette!(
            "a static scene has no checkpoints: leave out --resume and --checkpoint-every, or add [solve.explicit]"
        ));
    }
    // several processes would not hear of a signal in the same step
    let listens = scene.moves() && ranks.is_none();
    let interrupt = listens.then(interrupt::listen).transpose()?;
    let options = RunOptions {
        start: if resume {
            StartFrom::Checkpoint
        } else {
            StartFrom::Beginning
        },
        checkpoint_every,
        interrupt: interrupt.map(|i| &i.asked),
        heeds: interrupt.map(|i| &i.heeded),
        observer: None,
        ranks,
        program: Some(Program { commit: COMMIT }),
    };
    let is_first = ranks.is_none_or(|ranks| ranks.rank() == 0);
    let summary = match ranks {
        None => threads::on_one(|| scene.run_with(&options, &TerminalProgress::on_stderr())),
        Some(_) if is_first => scene.run_with(&options, &TerminalProgress::on_stderr()),
        Some(_) => scene.run_with(&options, &Silent),
    };
    let summary = summary.map_err(|e| miette::miette!("{e}"))?;
    let code = match summary.motion.as_ref().map(|m| m.ended) {
        None | Some(Ended::Finished | Ended::Parted) => DONE,
        Some(Ended::DamageAtEdge | Ended::EnergyGained | Ended::ElementsRotated) => AT_EDGE,
        Some(Ended::Interrupted) => INTERRUPTED,
    };
    let is_denied = summary.warnings.iter().any(|warning| warning.denied);
    match (is_first, json) {
        (false, _) => {}
        (true, true) => print(summary.json().map_err(|e| miette::miette!("{e}"))?)?,
        (true, false) => print(&summary)?,
    }
    // a run that stopped has its own status
    Ok(if is_denied && code == DONE {
        WRONG
    } else {
        code
    })
}

/// Predicts a run, and the part of it that each of several processes would have.
fn check(
    scene: &SceneArguments,
    pilots: Option<f64>,
    processes: Option<u32>,
) -> miette::Result<Prediction> {
    let told = |e| match e {
        CheckError::Scene(e) => report(*e),
        CheckError::Run(e) => miette::miette!("{e}"),
    };
    let progress = TerminalProgress::on_stderr();
    let found = threads::on_one(|| {
        bondline_study::check(&scene.scene, &scene.overrides, pilots, &progress)
    });
    let mut prediction = found.map_err(told)?;
    if let Some(count) = processes {
        // lays the model out even where a check alone would count it from volumes
        let partitioner = Processes::of_prediction();
        let count = (count as usize, partitioner.ranks());
        let (path, overrides) = (&scene.scene, &scene.overrides);
        let added =
            bondline_study::add_processes(&mut prediction, path, overrides, count, &progress);
        partitioner.end(Ok(0), WRONG)?;
        added.map_err(told)?;
    }
    Ok(prediction)
}

/// Runs a scene with finer and finer meshes, and prints, writes and plots the differences.
fn converge(
    scene: &SceneArguments,
    refinement: Refinement,
    (levels, factor): (usize, f64),
    output: &Path,
    json: bool,
) -> miette::Result<()> {
    let params = ConvergeParams {
        refinement,
        levels,
        factor,
    };
    let progress = TerminalProgress::on_stderr();
    let found = threads::on_one(|| {
        bondline_study::converge(&scene.scene, &scene.overrides, &params, &progress)
    });
    let found = found.map_err(|e| match e {
        ConvergeError::Scene(e) => report(*e),
        other => miette::miette!("{other}"),
    })?;
    let format = if json {
        tables::Format::Json
    } else {
        tables::Format::Text
    };
    print(tables::render(&[found.table()], format).trim_end())?;
    let stem = scene.scene.file_stem().unwrap_or_default();
    let name = format!("{}-{}", stem.to_string_lossy(), found.refinement.name());
    let csv = output.join(format!("{name}.csv"));
    found.write_csv(&csv).map_err(|e| miette::miette!("{e}"))?;
    tell(format_args!("wrote {}", csv.display()));
    // levels that agree to round-off leave nothing to plot on logarithmic axes
    if found.orders().iter().any(Option::is_some) {
        let svg = output.join(format!("{name}.svg"));
        found
            .plot()
            .write(&svg)
            .map_err(|e| miette::miette!("{e}"))?;
        tell(format_args!("wrote {}", svg.display()));
    }
    Ok(())
}

/// Carries out a command.
fn execute(command: Command, program: std::io::Result<PathBuf>) -> miette::Result<u8> {
    memory::limit(command.memory());
    // these have several processes, or refuse them
    if !matches!(command, Command::Run { .. } | Command::Verify { .. }) {
        refuse_several()?;
    }
    match command {
        Command::Run {
            scene,
            json,
            output,
            threads,
            oversubscribe,
            checkpoint_every,
            resume,
        } => {
            let processes = Processes::start()?;
            let result = run(
                scene,
                json,
                output,
                (threads, oversubscribe),
                checkpoint_every,
                resume,
                processes.ranks(),
            );
            return processes.end(result, WRONG);
        }
        Command::Check {
            scene,
            pilots,
            processes,
            json,
        } => {
            let prediction = check(&scene, pilots, processes)?;
            if json {
                let text = serde_json::to_string_pretty(&prediction);
                print(text.map_err(|e| miette::miette!("{e}"))?)?;
            } else {
                print(prediction)?;
            }
        }
        Command::Converge {
            scene,
            kind,
            levels,
            factor,
            output,
            json,
        } => converge(&scene, kind.into(), (levels, factor), &output, json)?,
        Command::New { path, template } => {
            let template = match template {
                TemplateName::Bar => Template::Bar,
                TemplateName::Plate => Template::Plate,
                TemplateName::File => Template::File,
                TemplateName::Dynamics => Template::Dynamics,
                TemplateName::LoadSteps => Template::LoadSteps,
            };
            template.write(&path).map_err(report)?;
            print(format_args!(
                "wrote {}; solve it with: bondline run {}",
                path.display(),
                path.display()
            ))?;
        }
        Command::Schema => {
            let text = serde_json::to_string_pretty(&scene::schema());
            print(text.map_err(|e| miette::miette!("{e}"))?)?;
        }
        Command::Fields => print(fields::table())?,
        Command::Explain { code } => print(format_args!(
            "{code} {}\n\n{}",
            code.title(),
            code.explanation()
        ))?,
        Command::Trade(arguments) => return traded(arguments, program),
        Command::Verify { arguments } => return verify::start(program, &arguments),
    }
    Ok(DONE)
}

fn traded(arguments: TradeArguments, program: std::io::Result<PathBuf>) -> miette::Result<u8> {
    // an error in the scene is shown where it stands
    load(&arguments.scene)?;
    let Pace::Clock(budget) = arguments.budget else {
        return Err(miette::miette!(
            "--budget is a time: write 90s, 10min or 2h"
        ));
    };
    let stem = arguments.scene.scene.file_stem().unwrap_or_default();
    let params = TradeParams {
        output: arguments
            .output
            .unwrap_or_else(|| PathBuf::from("out/trade").join(stem)),
        scene: arguments.scene.scene,
        overrides: arguments.scene.overrides,
        knobs: arguments.knobs,
        vary: arguments.vary,
        wants: arguments.wants,
        reference: match arguments.reference {
            Some(reference) => reference,
            None if arguments.reference_keys.is_empty() => Reference::Auto,
            None => Reference::Keys(arguments.reference_keys),
        },
        cost: match arguments.cost {
            CostName::Time => CostBy::Time,
            CostName::Memory => CostBy::Memory,
            CostName::BondVisits => CostBy::BondVisits,
        },
        budget,
    };
    let program = program.map_err(|e| miette::miette!("cannot find this program: {e}"))?;
    let interrupt = interrupt::listen()?;
    interrupt.heeded.store(true, Ordering::Relaxed);
    let found = pareto::trade(
        &params,
        &program,
        Some(&interrupt.asked),
        &TerminalProgress::on_stderr(),
    )
    .map_err(|e| miette::miette!("{e}"))?;
    let files = found.write(&params).map_err(|e| miette::miette!("{e}"))?;
    if !arguments.quiet {
        print(&found)?;
    }
    for file in files {
        print(file.display())?;
    }
    Ok(if found.ended == TradeEnd::Interrupted {
        INTERRUPTED
    } else {
        DONE
    })
}

fn load(arguments: &SceneArguments) -> miette::Result<AnyScene> {
    bondline_study::load(&arguments.scene, &arguments.overrides).map_err(report)
}
