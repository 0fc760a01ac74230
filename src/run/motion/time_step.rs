//! The time step of a run: the stable one of the dynamic system, sub-cycled where the scene wants it.

use super::dynamic_system::DynamicSystem;
use super::saved::StepChoice;
use crate::model::Model;
use crate::observe::{proof::Part, report::number, summary::Decision};
use crate::run::error::RunError;
use crate::run::loads::holders;
use crate::run::proof::growth::{self, GrowthQuestion};
use crate::scene::conditions::Condition;
use crate::scene::solve::Explicit as Spec;
use crate::scene::spec::BeyondLimitSpec;
use crate::solve::explicit::State;
use crate::solve::stable_step::{Held, StepLimit, stable_step, stable_step_beyond};
use crate::solve::sub_cycling::{FineSites, SubCycled, SubCyclingError};
use crate::system::SemiDiscrete;

/// Chooses the time step of a dynamic system, that of a checkpoint if it is `known`, with sub-cycling where the scene wants it.
///
/// # Errors
/// [`RunError::Step`] for a step beyond the stable one or a motion that grows, [`RunError::SubCycling`].
pub fn paced<'a>(
    spec: &Spec,
    asked: &GrowthQuestion<'_>,
    moving: DynamicSystem<'a>,
    held: &[u32],
    known: Option<StepChoice>,
    choices: &mut Vec<Decision>,
) -> Result<(DynamicSystem<'a>, StepChoice, Option<Part>), RunError> {
    let fine = match spec.sub_steps {
        None => None,
        Some(n) => match FineSites::find(moving.system.as_ref(), held, n) {
            Ok(fine) => Some(fine),
            Err(error @ SubCyclingError::NoGain { .. }) => {
                choices.push(Decision {
                    choice: "no sub-steps".to_owned(),
                    why: error.to_string(),
                });
                None
            }
            Err(error) => return Err(error.into()),
        },
    };
    let Some(fine) = fine else {
        let (pace, growth) = match known {
            Some(pace) => (pace, None),
            None => {
                let system = moving.system.as_ref();
                let limit = stable_step(system, held)?;
                let pace = choose_step(spec, &limit, system, held, choices)?;
                let growth = growth::check(asked, system, held, (pace.step, pace.steps))?;
                (pace, Some(growth))
            }
        };
        return Ok((moving, pace, growth));
    };
    let (cycled, pace) = match known {
        Some(pace) => (SubCycled::new(moving.system, fine, pace.step), pace),
        None => {
            let (mut cycled, limit) =
                SubCycled::with_stable_step(moving.system, fine, held, spec.fraction)?;
            let pace = choose_step(spec, &limit, &cycled, held, choices)?;
            cycled.set_step(pace.step);
            if spec.step.is_some() {
                // the force depends on the step, so its limit is that of the step asked for
                let limit = stable_step(&cycled, held)?;
                limit.admit(Some(pace.step), &cycled, held)?;
            }
            (cycled, pace)
        }
    };
    choices.push(Decision {
        choice: format!(
            "{} sub-steps of {} sites",
            spec.sub_steps.unwrap_or(1),
            cycled.fine_sites()
        ),
        why: "their rows alone limit the step".to_owned(),
    });
    let moving = DynamicSystem {
        bytes: moving.bytes + cycled.memory_bytes(),
        system: Box::new(cycled),
        is_linear: moving.is_linear,
        has_exact_seam: moving.has_exact_seam,
    };
    // sub-steps are for symmetric models: what is proved of one holds of it
    let growth = match known {
        Some(_) => None,
        None => Some(growth::check(
            asked,
            moving.system.as_ref(),
            held,
            (pace.step, pace.steps),
        )?),
    };
    Ok((moving, pace, growth))
}

/// The time step after a change of the dynamic system: the one before, or a shorter one if that is beyond the fraction of the stable step now.
///
/// # Errors
/// [`RunError::Step`] if no stable step is found.
pub(crate) fn repaced(
    spec: &Spec,
    system: &dyn SemiDiscrete,
    held: &[u32],
    before: StepChoice,
    state: &State,
) -> Result<StepChoice, RunError> {
    let fraction = spec.step.map_or(spec.fraction, |_| 1.0);
    let stays = Held {
        step: before.step,
        fraction,
    };
    let (limit, stays) = stable_step_beyond(system, held, stays)?;
    let choice = StepChoice {
        stable: limit.stable,
        certified: limit.certified,
        site: limit.certified_site as u64,
        ..before
    };
    // what was asked for may stay up to the limit itself
    if stays {
        return Ok(choice);
    }
    let left = spec.duration - state.time;
    let steps = (left / (spec.fraction * limit.stable) * (1.0 - 1e-12))
        .ceil()
        .max(1.0);
    Ok(StepChoice {
        step: left / steps,
        steps: state.step + steps as u64,
        since: (state.step, state.time),
        ..choice
    })
}

/// The time step of a run, such that a whole number of steps fills its duration.
///
/// # Errors
/// [`RunError::Step`] for a step beyond the stable one, unless the scene says to shorten it.
fn choose_step(
    spec: &Spec,
    limit: &StepLimit,
    system: &dyn SemiDiscrete,
    prescribed: &[u32],
    choices: &mut Vec<Decision>,
) -> Result<StepChoice, RunError> {
    let own = spec.fraction * limit.stable;
    let (step, why) = match spec.step {
        None => (own, format!("{} of the stable step", spec.fraction)),
        Some(asked) if asked > limit.stable && spec.beyond_limit == BeyondLimitSpec::Shorten => (
            own,
            format!(
                "{} of the stable step, for the one asked for, {asked:e}, is beyond it",
                spec.fraction
            ),
        ),
        asked => (
            limit.admit(asked, system, prescribed)?,
            "as asked for".to_owned(),
        ),
    };
    let steps = (spec.duration / step * (1.0 - 1e-12)).ceil().max(1.0);
    let choice = StepChoice {
        step: spec.duration / steps,
        steps: steps as u64,
        stable: limit.stable,
        certified: limit.certified,
        site: limit.certified_site as u64,
        since: (0, 0.0),
    };
    choices.push(Decision {
        choice: format!("{} steps of {}", choice.steps, number(choice.step)),
        why: format!(
            "{why}, and a whole number of them; stable up to {}, from row sums up to {}",
            number(limit.stable),
            number(limit.certified)
        ),
    });
    Ok(choice)
}

/// The dofs whose motion is prescribed.
///
/// # Errors
/// [`RunError::Idle`] for a condition that meets no site.
pub fn held<const D: usize>(
    model: &Model<D>,
    conditions: &[Condition<D>],
) -> Result<Vec<u32>, RunError> {
    let holders = holders(model, conditions)?;
    let dofs = holders.iter().enumerate();
    Ok(dofs.filter_map(|(dof, h)| h.map(|_| dof as u32)).collect())
}
