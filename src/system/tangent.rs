//! The tangent of a system that moves, as far as steps, solvers and loads of heat ask for it.

use super::{BlockCsr, ElementTangent, Interval, Symmetry};

/// Tangent of a system at rest and at a displacement.
///
/// Shapes: `x`, `y`, `u` and the row sums have [`SemiDiscrete::block`](super::SemiDiscrete::block) numbers per site. Every method is required, so that a system that wraps another one cannot lose an answer of it.
pub trait Tangent {
    /// `y = K x` with the tangent `K` at rest, broken bonds left out.
    fn tangent_into(&self, x: &[f64], y: &mut [f64]);

    /// The displacement \[m\] over which forces are differenced where the tangent at a displacement is wanted, far below the distance of sites; none where forces with bonds held
    /// are linear, so that the tangent at rest is that at any displacement.
    fn difference_length(&self) -> Option<f64>;

    /// For every unknown an upper bound of `Σ_b |K_ab|` \[N/m\], with the tangent at rest and, on top of it, contact.
    fn row_sums(&self) -> Vec<f64>;

    /// Returns true for each site whose tangent, its row and its column, never changes; false for all if the system does not know.
    fn tangent_is_constant(&self) -> Vec<bool>;

    /// Rows of the tangent at rest, in the order of `sites`: those of [`Tangent::tangent_is_constant`] sites and of sites that these are columns of. Without any row if the system does not know.
    fn tangent_rows(&self, sites: &[u32]) -> BlockCsr;

    /// The sites at which rows of the tangent may differ from their columns; all of them if the system does not know.
    fn seam_sites(&self) -> Vec<u32>;

    /// Returns the symmetry of the tangent; if it is symmetric there is an energy to conserve.
    fn symmetry(&self) -> Symmetry;

    /// Returns the part of the tangent that finite elements add to that at rest at a displacement that ends an interval, in closed form; none if no element's law is nonlinear, or if the system does not know.
    fn element_tangent(&self, u: &[f64], interval: Interval) -> Option<ElementTangent>;
}
