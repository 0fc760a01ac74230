//! Scenes in time and under a load that grows: the dynamic system, its loads, and the output during a run.
//!
//! | file | what |
//! |---|---|
//! | `setup.rs` | set-up of every run |
//! | `load_stage.rs` | load steps before a motion |
//! | `breaks.rs` | possibility that bonds break |
//! | `dynamic_system.rs` | the dynamic system, its masses, its initial state |
//! | `sharing.rs` | distribution of it over several processes |
//! | `time_dependent_loads.rs` | loads and prescribed motion as functions of time |
//! | `explicit.rs` | the run in time |
//! | `initial_state.rs` | initial state of its steps: at the start, at a checkpoint, after a change of the zone |
//! | `step_observer.rs` | observation of each step, and output |
//! | `field_output.rs` | fields of a moment, as output files and probes show them |
//! | `quasi_static.rs`, `inside_step.rs`, `doubtful_equilibria.rs` | the run under a load that grows; progress within a step; doubts about its equilibria |
//! | `newton_factors.rs`, `spread_factors.rs` | the factors or multigrid that precondition it, of one process or of several |
//! | `time_step.rs` | the time step, with sub-cycling |
//! | `contact.rs` | contact of surfaces, and its record |
//! | `impact.rs`, `driven_impactors.rs`, `impact_record.rs` | rigid impactors: contact, prescribed motion, record |
//! | `end_of_steps.rs` | energies and cracks at the end |
//! | `way.rs` | the displacement by a prescribed velocity |
//! | `guard.rs`, `seen.rs` | monitoring of energy, rotation of elements and strains |
//! | `zone_monitor.rs`, `bounding_boxes.rs` | cells wanted in a zone that follows the crack |
//! | `rezoning.rs` | transfer of the state over a change of the zone, and its cost in energy |
//! | `supports.rs` | supports of the body: forces and displacements of conditions |
//! | `probe_rows.rs`, `section_rows.rs` | columns of the history for probes, and for sections through the body |
//! | `material_stretches.rs` | the stretch at which bonds of each material break |
//! | `crack_growth.rs`, `created_energy.rs`, `parted.rs` | growth of cracks within a load step; energy that load steps set free or created; the end where a body has parted |
//! | `tables.rs` | tables beside the history: tips of cracks, states along lines |
//! | `tips.rs` | position of a crack tip |
//! | `writer.rs` | history, VTU files, tips of cracks, checkpoints |
//! | `saved.rs` | content of a checkpoint |

pub(crate) mod bounding_boxes;
pub mod breaks;
pub(crate) mod contact;
mod crack_growth;
mod created_energy;
mod doubtful_equilibria;
pub(crate) mod driven_impactors;
pub mod dynamic_system;
mod end_of_steps;
pub mod explicit;
mod field_output;
pub(crate) mod guard;
pub(crate) mod impact;
pub(crate) mod impact_record;
pub(crate) mod initial_state;
mod inside_step;
pub(crate) mod load_stage;
mod load_step_params;
mod material_stretches;
mod newton_factors;
mod parted;
mod probe_rows;
pub mod quasi_static;
pub(crate) mod rezoning;
pub mod saved;
mod section_rows;
pub(crate) mod seen;
pub mod setup;
mod sharing;
mod spread_factors;
pub(crate) mod step_observer;
mod supports;
mod tables;
pub mod time_dependent_loads;
pub mod time_step;
mod tips;
mod way;
pub mod writer;
pub(crate) mod zone_monitor;

pub(crate) use sharing::{Sharing, holders_at_rest, may_share, may_share_rows, moves_own_sites};

use std::sync::atomic::{AtomicBool, Ordering};

use crate::observe::checkpoint::Pace;
use crate::observe::csv::{CsvTable, Entry};
use crate::observe::provenance::Program;
use crate::observe::summary::RunSummary;
use crate::observe::{ObserveError, Observer};
use crate::progress::Progress;
use crate::run::error::RunError;
use crate::scene::solve::Solve;
use crate::scene::validated::Scene;
use crate::system::Ranks;

