//! Loads of a scene: the part of the body that they act on, and their force there.

use super::region::Region;
use crate::mesh::Facet;
use crate::mesh::boundary::BoundaryFacet;
use crate::tensor::Vector;

/// The part of a body that a load acts on.
#[derive(Clone, Debug, PartialEq)]
pub enum Domain<const D: usize> {
    /// Facets, whose normals the load does not ask for.
    Facets(Vec<Facet>),
    /// Facets at the boundary of the mesh, their normals outwards.
    Surface(Vec<BoundaryFacet>),
    /// Cells whose centroid lies in a region.
    Cells(Region<D>),
}

impl<const D: usize> Domain<D> {
    /// The nodes of each facet; none of cells.
    pub fn facets(&self) -> Vec<&[u32]> {
        match self {
            Self::Facets(facets) => facets.iter().map(AsRef::as_ref).collect(),
            Self::Surface(facets) => facets.iter().map(|f| f.nodes.as_ref()).collect(),
            Self::Cells(_) => Vec::new(),
        }
    }
}

/// Force per area or volume \[Pa\] or [N/m³] of the values that a scene types and the outward unit normal, which is zero but on a [`Domain::Surface`]; linear in the values.
pub type Density<const D: usize> = fn(&Vector<D>, &Vector<D>) -> Vector<D>;

/// A load: where it acts, and its force there.
#[derive(Clone, Debug)]
pub struct Load<const D: usize> {
    /// The part of the body.
    pub on: Domain<D>,
    /// Force per area or volume.
    pub density: Density<D>,
}

impl<const D: usize> PartialEq for Load<D> {
    fn eq(&self, other: &Self) -> bool {
        self.on == other.on && std::ptr::fn_addr_eq(self.density, other.density)
    }
}

/// The force per area or volume that is typed, component by component.
pub(super) fn typed<const D: usize>(value: &Vector<D>, _normal: &Vector<D>) -> Vector<D> {
    *value
}
