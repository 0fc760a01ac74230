//! Kinematics of bonds under a motion: exact, or to first order.

/// Dependence of the bond force on the displacement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "BondsSpec")]
pub enum BondKinematics {
    /// Along the deformed bond, by its stretch.
    #[default]
    Exact,
    /// Along the undeformed bond, to first order of the displacement.
    Linear,
}

impl BondKinematics {
    /// The value of `t` at the critical stretch `s`.
    pub(crate) fn limit(self, s: f64) -> f64 {
        match self {
            Self::Exact => s * (2.0 + s),
            Self::Linear => 2.0 * s,
        }
    }

    /// The stretch at a value of `t`.
    pub(crate) fn stretch(self, t: f64) -> f64 {
        match self {
            Self::Exact => t / (1.0 + (1.0 + t).sqrt()),
            Self::Linear => 0.5 * t,
        }
    }
}
