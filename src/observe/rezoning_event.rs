//! Changes of the nonlocal zone during a run, as the summary reports them.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::report::number;

/// A change of the nonlocal zone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Switch {
    /// After this step.
    pub step: u64,
    /// At this time.
    pub time: f64,
    /// Cells that became nonlocal.
    pub added: usize,
    /// Cells that became local.
    pub removed: usize,
    /// Share of the nonlocal zone in the body's volume from then on.
    pub share: f64,
    /// Kinetic and stored energy before.
    pub energy: f64,
    /// Kinetic energy after less before, as the new sites are fitted.
    pub kinetic_jump: f64,
    /// Stored energy after less before.
    pub stored_jump: f64,
    /// Energy that a scaling of the new sites' velocities gave back; zero if that would have been too much for them.
    pub energy_restored: f64,
    /// Norm of the linear momentum that the change would have lost, and a velocity of the new sites gave back.
    pub momentum_restored: f64,
    /// Norm of the change of the angular momentum about the middle of the mesh.
    pub angular_jump: f64,
    /// Norm of the sum of masses times speeds before, to compare the two with.
    pub momentum_scale: f64,
}

impl Switch {
    /// The jump of the energy as the new sites are fitted, over the energy before.
    pub fn fitted_jump(&self) -> f64 {
        self.relative(self.kinetic_jump + self.stored_jump)
    }

    /// The jump that is left, over the energy before.
    pub fn jump(&self) -> f64 {
        self.relative(self.left())
    }

    /// The jump that is left \[J\].
    pub fn left(&self) -> f64 {
        self.kinetic_jump + self.stored_jump + self.energy_restored
    }

    fn relative(&self, energy: f64) -> f64 {
        if self.energy > 0.0 {
            energy / self.energy
        } else {
            0.0
        }
    }
}

/// Writes all changes of a run, if there are any.
pub(super) fn write(
    switches: &[Switch],
    share: [f64; 3],
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    if switches.is_empty() {
        return Ok(());
    }
    let worst = |of: &dyn Fn(&Switch) -> f64| {
        let sizes = switches.iter().map(|s| of(s).abs());
        sizes.fold(0.0, f64::max)
    };
    let [first, most, last] = share.map(|share| 100.0 * share);
    writeln!(
        f,
        "nonlocal zone          {first:.1} % of the volume at the start, {most:.1} % at most, {last:.1} % at the end"
    )?;
    writeln!(
        f,
        "changes of the zone    {}; of the energy at most {:.1e} as fitted, {:.1e} left; momentum restored at most {:.1e}",
        switches.len(),
        worst(&Switch::fitted_jump),
        worst(&Switch::jump),
        worst(&|s| s.momentum_restored / s.momentum_scale.max(f64::MIN_POSITIVE)),
    )?;
    for s in switches {
        writeln!(
            f,
            "  t = {:<13} +{} -{} cells, {:.1} %; energy {:+.1e} as fitted (kinetic {:+.1e}, stored {:+.1e}), {:+.1e} left",
            number(s.time),
            s.added,
            s.removed,
            100.0 * s.share,
            s.fitted_jump(),
            s.relative(s.kinetic_jump),
            s.relative(s.stored_jump),
            s.jump(),
        )?;
    }
    Ok(())
}
