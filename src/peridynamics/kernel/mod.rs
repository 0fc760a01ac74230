//! Bond passes: the internal force of a peridynamic body as one threaded sweep over its bonds, with damage at one bit per directed bond.
//!
//! | file | what |
//! |---|---|
//! | `setup.rs` | what a pass is made from, and the errors |
//! | `bond.rs` | one bond: stretch, force and extension without cancellation |
//! | `list.rs` | the pass over neighbour lists, for any cloud |
//! | `tests.rs` | passes against a plain double loop |
//!
//! A bond is seen through `t = (2 ξ·η + η·η)/r²`, so that `|ξ + η| = r √(1 + t)`: no length is ever the difference of two long ones, and the stretch
//! `s = √(1 + t) − 1` exceeds `s_c` exactly where `t > s_c (2 + s_c)`, without a root. Both ends of a bond compute the same `t` from the same numbers,
//! hence break together without telling each other. Every method gives the same bits for any number of threads.

mod bond;
mod list;
mod setup;
#[cfg(test)]
mod tests;

pub use setup::{
    BondForce, BondFunction, BondSetup, CriticalStretch, Failure, KernelError, Kinematics, Layout,
    Storage,
};

use crate::system::Breakage;

/// One sweep over the bonds of a cloud.
///
/// Shapes: `u`, `force`, `x`, `y` and the row sums have `D` numbers per point of the cloud, `damage` one. Units: \[m\], \[N\] (per area of a bar of unit
/// section in 1D, per thickness in 2D).
pub trait BondPass<const D: usize>: Send + Sync {
    /// Number of points of the cloud.
    fn points(&self) -> usize;

    /// Which pass this is, in a word: `list` or `lattice`.
    fn name(&self) -> &'static str;

    /// Directed bonds of the reference families.
    fn bonds(&self) -> u64;

    /// Overwrites `force` with the internal force `F(u)` (`K u` of a linear body, so minus the force that acts on the point), volume included; zero for points without a row.
    /// Returns how many directed bonds this pass broke.
    fn force_into(&mut self, u: &[f64], force: &mut [f64], breakage: Breakage) -> u64;

    /// `y = K x` with the tangent `K` at rest and bonds as they stand; zero for points without a row.
    fn tangent_into(&self, x: &[f64], y: &mut [f64]);

    /// Per unknown an upper bound of `Σ |K_ab|` over the points of the cloud, with bonds as they stand; zero for points without a row.
    fn row_sums(&self) -> Vec<f64>;

    /// Energy stored at the points with rows \[J\]; of each bond, half belongs to each end.
    fn stored_energy(&self, u: &[f64]) -> f64;

    /// Overwrites `damage` with `1 − Σ_intact V / Σ V` of every point; zero where there is no family.
    fn damage_into(&self, damage: &mut [f64]);

    /// Directed bonds of the reference families that are broken.
    fn broken(&self) -> u64;

    /// The bits that say which bonds stand.
    fn damage_state(&self) -> Vec<u64>;

    /// Puts back what [`BondPass::damage_state`] gave; false, and nothing changed, if it belongs to another pass.
    fn restore_damage(&mut self, state: &[u64]) -> bool;

    /// Bytes that the pass holds.
    fn memory_bytes(&self) -> usize;
}

/// The pass that suits the setup: over the lattice where the points fill one, over lists otherwise.
///
/// # Errors
/// [`KernelError`] if lists do not belong together, or if a bond does not weigh the same from both ends.
pub fn bond_pass<const D: usize>(
    setup: &BondSetup<'_, D>,
) -> Result<Box<dyn BondPass<D>>, KernelError> {
    setup.check()?;
    Ok(Box::new(list::List::new(setup)))
}
