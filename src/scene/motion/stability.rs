//! Whether a motion stays bounded: asked before the first step where the stiffness is not symmetric.

use super::record::StepChoice;
use crate::observe::{report::number, summary::Choice};
use crate::scene::run::RunError;
use crate::scene::spec::CouplingSpec;
use crate::solve::growth::{LARGEST_GAIN, growth};
use crate::system::{Dynamic, Symmetry};
use crate::verify::spectrum::{REMEDY, REMEDY_SEAM};

/// Fewer steps than this are too short for a splice or a blending to grow, and the question would cost more than a tenth of the run.
const LONG: u64 = 2000;

/// What becomes of a coupling whose motion grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Growing {
    /// The run does not begin: partial stress, whose modes grow by powers of ten.
    Refused,
    /// The run says so: splice and blending, whose weak modes damage may well outrun.
    Told,
}

impl Growing {
    /// Of a coupling.
    pub fn of(coupling: &CouplingSpec) -> Self {
        match coupling {
            CouplingSpec::PartialStress(_) => Self::Refused,
            _ => Self::Told,
        }
    }
}

/// Looks for modes that grow over the run; at most a tenth of its products, and at least 200.
///
/// # Errors
/// [`RunError::Step`] for partial stress that grows, with the remedy.
pub(super) fn check(
    growing: Growing,
    system: &dyn Dynamic,
    held: &[u32],
    pace: &StepChoice,
    choices: &mut Vec<Choice>,
) -> Result<(), RunError> {
    if system.symmetry() == Symmetry::Symmetric || (growing == Growing::Told && pace.steps < LONG) {
        return Ok(());
    }
    let found = growth(system, held, pace.step, pace.steps)?;
    let duration = pace.steps as f64 * pace.step;
    if growing == Growing::Refused {
        found.admit(duration, REMEDY)?;
    }
    let gain = found.rate * duration;
    choices.push(if gain > LARGEST_GAIN {
        Choice {
            choice: format!(
                "a mode of the seam grows by exp({}) over the run",
                number(gain)
            ),
            why: format!("the stiffness is not symmetric; {REMEDY_SEAM}"),
        }
    } else {
        Choice {
            choice: "no mode grows over the run".to_owned(),
            why: format!(
                "the stiffness is not symmetric; {} products showed none faster than exp({} t)",
                found.products,
                number(found.rate.max(found.resolution))
            ),
        }
    });
    Ok(())
}
