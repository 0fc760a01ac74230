//! Load steps before a motion, on the system of the motion: their last equilibrium is one of the same forces.
//!
//! Masses, contact and the shares of body forces at nodes are those of the motion throughout, so that a body that is left in peace stays at rest.

use super::RunOptions;
use super::quasi_static::{Loaded, load_steps};
use super::setup::{ModelSetup, opened};
use crate::observe::ObserveError;
use crate::observe::checkpoint::CheckpointFile;
use crate::observe::summary::{Decision, Ended, RunSummary, StageSummary};
use crate::progress::Progress;
use crate::run::error::RunError;
use crate::run::setup::RunSettings;
use crate::scene::load_stage::LoadStage;
use crate::scene::validated::Output;
use crate::solve::explicit::State;

/// Load steps before a motion.
pub(super) struct LoadSteps<'a, const D: usize> {
    stage: &'a LoadStage<D>,
    /// Settings of the run for them.
    rest: RunSettings<D>,
}

/// The model with the history of the load, and its last state of equilibrium.
type GoesOn<'m, const D: usize> = (ModelSetup<'m, D>, State);

impl<'a, const D: usize> LoadSteps<'a, D> {
    /// Of the settings of a run.
    pub fn new(stage: &'a LoadStage<D>, rest: &RunSettings<D>) -> Self {
        Self {
            stage,
            rest: rest.of_load_stage(stage),
        }
    }

    /// Takes the load steps, from their beginning or from a checkpoint of theirs; returns their summary, and what the motion, of the settings `then`, goes on with, unless the run ends with them.
    ///
    /// # Errors
    /// [`RunError`] of a load step or a file.
    pub fn run<'m>(
        &'m self,
        mut laid_out: ModelSetup<'m, D>,
        then: &'m RunSettings<D>,
        options: &RunOptions<'_>,
        progress: &dyn Progress,
    ) -> Result<(RunSummary, Option<GoesOn<'m, D>>), RunError> {
        let rest = &self.rest;
        let (file, saved) = opened(rest, options, &mut laid_out.setup.choices)?;
        laid_out.setup.choices.push(told(self.stage));
        let of_load = ModelSetup { rest, ..laid_out };
        let Loaded {
            summary,
            state,
            laid_out,
        } = load_steps(of_load, file, saved, &self.stage.solve, options, progress)?;
        let is_done = (summary.motion.as_ref()).is_some_and(|m| m.ended == Ended::Finished);
        let laid_out = ModelSetup {
            rest: then,
            ..laid_out
        };
        Ok((summary, is_done.then_some((laid_out, state))))
    }

    /// Adds the summary of the load steps to that of the motion after them.
    pub fn tell(&self, first: RunSummary, last: &mut RunSummary) {
        let is_new = |warning: &&_| !last.warnings.contains(warning);
        let warnings: Vec<_> = first.warnings.iter().filter(is_new).cloned().collect();
        last.warnings.extend(warnings);
        last.files.splice(0..0, first.files);
        if let Some(motion) = first.motion {
            last.stages.push(StageSummary {
                stage: self.stage.name.clone(),
                motion,
                applied: first.applied,
                reactions: first.reactions,
                sections: first.sections,
            });
        }
    }
}

/// Load steps before a motion, as a choice that is told.
pub(crate) fn told<const D: usize>(stage: &LoadStage<D>) -> Decision {
    let name = &stage.name;
    Decision {
        choice: format!("stage `{name}`: masses, contact and nodal body forces of the motion"),
        why: "its last equilibrium is then one of the motion, which begins with it".to_owned(),
    }
}

/// Removes what tells of a motion of an earlier run: load steps come first, and may end the run.
///
/// # Errors
/// [`ObserveError`] for a checkpoint that cannot be removed.
pub(super) fn forget<const D: usize>(
    output: &Output<D>,
    file: &CheckpointFile,
) -> Result<(), ObserveError> {
    for end in [".pvd", "_history.csv"] {
        // one that is not there is none to remove
        let _ = std::fs::remove_file(output.directory.join(format!("{}{end}", output.name)));
    }
    file.remove()
}
