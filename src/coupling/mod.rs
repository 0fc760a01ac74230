//! Couplings of a finite-element region to a peridynamic region, behind one seam.
//!
//! | file | method | source |
//! |---|---|---|
//! | `uncoupled.rs` | pure FE, pure PD: ordinary values of the same switch | |
//! | `splice.rs` | each site takes the equation of its own model | [SAND2015-7998] eq. (2.30) |
//! | `blending.rs` | force-based blending with a blending function β | eq. (3.9), (3.11), (3.12), (3.13), (3.14) |
//! | `balanced.rs` | half of a splice's rows, half of a blending's: no force out of balance under quartic fields | `docs/methods.md` |
//! | `truncated/` | truncated bonds: symmetric, patch-exact, in equilibrium | `docs/truncated.md` |
//! | `truncated_families/` | the same of laws whose points have a stress: symmetric, patch-exact at any strain, in equilibrium | `docs/truncated.md` |
//! | `partial_stress.rs`, `partial_stress_elements.rs` | partial stress, meshfree and in finite elements | eq. (2.19), (2.20), (2.29), sections 7.2, 7.3 |
//! | `exact_stresses.rs` | partial stresses of geometrically exact bonds | eq. (2.19) |
//! | `problem.rs` | a body with its zones and a coupling | |
//! | `rows.rs` | shared: rows of elements, the assembled stiffness | |
//! | `error_indicator.rs` | where the local model would be wrong, and where a bond could break | |
//! | `cauchy_born.rs` | elements that follow the bonds of the points at any stretch | eq. (2.10) |
//! | `semidiscrete.rs`, `semidiscrete/` | a model that moves: bonds that stretch and break beside the rows of the rest | |
//! | `impact.rs`, `impact/` | rigid impactors that push the sites of a model that moves, as a force term | |
//! | `state_transfer.rs` | a motion handed from one layout of zones to another | |
//! | `crate::model` | sites, points, families and the transfer, on which all methods stand | |
//! | `crate::assembly` | rows, and places expressed through sites | |
//!
//! Every method is *force-based*: each site has one row, its internal force by the model that holds there. A row that vanishes under
//! every affine field, whatever its neighbours' rows are, makes the patch test pass; so all that a seam must provide is (a) complete families and complete patches of
//! cells around every site and (b) places outside a site's own region whose displacement is interpolated exactly for affine fields.
//! A method is one file with a [`Coupling`], one line here and its entry in the scene.

/// Implements [`Coupling`] by the function `rows` of a method, compiled here for one, two and three dimensions.
macro_rules! coupling_by_rows {
    ($method:ident) => {
        impl<const D: usize> $crate::coupling::Coupling<D> for $method {
            fn operator<'a>(
                &self,
                model: &'a Model<D>,
            ) -> Result<Box<dyn Operator<D> + 'a>, ModelError> {
                type Rows<const D: usize> =
                    for<'a> fn(
                        &$method,
                        &'a Model<D>,
                    ) -> Result<Box<dyn Operator<D> + 'a>, ModelError>;
                static ROWS: (Rows<1>, Rows<2>, Rows<3>) =
                    ($method::rows, $method::rows, $method::rows);
                $crate::dimension::of::<Rows<D>>(&ROWS)(self, model)
            }
        }
    };
}

pub mod balanced;
pub mod blending;
mod cauchy_born;
pub mod error_indicator;
mod exact_stresses;
pub mod impact;
#[cfg(test)]
mod layout_tests;
pub mod partial_stress;
pub mod partial_stress_elements;
mod partial_stress_fit;
pub mod problem;
mod rows;
mod second_gradients;
pub mod semidiscrete;
pub mod splice;
pub mod state_transfer;
pub mod truncated;
pub mod truncated_families;
pub mod uncoupled;

pub use balanced::Balanced;
pub use blending::{Blending, BlendingFunction};
pub use exact_stresses::ExactStresses;
pub use impact::{ContactPatch, Impact, ImpactorShape, RigidImpactor};
pub use partial_stress::PartialStressMeshfree;
pub use partial_stress_elements::PartialStressElements;
pub use problem::{LaidOut, Problem};
pub use semidiscrete::CoupledSystem;
pub use splice::Splice;
pub use state_transfer::{BrokenBonds, Carried, CarryError, Carrying};
pub use truncated::{NonlinearSeam, Truncated};
pub use truncated_families::TruncatedFamilies;
pub use uncoupled::{Local, Nonlocal};

use crate::{
    assembly::Row,
    model::{Model, ModelError, ZoneLayout},
    tensor::Tensor,
};

