//! Errors of load steps.

use crate::solve::krylov::KrylovError;

/// Failure of a load step.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum QuasiStaticError {
    /// An input has the wrong length.
    #[error("{what} has {found} entries, the model has {expected}: it belongs to another model")]
    Shape {
        /// Name of the input.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length needed.
        expected: usize,
    },
    /// No equilibrium.
    #[error(
        "load step {step} at time {time} found no equilibrium: the residual is {residual:.1e} of the forces after {iterations} iterations, largest at site {site}; {remedy}"
    )]
    NoEquilibrium {
        /// The load step.
        step: u64,
        /// Its time.
        time: f64,
        /// Relative residual.
        residual: f64,
        /// Iterations spent.
        iterations: usize,
        /// Site at which the residual is largest.
        site: usize,
        /// The remedy.
        remedy: &'static str,
    },
    /// Damped motion that grows.
    #[error(
        "load step {step} at time {time}: the relaxation ran away after {iterations} passes, fastest at site {site}: the stiffness has eigenvalues that are negative or complex, as that of partial stress at free sides; take method = \"implicit\", or another coupling"
    )]
    RanAway {
        /// The load step.
        step: u64,
        /// Its time.
        time: f64,
        /// Passes so far.
        iterations: usize,
        /// Site at which the residual is largest.
        site: usize,
    },
    /// Bonds never stop breaking.
    #[error(
        "bonds still break after {rounds} rounds of load step {step} at time {time}: {broken} so far; prescribe displacements instead of forces, or run it as explicit dynamics"
    )]
    NeverHolds {
        /// The load step.
        step: u64,
        /// Its time.
        time: f64,
        /// Rounds spent.
        rounds: usize,
        /// Bonds broken in this step.
        broken: u64,
    },
    /// The linear solve failed.
    #[error("load step {step} at time {time} found no equilibrium: {source}; {remedy}")]
    Linear {
        /// The load step.
        step: u64,
        /// Its time.
        time: f64,
        /// Why.
        source: KrylovError,
        /// The remedy.
        remedy: &'static str,
    },
    /// The listener asked for the end, within a load step.
    #[error("load step {step} at time {time} was interrupted")]
    Interrupted {
        /// The load step.
        step: u64,
        /// Its time.
        time: f64,
    },
    /// A number is not finite.
    #[error(
        "load step {step} at time {time}: the force at site {site} is not a number; check loads and prescribed displacements there"
    )]
    NotFinite {
        /// The load step.
        step: u64,
        /// Its time.
        time: f64,
        /// The first such site.
        site: usize,
    },
}
