//! Effect of temperature on bonds: their free stretch, and the work of heating.

use super::BondKinematics;

/// Thermal expansion of the bonds of a pass.
pub(super) struct Heat {
    /// Free stretch of each point.
    pub(super) free: Vec<f64>,
    /// The same up to which the work has been summed.
    pub(super) before: Vec<f64>,
    /// `V_i V_j |ξ| T_i⟨ξ⟩·M` of each bond there \[J\].
    pub(super) past: Vec<f64>,
    /// The same of the last force.
    pub(super) present: Vec<f64>,
    /// True if the next force is the first of all, from which sums begin.
    pub(super) begins: bool,
    /// Work that has not been taken yet \[J\].
    pub(super) work: f64,
}

impl Heat {
    /// Of points with this free stretch and so many bonds.
    pub(super) fn new(free: &[f64], bonds: usize) -> Self {
        Self {
            free: free.to_vec(),
            before: free.to_vec(),
            past: vec![0.0; bonds],
            present: vec![0.0; bonds],
            begins: true,
            work: 0.0,
        }
    }

    /// Free stretch of a bond.
    pub(super) fn between(&self, i: usize, j: usize) -> f64 {
        0.5 * (self.free[i] + self.free[j])
    }

    /// The value of `t` at which a bond breaks that would at `limit` without its free stretch.
    pub(super) fn limit(kinematics: BondKinematics, limit: f64, free: f64) -> f64 {
        match kinematics {
            // (1 + s + s̄)² − 1 with (1 + s)² = 1 + limit
            BondKinematics::Exact => limit + free * (2.0 * (1.0 + limit).sqrt() + free),
            BondKinematics::Linear => limit + 2.0 * free,
        }
    }

    /// Forgets the temperature before: that of a state which was put back follows.
    pub(super) fn begin(&mut self) {
        self.begins = true;
    }
}
