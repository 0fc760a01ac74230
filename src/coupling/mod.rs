//! coupling
