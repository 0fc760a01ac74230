//! Initial state of the steps with one layout of the zones: at time zero, at a checkpoint, or where the zones have changed.

use std::sync::Arc;

use super::RunOptions;
use super::breaks::breaks;
use super::driven_impactors::prescribed;
use super::dynamic_system::{DynamicSystem, start};
use super::impact::impacted;
use super::rezoning::Leaving;
use super::saved::{EdgeReached, Saved, SavedZone, StepChoice};
use super::setup::{RunSetup, recorder, restore};
use super::time_dependent_loads::SceneDrive;
use super::time_step::{held, paced, repaced};
use super::writer::Recorder;
use crate::contact::SurfaceContact;
use crate::coupling::impact::RESOLVED;
use crate::observe::checkpoint::{CheckpointError, CheckpointFile};
use crate::observe::proof::Part;
use crate::observe::summary::{Decision, Timings, bytes_text};
use crate::observe::warning::Code;
use crate::run::condition_terms::ConditionTerms;
use crate::run::error::RunError;
use crate::run::loads::BodyForces;
use crate::run::motion::seen::Seen;
use crate::run::proof::growth::{GrowthQuestion, free_start};
use crate::run::setup::RunSettings;
use crate::scene::solve::Explicit as Spec;
use crate::scene::spec::UnprovenSpec;
use crate::solve::explicit::{Drive as _, State};
use crate::system::Dissipation;
use crate::tensor::AXES;
use crate::{
    coupling::{BrokenBonds, Operator},
    model::{Model, Sampler},
};

/// A run between two layouts of its zones.
pub(crate) struct RezoneState<'a, const D: usize> {
    /// Choices before the change: all but those that every layout makes anew.
    pub told: usize,
    /// Stages before the change.
    pub timings: Timings,
    pub leaving: Leaving<D>,
    pub broken: BrokenBonds<D>,
    /// Dissipation by breaking them.
    pub spent: Option<Dissipation>,
    /// The cells that become nonlocal.
    pub nonlocal: Vec<bool>,
    pub recorder: Recorder<'a, D>,
    /// True if a checkpoint was due with the change.
    pub due: bool,
    pub pace: StepChoice,
    pub edge: Option<EdgeReached>,
    pub zone: Option<SavedZone>,
    pub seen: Seen,
    pub growth: Option<Part>,
    /// Steps taken by this program, and their seconds.
    pub taken: (u64, f64),
}

/// Data that a run with one layout needs before its first step.
pub(crate) struct StepState<'r, 'm, const D: usize> {
    pub moving: DynamicSystem<'m>,
    pub recorder: Recorder<'r, D>,
    pub state: State,
    pub pace: StepChoice,
    pub drive: SceneDrive<'m, D>,
    pub edge: Option<EdgeReached>,
    pub zone: Option<SavedZone>,
    pub seen: Seen,
    /// Part of the proof about growing modes; none of a run that goes on from a checkpoint.
    pub growth: Option<Part>,
    pub told: usize,
    pub taken: (u64, f64),
    pub resumed: bool,
    /// True if a checkpoint is due before the first step.
    pub due: bool,
}

/// A layout before its first step, and the record of it.
pub(crate) struct PreStep<'a, 'r, 'm, const D: usize> {
    pub model: &'m Model<D>,
    pub operator: &'a Operator<'a, D>,
    pub rest: &'r RunSettings<D>,
    pub spec: &'a Spec,
    pub moving: DynamicSystem<'m>,
    /// Springs that hold the body.
    pub terms: Arc<ConditionTerms>,
    /// Contact of surfaces, if there is any.
    pub contact: Option<Arc<SurfaceContact<D>>>,
    /// Evidence that none does, if there is any.
    pub proved: Option<&'static str>,
    pub setup: &'a mut RunSetup,
}

