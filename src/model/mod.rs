//! Model of a body that all couplings share: sites, peridynamic points, families, and the transfer of displacements to places that follow sites.
//!
//! | file | content | source |
//! |---|---|---|
//! | `zones.rs` | zones, roles of cells, and the demands of a coupling | |
//! | `problem.rs` | a body with its zones; horizon and points of its peridynamic part; errors | |
//! | `site.rs`, `coupled_model.rs` | sites; the model | |
//! | `layout.rs`, `sites.rs` | its layout | |
//! | `point_generation.rs`, `point_cloud.rs`, `point_materials.rs` | positions and volumes of points, which of them are needed, and their materials | |
//! | `multi_lattice.rs`, `completed_lattice.rs`, `continued_lattice.rs`, `lattice_axes.rs`, `lattice_box.rs` | one lattice of points, or several that elements keep apart; its axes; its points in a box | |
//! | `horizon_change.rs`, `horizon_regions.rs` | rules for bonds between points of different horizons | [SAND2015-7998] sections 2.2, 2.5; \[Jenabidehkordi2019\] |
//! | `bond_cutting.rs` | bonds that voids, cracks and surfaces cut; weights of a lattice | |
//! | `interface_interpolation.rs`, `least_squares_gradient.rs` | nodes that follow points | [SAND2015-7998] section 7.3 |
//! | `recovery.rs`, `recovery_patch.rs` | second derivatives at places in elements | \[ZienkiewiczZhu1992\] |
//! | `seam_order.rs` | cells of second order, which are linear at the seam | |
//! | `family_ends/` | families that end at feet on the faces of elements | `docs/truncated.md` |
//! | `sparse_factors.rs` | factors of the conditions that the fits at a seam have to meet | |
//! | `tributary/` | the part of the body that each site stands for: its mass, and the loads on it | |
//! | `loaded_places.rs` | the elements and the cells of points that facets belong to | |
//! | `field_evaluation.rs` | displacements and their gradients anywhere | |
//! | `distribution.rs` | which of several processes has which sites | |
//! | `shared_families.rs`, `shared_body.rs`, `held_families.rs` | families that are spread over processes | |
//! | `clearance.rs` | sizes of sites, and how far the body extends beyond them | |
//! | `crack_layers.rs` | area of cracks from the band of broken bonds | |
//! | `cut_shares.rs` | shares of families that voids and cracks have cut away | |
//! | `bins.rs`, `zone_distance.rs` | positions in bins; distances to zones | |
//!
//! No file here knows a method of coupling; [`ZoneLayout`] is all that a method demands.

pub(crate) mod bins;
pub(crate) mod bond_cutting;
pub(crate) mod clearance;
pub(crate) mod completed_lattice;
mod continued_field;
pub(crate) mod continued_lattice;
pub(crate) mod coupled_model;
pub(crate) mod crack_layers;
mod cut_shares;
mod distribution;
pub(crate) mod family_ends;
pub mod field_evaluation;
pub(crate) mod held_families;
pub(crate) mod horizon_change;
pub(crate) mod horizon_regions;
pub(crate) mod interface_interpolation;
pub(crate) mod lattice_axes;
pub(crate) mod lattice_box;
mod layout;
pub mod least_squares_gradient;
pub(crate) mod loaded_places;
pub(crate) mod multi_lattice;
pub mod patch;
pub mod point_cloud;
pub(crate) mod point_generation;
pub(crate) mod point_materials;
pub mod problem;
pub(crate) mod recovery;
pub(crate) mod recovery_patch;
pub(crate) mod seam_order;
mod shared_body;
pub mod shared_families;
mod simplex;
mod site;
mod sites;
pub(crate) mod sparse_factors;
pub mod tributary;
pub mod zone_distance;
mod zones;

pub use bins::{Bins, bin_of};
pub use coupled_model::Model;
pub use field_evaluation::{Carrier, Sampler};
pub use horizon_change::HorizonChange;
pub use least_squares_gradient::FitDegree;
pub use problem::{
    ElasticCells, HorizonField, Lattice, ModelError, Peridynamics, PointSource, ScalarField,
    Surfaces, ZonedBody,
};
pub use shared_families::{Distribution, SharedFamilies};
pub use site::{Site, SiteKind};
pub use tributary::Tributary;
pub use zones::{CellRole, Interface, Reach, Zone, ZoneLayout};
