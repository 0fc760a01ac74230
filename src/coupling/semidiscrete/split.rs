//! Distribution of the sites of a coupled system over processes, and the exchange of bonds that break.

use crate::peridynamics::bond_force::BondPass;
use crate::system::{FailureUpdate, Partition, Ranks};

/// Distribution of the sites over processes.
pub(super) struct Split<'a> {
    pub ranks: &'a dyn Ranks,
    pub partition: Partition,
    /// Reason for this distribution.
    pub why: String,
    /// True if bonds may break.
    pub breaks: bool,
}

impl Split<'_> {
    /// Collective: reports the bonds that all passes broke to this one; returns how many they are. None breaks while bonds are `Frozen`.
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
