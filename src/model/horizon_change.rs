//! Rules for the bonds between points of different horizons.

use crate::peridynamics::BondHorizon;

/// Rule for the bonds between points of different horizons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HorizonChange {
    /// Each point has the force state of its own horizon, which acts at both ends of its bonds: `L(x) = Σ {T[x]⟨ξ⟩ − T[q]⟨−ξ⟩} V_q`, [SAND2015-7998] eq. (2.5) with
    /// (2.15), a variable scale homogeneous body, or dual-horizon peridynamics. Forces are pairs; a uniform strain leaves a ghost force of the size of `∇∇δ`, eq. (2.18).
    #[default]
    Dual,
    /// A bond between two horizons has the larger one, and is weakened by the α of its end with the smaller, \[Jenabidehkordi2019\] eq. (7). Forces are pairs, and in
    /// a bar points of the smaller horizon are balanced under a uniform strain; those of the larger are not.
    MultiHorizon,
    /// Each point sees the force states that all others would have with its own horizon, [SAND2015-7998] section 2.5. A uniform strain leaves no force; forces are
    /// not pairs.
    Splice,
}

impl HorizonChange {
    /// Most horizons that a rule takes which knows regions of one horizon.
    pub const MOST_HORIZONS: usize = 16;

    /// The name, as scenes have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dual => "dual",
            Self::MultiHorizon => "multi-horizon",
            Self::Splice => "splice",
        }
    }

    /// Horizon of a bond whose ends have different ones.
    pub(crate) fn of_bonds(self) -> BondHorizon {
        match self {
            Self::Dual | Self::Splice => BondHorizon::OfCentre,
            Self::MultiHorizon => BondHorizon::Larger,
        }
    }
}
