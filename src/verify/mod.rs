//! verify
pub mod patch;
