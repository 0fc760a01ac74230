//! A facet seen from its cell, and the key by which cells share it.

use super::{Facet, facet_corners};

/// A facet seen from one of its cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoundaryFacet {
    /// Its nodes, ordered so that its normal points out of `cell` (in 1D a single node).
    pub nodes: Facet,
    /// The cell that it belongs to.
    pub cell: u32,
    /// Its number in [`CellShape::facets`](super::CellShape::facets) of that cell.
    pub local: u8,
}

impl BoundaryFacet {
    /// Number of a facet within its cell that stands for the surface where it crosses the cell.
    pub const CROSSING: u8 = u8::MAX;

    /// Key of the facet, the same in all cells that share it: its corners.
    pub(super) fn key<const D: usize>(&self) -> [u32; 4] {
        key(facet_corners::<D>(&self.nodes).iter().copied())
    }
}

/// Sorted node numbers of a facet, padded: the same for all cells that share it.
pub(super) fn key(nodes: impl Iterator<Item = u32>) -> [u32; 4] {
    let mut k = [u32::MAX; 4];
    k.iter_mut().zip(nodes).for_each(|(k, n)| *k = n);
    k.sort_unstable();
    k
}