/// Start of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StartFrom {
    /// The beginning; files of an earlier run go.
    #[default]
    Beginning,
    /// The last checkpoint in the output folder; the beginning if there is none yet.
    Checkpoint,
}

/// Options of the caller of a run, beside the scene. None of them changes a result.
#[derive(Clone, Copy, Debug, Default)]
pub struct RunOptions<'a> {
    /// Start of the run.
    pub start: StartFrom,
    /// Interval between checkpoints, instead of that of the scene.
    pub checkpoint_every: Option<Pace>,
    /// Set by another thread to end the run with a checkpoint: of the step at hand, or, where load steps take long, of the last one.
    pub interrupt: Option<&'a AtomicBool>,
    /// Set by the run from its first step on, when it looks at `interrupt`; before, ending the process loses nothing.
    pub heeds: Option<&'a AtomicBool>,
    /// Takes the results, and says whether they are written to files as well.
    pub observer: Option<&'a dyn Observer>,
    /// The processes that compute the run together, if there are several: all of them call the run, the first one writes files.
    pub ranks: Option<&'a dyn Ranks>,
    /// The program that runs the scene; beside the outputs of one lies the [provenance](crate::observe::provenance) of the run.
    pub program: Option<Program<'a>>,
}

impl<'a> RunOptions<'a> {
    /// Returns true if this process writes files.
    pub(crate) fn writes(&self) -> bool {
        self.ranks.is_none_or(|ranks| ranks.rank() == 0)
            && self.observer.is_none_or(Observer::wants_files)
    }

    /// The processes that each write a piece of a VTU file, if there are several.
    pub(crate) fn writers(&self) -> Option<&'a dyn Ranks> {
        let wanted = self.observer.is_none_or(Observer::wants_files);
        self.ranks.filter(|ranks| wanted && ranks.count() > 1)
    }

    /// Appends a row to a table, and shows it to the observer.
    fn keep(&self, name: &str, table: &mut CsvTable, row: &[Entry]) -> Result<(), ObserveError> {
        if let Some(observer) = self.observer {
            observer.row(name, table.header(), row);
        }
        match self.writes() {
            true => table.entries(row),
            false => Ok(()),
        }
    }

    /// Says that steps begin.
    fn begin_steps(&self) {
        if let Some(heeds) = self.heeds {
            heeds.store(true, Ordering::Relaxed);
        }
    }
}

/// The refusal of a static scene where one that moves is needed.
pub const STILL: RunError = RunError::Later {
    what: "a static scene does not move",
    remedy: "use AnyScene::run, which solves it",
};

/// Returns true if checkpoints are written by the clock.
fn paces_by_clock(solve: &Solve, options: &RunOptions<'_>) -> bool {
    let typed = match solve {
        Solve::Explicit(spec) => spec.checkpoint_every,
        Solve::QuasiStatic(spec) => spec.checkpoint_every,
        Solve::Static => None,
    };
    let pace = options.checkpoint_every.or(typed);
    matches!(pace, Some(Pace::Clock(_)))
}

/// Refuses a scene in stages, which no more than one process runs.
///
/// # Errors
/// [`RunError::LoadStageShared`].
pub(crate) fn has_one_stage<const D: usize>(scene: &Scene<D>) -> Result<(), RunError> {
    match &scene.before {
        None => Ok(()),
        Some(stage) => Err(RunError::LoadStageShared {
            stage: stage.name.clone(),
        }),
    }
}

/// Runs a scene in time or under a load that grows.
pub(crate) fn run<const D: usize>(
    scene: Scene<D>,
    options: &RunOptions<'_>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    if options.ranks.is_some() && paces_by_clock(&scene.solve, options) {
        return Err(RunError::Later {
            what: "checkpoints by the clock in a run of several processes, which would not write them in the same step",
            remedy: "count steps instead: checkpoint-every = 1000",
        });
    }
    if options.ranks.is_some() {
        has_one_stage(&scene)?;
    }
    match scene.solve.clone() {
        Solve::Explicit(solve) => explicit::run(scene, &solve, options, progress),
        Solve::QuasiStatic(solve) => quasi_static::run(scene, &solve, options, progress),
        Solve::Static => Err(STILL),
    }
}
