//! Peridynamics: families, influence functions, bond weights, linearised laws and the body that they make.
//!
//! | file | what | source |
//! |---|---|---|
//! | `influence.rs` | influence functions ω, micromoduli λ | [SAND2015-7998] eq. (5.8), (3.1) |
//! | `families.rs` | neighbour search with a horizon per point | eq. (5.2) |
//! | `lattice_families.rs` | the same for points of one lattice and one horizon, without a search | |
//! | `offsets.rs` | a value for each bond of a lattice | |
//! | `shells.rs` | isotropic weights of a lattice, shell by shell | eq. (3.6) as a sum |
//! | `weights.rs` | moment-fitted weights of one irregular family | |
//! | `shape_tensor.rs` | K and its inverse | section 7.2 |
//! | `law.rs` | what a law is; `bond_based.rs`, `lps.rs`, `correspondence.rs` | eq. (3.1), (5.16), section 7.2 |
//! | `fracture.rs` | critical stretch from the fracture energy | \[Silling2005\] |
//! | `crack_area.rs` | area of cracks from broken bonds | |
//! | `partial_volume/` | what share of a cell counts in a family whose horizon cuts it | section 5.2.1 |
//! | `body.rs` | internal force and partial stress | eq. (2.5), (2.19) |
//! | `contact.rs` | short-range contact between points without a bond | Parks et al. 2008 |
//! | `kernel/` | bond passes: threaded internal force with damage, for motion | eq. (2.5) |

pub(crate) mod alike;
pub mod body;
pub mod bond_based;
pub mod contact;
pub mod correspondence;
mod crack_area;
pub mod families;
pub mod fracture;
mod grid;
pub mod influence;
pub mod kernel;
mod lattice_families;
pub mod law;
pub(crate) mod least_change;
pub mod lps;
pub(crate) mod offsets;
pub mod partial_volume;
pub mod shape_tensor;
pub mod shells;
pub mod weights;

pub use body::{BondWeights, Cloud, Ends, Factors, PdBody};
pub use bond_based::BondBased;
pub use correspondence::Correspondence;
pub use crack_area::CrackArea;
pub use families::{Families, FamilyError, Reversed, TIE_TOLERANCE};
pub use fracture::{BondEnergy, FractureError, critical_stretch, plane_energy};
pub use influence::{Influence, Micromodulus};
pub use law::{BondLaw, Family, StatePart, collapsed_tensor};
pub use lps::LinearPeridynamicSolid;
pub use partial_volume::{BoxCell, PartialVolume, PartialVolumeError};
pub use shape_tensor::{ShapeError, invert_shape_tensor};
pub use shells::{LatticeFamily, ShellError, ShellTarget, isotropic_shell_factors};
pub use weights::{Bound, Conditions, FitError};

use crate::tensor::Vector;

/// Why a family cannot carry a law.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PdError {
    /// No bond has weight.
    #[error("no bond of it has any weight; widen the horizon or remove the point")]
    EmptyFamily,
    /// Moments cannot be met.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The shape tensor is singular.
    #[error(transparent)]
    Shape(#[from] ShapeError),
}

/// A [`PdError`] with its point.
#[derive(Clone, Debug, PartialEq)]
pub struct PointError<const D: usize> {
    /// Number of the point in its cloud.
    pub point: usize,
    /// Its position \[m\].
    pub position: Vector<D>,
    /// Number of its intact bonds.
    pub bonds: usize,
    /// Why.
    pub source: PdError,
}
