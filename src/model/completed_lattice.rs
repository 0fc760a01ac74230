//! One lattice of points with its families, before it is part of a body.

use super::bond_cutting::LatticeFactors;
use super::held_families::HeldFamilies;
use super::horizon_regions::InteractionFactors;
use super::point_cloud::PointCloud;
use super::shared_families::SharedFamilies;
use crate::peridynamics::Families;

/// One lattice on its way into the body.
pub(crate) struct CompletedLattice<const D: usize> {
    pub cloud: PointCloud<D>,
    pub families: Families,
    pub passing: Option<Families>,
    pub factors: LatticeFactors<D>,
    /// All points before any is dropped, with their new numbers, where elements need them.
    pub wide: Option<(PointCloud<D>, Vec<u32>)>,
    pub is_constant: bool,
    /// Factors of bonds between horizons, where a rule has such.
    pub interaction: Option<InteractionFactors>,
    /// Distribution of the families, where they are spread over processes.
    pub shared: Option<SharedFamilies>,
    /// Which families a process would hold, where they can be spread over processes.
    pub held: Option<HeldFamilies>,
}
