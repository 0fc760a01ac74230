//! Lattices behind the faces at which bonds end.

use crate::model::bond_cutting::WholeFamily;
use crate::peridynamics::Families;

/// Lattices continued behind the faces of elements, as needed by bonds that end on these faces.
pub(crate) struct ContinuedLattice<const D: usize> {
    /// Families of the points in elements, over the cloud of the body.
    pub families: Families,
    /// Each lattice, by the family of any of its points far from surfaces.
    pub whole: Vec<WholeFamily<D>>,
    /// The lattice of each point of the cloud.
    pub of_point: Vec<u16>,
}

impl<const D: usize> ContinuedLattice<D> {
    /// The whole family of a point of the cloud.
    pub fn whole_of(&self, point: u32) -> &WholeFamily<D> {
        &self.whole[usize::from(self.of_point[point as usize])]
    }
}
