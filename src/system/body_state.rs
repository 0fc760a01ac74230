//! The state of a body whose bonds break or whose laws are not linear, as results show it.

use super::PlaceStress;

/// State of the peridynamic body and of the elements of a system.
///
/// Shapes: displacements `u` have the unknowns of the body first; those of terms beside it may follow.
pub trait BodyState {
    /// Damage of each site, `1 − Σ V of intact bonds / Σ V of all`; none if nothing can break.
    fn damage(&self) -> Option<Vec<f64>>;

    /// A site at which damage has reached the edge of the region where bonds can break, if it has: what is computed from then on is not to be trusted.
    fn damage_at_edge(&self) -> Option<usize>;

    /// Sites with a broken bond, ascending in the order of their points.
    fn damaged_sites(&self) -> Vec<u32>;

    /// Broken bonds by the sites of their ends, each once for each direction; without those that a seam cuts.
    fn broken_bonds(&self) -> Vec<(u32, u32)>;

    /// Area of the cracks that broken bonds have left, those that a seam cuts among them \[m^(D−1)\]. Collective where families are spread.
    fn crack_area(&self) -> f64;

    /// Number of points that have lost so many bonds that their law does not respond: they carry no stress of their own.
    fn points_without_response(&self, u: &[f64]) -> usize;

    /// History variables of the law at each site, by name; zero for a site without history.
    fn remembered(&self) -> Vec<(&'static str, Vec<f64>)>;

    /// Numbers that the local laws of finite elements remember, by name and cell.
    fn remembered_by_cells(&self) -> Vec<(&'static str, Vec<(u32, f64)>)>;

    /// Cauchy stress of a site by its force state; none where that is linear, or has no memory and follows from the displacement alone.
    fn stress_of_site(&self, site: usize, u: &[f64]) -> Option<PlaceStress>;

    /// Mean Cauchy stress of a cell whose law is not linear; none of any other.
    fn stress_of_cell(&self, cell: usize, u: &[f64]) -> Option<PlaceStress>;

    /// Energy density \[J/m^D\] of each site, zero but at points; none if it follows from the displacements by the linear force states.
    fn energy_densities(&self, u: &[f64]) -> Option<Vec<f64>>;

    /// Mean stored energy per volume of a cell whose law is not linear \[J/m^D\]; none of any other.
    fn energy_of_cell(&self, cell: usize, u: &[f64]) -> Option<f64>;
}
