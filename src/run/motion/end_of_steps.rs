//! Energies and cracks at the end of steps in time or of load steps.

use super::breaks::Breaks;
use super::dynamic_system::{PlaneEnergy, plane_energy};
use super::saved::{EdgeReached, StepChoice};
use super::writer::Recorder;
use crate::model::Model;
use crate::observe::cracks::CrackSummary;
use crate::observe::summary::{Ended, MotionSummary};
use crate::run::error::RunError;
use crate::run::setup::RunSettings;
use crate::solve::explicit::State;
use crate::system::SemiDiscrete;

/// Energies and cracks at the end of steps in time or of load steps: of a state with its system and its kinetic energy.
///
/// # Errors
/// [`RunError::Fracture`].
pub(super) fn end_of_steps<const D: usize>(
    (model, rest): (&Model<D>, &RunSettings<D>),
    recorder: &mut Recorder<'_, D>,
    (state, system, kinetic): (&State, &dyn SemiDiscrete, f64),
    (breaks, edge, pace): (Breaks, Option<EdgeReached>, StepChoice),
) -> Result<MotionSummary, RunError> {
    let stored = system.stored_energy(&state.u);
    let plane = plane_energy(model, rest)?;
    let area = recorder.crack_area(state.broken, system);
    Ok(MotionSummary {
        ended: Ended::Finished,
        steps: state.step,
        of_steps: pace.steps,
        time: state.time,
        step: pace.step,
        stable_step: None,
        kinetic_energy: kinetic,
        stored_energy: stored,
        external_work: state.work,
        missing_energy: recorder.energy_at_start + state.work - kinetic - stored,
        energy_gain: None,
        cracks: cracks(system, breaks, area, plane),
        inelastic_energy: inelastic_energy(system),
        impactors: (recorder.impact.as_ref()).map_or(Vec::new(), |i| i.summary(state)),
        broken_bonds: state.broken,
        edge_reached: edge.map(|e| {
            let x = model.sites[e.site as usize].position;
            (e.time, x.iter().copied().collect())
        }),
        steps_per_second: 0.0,
        switches: Vec::new(),
        nonlocal_share: [0.0; 3],
        processes: Vec::new(),
    })
}

/// Returns the dissipation by breaking bonds so far, and the area of the cracks; none where no bond can break.
fn cracks(
    system: &dyn SemiDiscrete,
    breaks: Breaks,
    area: f64,
    plane: Option<PlaneEnergy>,
) -> Option<CrackSummary> {
    let spent = system.dissipation().filter(|_| breaks.may())?;
    if breaks == Breaks::Gradually {
        // what the law dissipated is told of on its own: most of it beside the cracks
        return Some(CrackSummary {
            energy_per_area: None,
            ..CrackSummary::new(spent.energy, area)
        });
    }
    Some(CrackSummary {
        plane_energy: plane.map(|p| p.of_plane),
        fracture_energy: plane.and_then(|p| p.typed),
        ..CrackSummary::new(spent.energy, area)
    })
}

/// Returns the energy that a law with history variables has dissipated; none if that is zero.
fn inelastic_energy(system: &dyn SemiDiscrete) -> Option<f64> {
    let inelastic = system.dissipation().map(|d| d.inelastic);
    inelastic.filter(|energy| *energy != 0.0)
}
