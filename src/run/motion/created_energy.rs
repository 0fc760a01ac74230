//! Energy that load steps set free, or created.

use crate::model::Model;
use crate::observe::report::number;
use crate::observe::summary::MotionSummary;
use crate::observe::warning::{Code, Quantity, Warning};

/// Energy that load steps set free by breaking, and that they dissipated \[J\] (per metre of thickness in 2D, per square metre of section in 1D).
pub(super) fn set_free(motion: &MotionSummary) -> [f64; 2] {
    let dissipated =
        motion.cracks.map_or(0.0, |c| c.dissipated_energy) + motion.inelastic_energy.unwrap_or(0.0);
    [motion.missing_energy - dissipated, dissipated]
}

/// Part of the work from which on energy that load steps created is warned of. Work is summed by the trapezoidal rule, which errs by the square of a step.
const CREATED: f64 = 0.02;

/// Warns of energy that nothing supplied: stored and dissipated energy beyond the work of loads and supports.
pub(super) fn created_energy<const D: usize>(
    model: &Model<D>,
    motion: &MotionSummary,
    u: &[f64],
) -> Option<Warning> {
    /// Part of the energy of a strain as large as the displacement over the size of the body that is left by equilibria that are found to a tolerance: 2e-12 of a body that load steps rotate by half a radian.
    const ROUND_OFF: f64 = 1e-11;
    let created = -set_free(motion)[0];
    let work = motion.external_work.abs().max(motion.stored_energy);
    let volume: f64 = (0..model.mesh.cell_count())
        .map(|c| model.mesh.cell_volume(c).abs())
        .sum();
    let furthest = u.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
    let strain = furthest / volume.powf(1.0 / D as f64);
    let none = ROUND_OFF * model.tensor_of_cell(0).get(0, 0, 0, 0) * strain * strain * volume;
    (created > (CREATED * work).max(none)).then(|| {
        Warning::new(Code::EnergyGain, format!(
            "stored and dissipated energy exceed the work of loads and supports by {} % of it: take smaller load steps, between which the work is summed by trapezoids; if that does not help, let coupling = \"nonlocal\" carry what rotates or cracks",
            number(100.0 * created / work)
        )).of(Quantity::Energy, created / work)
    })
}
