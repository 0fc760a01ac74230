//! The state between load steps.

/// All that a run carries from load step to load step, but for the damage, which the system keeps.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LoadState {
    /// Load steps done.
    pub step: u64,
    /// Displacement \[m\], one entry per dof.
    pub u: Vec<f64>,
    /// Bonds broken since the start.
    pub broken: u64,
    /// Time of the last step.
    pub time: f64,
    /// Length of the next step where steps are as long as nothing fails; zero if it is not known.
    pub stride: f64,
}

impl LoadState {
    /// The start, undeformed.
    pub fn at_rest(dofs: usize) -> LoadState {
        LoadState {
            u: vec![0.0; dofs],
            ..LoadState::default()
        }
    }
}
