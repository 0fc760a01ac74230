//! Bonds of a seam past the onset of softening.

use crate::peridynamics::bond_force::{BondSoftening, SoftenedBonds};

/// Softening of the bonds of a seam.
pub(super) struct SeamSoftening {
    /// Bonds that the seam cuts, past the onset; their slots are their numbers.
    pub(super) cut: SoftenedBonds,
    /// Parts of its stiffness that each bond past the onset has, of its pair force and of the elongation that it hands to dilatations.
    pub(super) left: Vec<[f64; 2]>,
}

impl SeamSoftening {
    /// Softening of so many bonds.
    pub fn new(law: BondSoftening, bonds: usize) -> Self {
        Self {
            cut: SoftenedBonds::new(law),
            left: vec![[0.0; 2]; bonds],
        }
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.cut.memory_bytes() + size_of_val(&self.left[..])
    }
}
