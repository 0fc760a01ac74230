//! Steps of which each process takes those of its own sites, and of their ghosts: the interface of a system that is spread over processes to its driver.
//!
//! A process moves its own sites and its ghosts by forces that are its own or come from their processes, so that it never needs another number of a ghost.
//! Output that needs all sites, as tables and files do, gathers them before.

use super::{ExactSum, FailureUpdate, Halfway, Traffic};

/// A system whose processes move their own sites and ghosts.
///
/// Vectors have the numbers of all sites; those of sites that are neither own nor ghosts are anything.
pub trait SharedSteps {
    /// Collective: begins to share steps, where all processes have the numbers of all sites.
    fn begin(&mut self);

    /// Returns true for each site that is this process's own.
    fn own(&self) -> Vec<bool>;

    /// Returns true for each site that is its own or a ghost.
    fn known(&self) -> Vec<bool>;

    /// Collective: overwrites the forces of own sites and ghosts, and returns how many bonds of own sites broke.
    fn force_into(&mut self, u: &[f64], force: &mut [f64], update: FailureUpdate) -> u64;

    /// Returns the energy lost by the bonds of own sites that broke in the last force, see [`super::Dissipation::energy`]: a sum that processes add.
    fn lost(&self, at: &Halfway<'_>) -> ExactSum;

    /// Adds the losses of all processes to the account of [`super::BodyHistory::dissipation`].
    fn spend(&mut self, lost: &ExactSum);

    /// Collective: overwrites each number with the sum of those of all processes.
    fn add_into(&self, sums: &mut [i64]);

    /// Collective: overwrites the numbers of all sites with those of their processes.
    fn gather(&self, values: &mut [f64]);

    /// Collective: breaks the bonds that other processes broke since this was called last.
    fn learn_breaks(&mut self);

    /// True where [`super::BodyState::damage_at_edge`] may find any, and asks for the bonds of all processes.
    fn has_edge(&self) -> bool;

    /// Collective: what each process exchanged.
    fn traffic(&self) -> Vec<Traffic>;
}
