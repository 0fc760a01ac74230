//! peridynamics
