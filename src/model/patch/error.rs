//! Reasons for which a patch cannot be embedded.

use crate::{mesh::CellShape, tensor::Vector};

/// Reasons for which a patch cannot be embedded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatchError {
    /// No cell of the lattice has its centre in the zone and lies within the body.
    #[error(
        "no cell of the lattice, of edge {edge}, lies in the zone and within the body; make the zone larger or the spacing smaller"
    )]
    Empty {
        /// Edge of the cells \[m\].
        edge: f64,
    },
    /// The zone asks for more cells than there may be.
    #[error(
        "the zone may hold {count:.1e} cells of the lattice, of edge {edge}; make the zone smaller or the spacing larger"
    )]
    Large {
        /// Cells of the box around the zone.
        count: f64,
        /// Edge of the cells \[m\].
        edge: f64,
    },
    /// The patch grew as far as is known what lies around it.
    #[error(
        "the rim of the zone has to reach too far from it to find elements that end at it; make the zone larger, or move it away from surfaces and thin parts"
    )]
    Grown,
    /// The body is not of one piece within the elements around a node of the rim.
    #[error(
        "a slit or a gap narrower than a lattice cell crosses the rim of the zone at {position:?}, whose elements would bridge it; let the zone hold its tip, or end the zone before it"
    )]
    Torn {
        /// Position of the node \[m\].
        position: Vec<f64>,
    },
    /// An element reaches from one side of the patch to another.
    #[error(
        "the element at {position:?} reaches from one side of the zone with its rim to another, past cracks or bonds that may break; refine the mesh there, or make the zone larger"
    )]
    Spans {
        /// Its centroid \[m\].
        position: Vec<f64>,
    },
    /// Nodes at the rim follow one another.
    #[error(
        "nodes of the rim of the zone follow one another near {position:?}; move the zone, or take a smaller spacing"
    )]
    Circle {
        /// Position of one of them \[m\].
        position: Vec<f64>,
    },
    /// The outer face of the rim cuts a cell with a negative part about its middle.
    #[error(
        "cell {cell}, a {shape:?}, at {position:?}, is cut by the rim of the zone and is too distorted for that; move its nodes apart, or move the zone"
    )]
    Kind {
        /// Number of the cell.
        cell: usize,
        /// Its shape.
        shape: CellShape,
        /// Its middle \[m\].
        position: Vec<f64>,
    },
    /// Cells of several materials meet in the patch.
    #[error(
        "the zone or its rim holds two materials at {position:?}; keep both away from the border of materials"
    )]
    Materials {
        /// Middle of the cell of the lattice \[m\].
        position: Vec<f64>,
    },
    /// No element near a node is left.
    #[error(
        "a node at {position:?} keeps no element of which enough is left beside the rim of the zone; refine the mesh there, or move the zone"
    )]
    Alone {
        /// Its position \[m\].
        position: Vec<f64>,
    },
    /// A node would have no mass.
    #[error(
        "the elements that are left at {position:?} beside the rim of the zone give a node the volume {volume:.3e}; move the zone, or refine the mesh there"
    )]
    Mass {
        /// Position of the node \[m\].
        position: Vec<f64>,
        /// Its volume [m^D].
        volume: f64,
    },
}

impl PatchError {
    /// The place at which elements or nodes are too few \[m\].
    pub(super) fn place<const D: usize>(&self) -> Option<Vector<D>> {
        match self {
            Self::Circle { position } | Self::Alone { position } | Self::Mass { position, .. } => {
                (position.len() == D).then(|| Vector::from_column_slice(position))
            }
            Self::Empty { .. }
            | Self::Large { .. }
            | Self::Grown
            | Self::Torn { .. }
            | Self::Spans { .. }
            | Self::Kind { .. }
            | Self::Materials { .. } => None,
        }
    }
}
