//! Bonds and dilatations of a seam that a process computes, and whose costs it counts.

/// Bonds and dilatations of a seam that a process computes.
#[derive(Debug, Default)]
pub(super) struct OwnBonds {
    /// Parts whose elongation is known.
    pub(super) parts: Vec<bool>,
    /// Dilatations that are known.
    pub(super) dilatations: Vec<bool>,
    /// Bonds that break here, where they are over their limit.
    pub(super) bonds: Vec<bool>,
    /// Those of them whose cost is counted here.
    pub(super) counted_bonds: Vec<bool>,
    /// Dilatations whose energy is counted here.
    pub(super) counted_dilatations: Vec<bool>,
}

/// Returns true if a place is marked; all are where there are no marks.
fn is_marked(marks: &[bool], place: usize) -> bool {
    marks.get(place).is_none_or(|is_marked| *is_marked)
}

impl OwnBonds {
    pub fn knows_part(&self, part: usize) -> bool {
        is_marked(&self.parts, part)
    }

    pub fn knows_dilatation(&self, f: usize) -> bool {
        is_marked(&self.dilatations, f)
    }

    pub fn knows_bond(&self, bond: usize) -> bool {
        is_marked(&self.bonds, bond)
    }

    pub fn counts_bond(&self, bond: usize) -> bool {
        is_marked(&self.counted_bonds, bond)
    }

    pub fn counts_dilatation(&self, f: usize) -> bool {
        is_marked(&self.counted_dilatations, f)
    }
}
