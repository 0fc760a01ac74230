//! peridynamics

pub mod families;
mod grid;
pub mod influence;
mod least_change;
pub mod shape_tensor;
pub mod shells;
pub mod weights;