/// A method that couples both regions.
pub trait Coupling<const D: usize>: ZoneLayout<D> {
    /// Prepares what the rows need.
    ///
    /// # Errors
    /// [`ModelError`] if the method cannot be applied to this model, with the remedy.
    fn operator<'a>(&self, model: &'a Model<D>) -> Result<Box<dyn Operator<D> + 'a>, ModelError>;
}

/// Evidence that the energy behind symmetric rows is never negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Definiteness {
    /// It is a sum of squares, whatever the model is.
    SumOfSquares,
    /// It is one but for small terms of either sign, along the edges of a nonlocal zone in 3D or where two influence functions of a law differ. They cancel under affine fields; the matrix at hand decides about others.
    EdgeTerms,
    /// Terms of the seam are negative: a run factorises the matrix before it trusts it.
    NegativeTerms,
}

/// Rows that hold bonds of the body among other terms: a nonlinear system computes the forces of those bonds, and the rest stays a row.
pub trait MixedRows<const D: usize>: Sync {
    /// Returns true if the row of a site is not that of the body alone, but holds bonds of the body.
    fn has_body_bonds(&self, site: usize) -> bool;

    /// Returns true if a bond between two points of the body's cloud, the first with [`MixedRows::has_body_bonds`], is one of those. A bond that the seam cuts is not: as one of the body it would pull at its point as it rotates, and at the finite elements as if it did not.
    fn is_body_bond(&self, i: usize, j: usize) -> bool;

    /// Adds the row of a site that [`MixedRows::has_body_bonds`], less the bonds of the body.
    fn add_row_beside_bonds(&self, site: usize, row: &mut Row<D>);
}

/// Stresses of cells that are partial stresses at their Gauss points.
pub trait CellStresses<const D: usize>: Sync {
    /// The mean partial stress of a cell; none of a cell whose stress is that of its own law.
    fn cell_stress(&self, cell: usize, u: &[f64]) -> Option<Tensor<D>>;

    /// The sum of [`CellStresses::cell_stress`] over cells, for displacements that have one component: entry `[f][c]` is that of `u_c` = field `f`, the others zero.
    ///
    /// Shapes: each field has one number per site. One pass over the families does for all fields.
    fn sums_of_cell_stress(&self, cells: &[usize], fields: &[Vec<f64>]) -> Vec<[Tensor<D>; D]>;
}

/// Adds to the row of a site.
pub type AddRow<'a, const D: usize> = dyn Fn(usize, &mut Row<D>) + Sync + 'a;

/// Bonds of a seam that a nonlinear system takes over.
pub struct SeamBonds<'a, const D: usize> {
    /// The bonds, which may be geometrically exact, and break.
    pub bonds: NonlinearSeam<D>,
    /// Adds what is left of the row of a site without them.
    pub add_rest: Box<AddRow<'a, D>>,
}

/// The rows of a coupled model. Every method is required: rows without bonds of a seam say so.
pub trait Operator<const D: usize>: Sync {
    /// Adds the internal force of a site, times −1 (`K u = f`).
    fn add_row(&self, site: usize, row: &mut Row<D>);

    /// The blending function β of a site: 1 where it is peridynamic, 0 where it is local.
    fn beta(&self, site: usize) -> f64;

    /// Returns true if the row of a site is that of the peridynamic body alone, all of its bonds whole: only there may bonds be geometrically exact, and break.
    fn is_body_row(&self, site: usize) -> bool;

    /// Returns true if rows count elements and bonds by their materials, [`Row::count_only`]: only then do materials expand differently at the seam.
    fn counts_materials(&self) -> bool;

    /// The bonds of the body that rows hold among other terms, where the operator has such rows.
    fn mixed_rows(&self) -> Option<&dyn MixedRows<D>>;

    /// The bonds of a seam that may be geometrically exact, and break, where the operator has such, and what rows are without them.
    fn seam_bonds(&self) -> Option<SeamBonds<'_, D>>;

    /// The partial stresses that rows of sites have, where the operator has such: of geometrically exact bonds a nonlinear system adds what is not linear in them.
    fn exact_stresses(&self) -> Option<ExactStresses<D>>;

    /// Returns the evidence that the energy behind symmetric rows is never negative. Rows that are not symmetric have no such energy, and no run relies on what they say here.
    fn definiteness(&self) -> Definiteness;

    /// Number of directed bonds that the method adds to those of the peridynamic body (Gauss points).
    fn additional_bonds(&self) -> usize;

    /// The stresses of cells that follow the partial stress of bonds, where the operator has such cells.
    fn cell_stresses(&self) -> Option<&dyn CellStresses<D>>;
}
