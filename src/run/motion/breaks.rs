//! Possibility that bonds break in a run.

use crate::run::setup::RunSettings;
use crate::system::SemiDiscrete;

/// Possibility that bonds break.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Breaks {
    /// They may, by a criterion of failure.
    Possibly,
    /// They may, by a damage that grows gradually before.
    Gradually,
    /// None does.
    Never,
    /// None does, but the law dissipates energy.
    Dissipating,
}

impl Breaks {
    /// Returns true if bonds may break.
    pub fn may(self) -> bool {
        matches!(self, Self::Possibly | Self::Gradually)
    }
}

/// Determines whether bonds may break.
pub fn breaks<const D: usize>(system: &dyn SemiDiscrete, rest: &RunSettings<D>) -> Breaks {
    let state = system.body_state();
    match state.and_then(|state| state.damage()) {
        Some(_) if rest.breaking.damages => Breaks::Gradually,
        Some(_) if rest.breaking.fracture.is_some() => Breaks::Possibly,
        _ if system.dissipation().is_some() => Breaks::Dissipating,
        _ => Breaks::Never,
    }
}

/// Site at which damage has reached the edge of the region where bonds can break.
pub fn damage_at_edge(system: &dyn SemiDiscrete) -> Option<usize> {
    system.body_state()?.damage_at_edge()
}