impl<'r: 'm, 'm, const D: usize> PreStep<'_, 'r, 'm, D> {
    /// Begins at time zero, with what load steps before have `loaded`, or where a checkpoint was `saved`; `options` are those of the run.
    ///
    /// # Errors
    /// [`RunError`] if no stable step is found, the checkpoint is that of another model, or a condition would move what load steps have left elsewhere.
    pub fn at_start(
        self,
        options: RunOptions<'r>,
        file: CheckpointFile,
        saved: Option<Saved>,
        loaded: Option<State>,
    ) -> Result<StepState<'r, 'm, D>, RunError> {
        let (model, rest, spec) = (self.model, self.rest, self.spec);
        let mut held = held(model, &rest.conditions)?;
        held.extend(prescribed(&rest.impactors, model.sites.len()));
        let mut begin = start(model, rest);
        let left = prestrained(&mut begin, loaded.as_ref(), saved.as_ref(), &file)?;
        let choices = &mut self.setup.choices;
        let (moving, impact) = impacted(model, rest, self.moving, &begin, RESOLVED, choices)?;
        choices.push(Decision {
            choice: format!("{} in rows and bonds", bytes_text(moving.bytes as u64)),
            why: "read once per step".to_owned(),
        });
        let known = saved.as_ref().map(|saved| saved.pace);
        let asked = GrowthQuestion {
            remedy: self.setup.remedy,
            proved: self.proved,
            may_be_hopeless: rest.solver.unproven == UnprovenSpec::Warn,
            denied: rest.warnings.denied.contains(&Code::Growth),
            place: &|site| model.sites[site].position.iter().copied().collect(),
            ranks: options.ranks,
            free_from: free_start((model, rest), moving.is_linear, &begin)?,
        };
        let (mut moving, pace, growth) = paced(spec, &asked, moving, &held, known, choices)?;
        self.setup.lap("stable step");
        let drive = driven(model, rest, &begin.u, &pace, spec)?.heated(
            rest.stresses.thermal.as_ref(),
            self.operator,
            moving.is_linear,
        )?;
        if drive.evaluates_everywhere() {
            self.setup.choices.push(Decision {
                choice: "loads evaluated at every place and step".to_owned(),
                why: "an expression holds both t and a coordinate; written as two conditions, each with one, it would cost nothing"
                    .to_owned(),
            });
        }
        if loaded.is_some() {
            stay((model, rest), &drive, &begin.u)?;
        }
        restore(moving.system.as_mut(), saved.as_ref(), &file)?;
        let written = saved.as_ref().map(|s| &s.written);
        let of = (breaks(moving.system.as_ref(), rest), moving.is_linear);
        let touches = (impact, self.contact);
        let every = (options, spec.checkpoint_every);
        let mut recorder = recorder((model, rest), every, touches, of, file, written)?;
        recorder.loaded = left;
        recorder.hold(drive.holders());
        recorder.cut(model, rest, self.terms)?;
        let resumed = saved.is_some();
        let edge = saved.as_ref().and_then(|s| s.edge);
        let (state, zone, seen) = match saved {
            Some(saved) => (saved.state, saved.zone, saved.seen),
            None => (begin, None, Seen::default()),
        };
        Ok(StepState {
            moving,
            recorder,
            state,
            pace,
            drive,
            edge,
            zone: zone.or_else(|| rest.follow.as_ref().map(|_| SavedZone::first(model))),
            seen,
            growth,
            told: self.setup.choices.len(),
            taken: (0, 0.0),
            resumed,
            due: false,
        })
    }

