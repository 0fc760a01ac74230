//! verify
pub mod bar;
pub mod patch;
pub mod variable_horizon;

/// How much of a suite is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Every method, law and dimension at least once, in seconds.
    Quick,
    /// Everything.
    Full,
}
