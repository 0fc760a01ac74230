//! Changes of bonds by a force.

/// Numbers of bonds that a force has changed for good, each counted from both ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BondChanges {
    /// Bonds that broke.
    pub broken: u64,
    /// Bonds that softened and have something left.
    pub softened: u64,
}

impl BondChanges {
    /// Of bonds that break at once.
    pub fn broken(broken: u64) -> Self {
        Self {
            broken,
            softened: 0,
        }
    }

    /// Returns true if no bond changed.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

impl std::ops::AddAssign for BondChanges {
    fn add_assign(&mut self, other: Self) {
        self.broken += other.broken;
        self.softened += other.softened;
    }
}