    /// Begins where the zones have changed.
    ///
    /// # Errors
    /// [`RunError`] if no stable step is found, or nothing is there that new sites could follow.
    pub fn after_switch(
        mut self,
        between: RezoneState<'r, D>,
    ) -> Result<StepState<'r, 'm, D>, RunError> {
        let (model, rest, spec) = (self.model, self.rest, self.spec);
        let RezoneState {
            told,
            timings: before,
            leaving,
            mut recorder,
            due,
            pace,
            edge,
            zone,
            seen,
            growth,
            taken,
            spent,
            ..
        } = between;
        if let Some(spent) = spent {
            self.moving.system.set_dissipation(spent);
        }
        self.setup.choices.truncate(told);
        let held = held(model, &rest.conditions)?;
        let system = self.moving.system.as_ref();
        let pace = repaced(spec, system, &held, pace, leaving.state())?;
        self.setup.lap("stable step");
        let begin = start(model, rest);
        let drive = driven(model, rest, &begin.u, &pace, spec)?;
        let (state, switch) = leaving.arrive(model, system, &drive)?;
        recorder.move_to(&Sampler::new(model));
        if let (Some(record), Some(contact)) = (&mut recorder.contact, self.contact) {
            record.move_to(contact);
        }
        recorder.hold(drive.holders());
        recorder.cut(model, rest, self.terms)?;
        recorder.energy_at_start += switch.left();
        self.setup.lap("state carried over");
        let own = std::mem::replace(&mut self.setup.timings, before);
        for stage in &own.stages {
            self.setup
                .timings
                .add(&format!("zone changes: {}", stage.name), stage.seconds);
        }
        Ok(StepState {
            moving: self.moving,
            recorder,
            state,
            pace,
            drive,
            edge,
            zone: zone.map(|z| z.after(switch, model)),
            seen,
            growth,
            told,
            taken,
            resumed: true,
            due,
        })
    }
}

/// Begins with what load steps have `loaded`, or had before the run was `saved`; returns the displacement that they have left, nothing without any.
///
/// # Errors
/// [`CheckpointError::Content`] for that of another body.
fn prestrained(
    begin: &mut State,
    loaded: Option<&State>,
    saved: Option<&Saved>,
    file: &CheckpointFile,
) -> Result<Vec<f64>, RunError> {
    let left = match (loaded, saved) {
        (Some(state), _) => {
            (begin.work, begin.broken) = (state.work, state.broken);
            state.u.clone()
        }
        (None, Some(saved)) => saved.loaded.clone(),
        (None, None) => Vec::new(),
    };
    // sites of impactors come last
    match begin.u.get_mut(..left.len()) {
        Some(of_body) => of_body.copy_from_slice(&left),
        None => {
            return Err(RunError::Checkpoint(CheckpointError::Content {
                path: file.path().to_path_buf(),
                message: "its sites are not those of this model".to_owned(),
            }));
        }
    }
    Ok(left)
}

/// Displacement that a condition may prescribe beside the one that load steps have left, over the largest.
const BESIDE: f64 = 1e-9;

/// Refuses conditions that begin with the motion and prescribe another displacement than `u`, which load steps have left.
///
/// # Errors
/// [`RunError::Jump`].
fn stay<const D: usize>(
    (model, rest): (&Model<D>, &RunSettings<D>),
    drive: &SceneDrive<'_, D>,
    u: &[f64],
) -> Result<(), RunError> {
    let mut values = vec![0.0; drive.prescribed().len()];
    drive.displacement_into(0.0, &mut values);
    let largest = u.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
    for ((dof, holder), value) in drive.holders().zip(values) {
        let dof = dof as usize;
        if (value - u[dof]).abs() > BESIDE * largest {
            return Err(RunError::Jump {
                condition: rest.conditions[holder as usize].name.clone(),
                axis: AXES[dof % D],
                place: model.sites[dof / D].position.as_slice().to_vec(),
                prescribed: value,
                left: u[dof],
            });
        }
    }
    Ok(())
}

/// The conditions of a scene, from time zero to its end.
fn driven<'m, const D: usize>(
    model: &'m Model<D>,
    rest: &'m RunSettings<D>,
    start: &[f64],
    pace: &StepChoice,
    spec: &Spec,
) -> Result<SceneDrive<'m, D>, RunError> {
    let steps = match pace.since {
        (0, _) => pace.steps,
        _ => (spec.duration / pace.step).ceil() as u64,
    };
    let steps_of = (pace.step, steps);
    let drive = SceneDrive::new(model, &rest.conditions, start, steps_of, BodyForces::Lumped)?;
    Ok(drive.with_impactors(&rest.impactors, steps))
}
