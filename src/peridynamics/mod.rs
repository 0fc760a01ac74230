//! Peridynamics: families, influence functions, bond weights, linearised laws and the body that they make.
//!
//! | file | what | source |
//! |---|---|---|
//! | `influence.rs` | influence functions ω, micromoduli λ | [SAND2015-7998] eq. (5.8), (3.1) |
//! | `horizon.rs` | the horizon of all points, of a lattice, or of each point | |
//! | `families.rs` | neighbour search with a horizon per point | eq. (5.2) |
//! | `cell_list.rs` | the grid of cells behind that search | |
//! | `lattice_families.rs` | the same for points of one lattice and one horizon, without a search | |
//! | `offset_table.rs` | a value for each bond of a lattice | |
//! | `bounded_least_norm.rs` | the smallest change of weights that meets linear conditions | |
//! | `alike.rs` | families that are translations of each other | |
//! | `shell_weights.rs` | isotropic weights of a lattice, shell by shell | eq. (3.6) as a sum |
//! | `moment_fitted_weights.rs` | moment-fitted weights of one irregular family | |
//! | `position_aware_influence.rs` | ω and σ of a position-aware family | section 4.2 |
//! | `shape_tensor.rs` | K and its inverse | section 7.2 |
//! | `law.rs` | interface of a law | |
//! | `departure.rs` | departure of a law from its linearisation | |
//! | `linear_force_state.rs` | its linearisation at rest; the collapsed tensor | eq. (2.10) |
//! | `force_state.rs` | its nonlinear response and history | eq. (2.6) |
//! | `laws/` | the laws, one file each | eq. (3.1), (4.11), (5.16), sections 6.2, 7.2 |
//! | `critical_stretch.rs` | critical stretch from the fracture energy | \[Silling2005\] |
//! | `softening.rs` | softening of bonds from strength and fracture energy | \[BazantOh1983\] |
//! | `zero_energy.rs` | control of the zero-energy modes of correspondence | section 6.3 |
//! | `failure/` | criteria by which bonds break, one file each | section 6.3, \[Silling2005\] |
//! | `crack_area.rs` | area of cracks from broken bonds | |
//! | `partial_volume/` | share of a cell in a family whose horizon cuts it | section 5.2.1 |
//! | `body.rs`, `body/` | the body: rows of the internal force, and partial stress | eq. (2.5), (2.19) |
//! | `cauchy_born.rs` | a law of elements with the stress of whole families | eq. (2.10) |
//! | `memoryless_family.rs` | the stress of a family without memory | eq. (2.19) |
//! | `contact.rs` | short-range contact between points without a bond | Parks et al. 2008 |
//! | `bond_force/` | bond passes: threaded internal force with damage, for motion | eq. (2.5) |

pub(crate) mod alike;
pub mod body;
pub mod bond_force;
pub mod bounded_least_norm;
mod cauchy_born;
mod cell_list;
pub mod contact;
mod crack_area;
pub mod critical_stretch;
mod departure;
pub mod failure;
pub mod families;
pub mod force_state;
mod horizon;
pub mod influence;
mod lattice_families;
pub mod law;
pub mod laws;
pub mod linear_force_state;
mod memoryless_family;
pub mod moment_fitted_weights;
pub(crate) mod offset_table;
pub mod partial_volume;
pub mod position_aware_influence;
pub mod shape_tensor;
pub mod shell_weights;
pub mod softened_plane;
pub mod softening;
pub mod zero_energy;

pub(crate) use body::FamilyEnds;
pub use body::{BondWeights, Cloud, Ends, Factors, PdBody};
pub use cauchy_born::{CauchyBorn, LatticeBonds};
pub use crack_area::CrackArea;
pub use critical_stretch::{BondEnergy, FractureError, critical_stretch, plane_energy};
pub use departure::{Departure, largest_extension};
pub use families::{Families, FamilyError, Reversed, TIE_TOLERANCE};
pub use force_state::{
    CauchyStress, DeformedFamily, EnergyDensity, ForceState, HistoryLayout, KeptDamage, Past,
    PointStress, Present,
};
pub use horizon::{BondHorizon, Horizon};
pub use influence::{Influence, Micromodulus};
pub use lattice_families::Wanted;
pub use law::{Accelerator, Calibrate, Law, Linearity, Mixture, Parameters};
pub use laws::{
    BondBased, Correspondence, Hardening, LinearPeridynamicSolid, Maxwell, NoMixture,
    PositionAwareSolid, Several, StiffnessMean,
};
pub use linear_force_state::{
    Family, FamilyMaterials, ForceStateKind, LinearForceState, StatePart, StressFit,
    collapsed_tensor,
};
pub use memoryless_family::MemorylessFamily;
pub use moment_fitted_weights::{Bound, FitError, MomentConditions};
pub use partial_volume::{BoxCell, PartialVolume, PartialVolumeError};
pub use position_aware_influence::{CalibrationFields, NotPositionAware};
pub use shape_tensor::{ShapeError, invert_shape_tensor};
pub use shell_weights::{LatticeFamily, ShellError, ShellTarget, isotropic_shell_factors};
pub use zero_energy::ZeroEnergyControl;

use crate::tensor::Vector;

/// Failure of a family to carry a law.
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
    /// Its energy cannot be that of elasticity.
    #[error(transparent)]
    PositionAware(#[from] NotPositionAware),
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
    /// Its error.
    pub source: PdError,
}
