//! verify
pub mod patch;
pub mod variable_horizon;
