//! Who computes which sites of a coupled system, and what is told of bonds that break.

use crate::peridynamics::bond_force::BondPass;
use crate::system::{FailureUpdate, Partition, Ranks};

/// Who computes which sites.
pub(super) struct Split<'a> {
    pub ranks: &'a dyn Ranks,
    pub partition: Partition,
    /// Why they have these.
    pub why: String,
    /// Whether bonds may break.
    pub breaks: bool,
}

impl Split<'_> {
    /// Collective: what all passes broke, told to this one; how many bonds. None breaks while bonds are `Frozen`.
    pub fn exchange_breaks<const D: usize>(
        &self,
        pass: &mut dyn BondPass<D>,
        broken: u64,
        update: FailureUpdate,
    ) -> u64 {
        let (true, FailureUpdate::Update) = (self.breaks, update) else {
            return broken;
        };
        let Some(own) = pass.own_points() else {
            return broken;
        };
        let words = self.ranks.gather_words(&own.broken_at_own()).concat();
        own.take_broken(&words)
    }
}
