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
//! | `problem.rs` | what a coupled problem consists of | |
//! | `model.rs`, `sites.rs`, `rows.rs` | shared: sites, families, what completes them; rows of elements, the assembled stiffness | |
//! | `distribution.rs` | which of several processes has which sites | |
//! | `shared_families.rs`, `shared_body.rs`, `held_families.rs` | families that are spread over processes; which of them each has | |
//! | `multi_lattice.rs`, `completed_lattice.rs`, `lattice_axes.rs`, `lattice_box.rs` | shared: one lattice of points, or several that elements keep apart; its axes; its points in a box | |
//! | `point_generation.rs`, `point_cloud.rs`, `bond_cutting.rs` | shared: where PD points lie, which are needed, which bonds are cut and how they are weighted | |
//! | `point_materials.rs` | shared: the materials of points, in a body of several | |
//! | `seam_order.rs` | shared: cells of second order, which are linear at the seam | |
//! | `recovery.rs` | shared: second derivatives at places in elements | \[ZienkiewiczZhu1992\] |
//! | `least_squares_gradient.rs`, `interface_interpolation.rs`, `zone_distance.rs`, `field_evaluation.rs`, `bins.rs` | shared: least squares, nodes that follow points, distances, displacements anywhere | |
//! | `sparse_factors.rs` | factors of the conditions that the fits at a seam have to meet | |
//! | `error_indicator.rs` | where the local model would be wrong, and where a bond could break | |
//! | `cauchy_born.rs` | elements that follow the bonds of the points at any stretch | eq. (2.10) |
//! | `tributary/` | the part of the body that each site stands for: its mass, and the loads on it | |
//! | `semidiscrete.rs`, `semidiscrete/` | a model that moves: bonds that stretch and break beside the rows of the rest | |
//! | `loaded_places.rs` | the elements and the cells of points that facets belong to | |
//! | `impact.rs`, `impact/` | rigid impactors that push the sites of a model that moves, as a force term | |
//! | `state_transfer.rs` | a motion handed from one layout of zones to another | |
//! | `crate::assembly` | rows, and places expressed through sites | |
//!
//! Every method is *force-based*: each site has one row, its internal force by the model that holds there. A row that vanishes under
//! every affine field, whatever its neighbours' rows are, makes the patch test pass; so all that a seam must provide is (a) complete families and complete patches of
//! cells around every site and (b) places outside a site's own region whose displacement is interpolated exactly for affine fields.
//! A method is one file with a [`Coupling`], one line here and its entry in the scene.

pub mod balanced;
mod bins;
pub mod blending;
mod bond_cutting;
mod cauchy_born;
mod completed_lattice;
mod distribution;
pub mod error_indicator;
mod exact_stresses;
pub mod field_evaluation;
mod held_families;
pub mod impact;
mod interface_interpolation;
mod lattice_axes;
mod lattice_box;
pub mod least_squares_gradient;
pub(crate) mod loaded_places;
pub mod model;
mod multi_lattice;
pub mod partial_stress;
pub mod partial_stress_elements;
pub mod point_cloud;
mod point_generation;
mod point_materials;
pub mod problem;
mod recovery;
mod rows;
mod seam_order;
pub mod semidiscrete;
mod shared_body;
pub mod shared_families;
mod sites;
mod sparse_factors;
pub mod splice;
pub mod state_transfer;
pub mod tributary;
pub mod truncated;
pub mod truncated_families;
pub mod uncoupled;
pub mod zone_distance;

pub use balanced::Balanced;
pub use bins::{Bins, bin_of};
pub use blending::{Blending, BlendingFunction};
pub use exact_stresses::ExactStresses;
pub use field_evaluation::{Carrier, Sampler};
pub use impact::{ContactPatch, Impact, ImpactorShape, RigidImpactor};
pub use least_squares_gradient::FitDegree;
pub use model::{Model, Site, SiteKind};
pub use partial_stress::PartialStressMeshfree;
pub use partial_stress_elements::PartialStressElements;
pub use problem::{
    HorizonField, Lattice, ModelError, Peridynamics, PointSource, Problem, ScalarField, Surfaces,
};
pub use semidiscrete::CoupledSystem;
pub use shared_families::{Distribution, SharedFamilies};
pub use splice::Splice;
pub use state_transfer::{BrokenBonds, Carried, CarryError, Carrying};
pub use tributary::Tributary;
pub use truncated::{NonlinearSeam, Truncated};
pub use truncated_families::TruncatedFamilies;
pub use uncoupled::{Local, Nonlocal};

use crate::{assembly::Row, mesh::Mesh, peridynamics::LinearForceState, system::Symmetry};

/// The model that a scene asks for in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Zone {
    /// Classical elasticity by finite elements, `B_0`.
    Local,
    /// Between the two: blending region `B_b` or partial-stress region `B_ps`.
    Transition,
    /// Peridynamics, `B_pd`.
    Nonlocal,
}

/// Role of a cell in a coupling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CellRole {
    /// A finite element with the local law.
    Element,
    /// A finite element whose stress is the partial stress at its Gauss points.
    StressElement,
    /// Filled with peridynamic points.
    Points,
}

/// Extent to which families have to be complete around the sites that are peridynamic points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    /// Their own families.
    Own,
    /// The families of their neighbours too: force states or stresses of the neighbours enter the row.
    Neighbours,
}

/// Which nodes of finite elements at the seam are sites, and which follow the sites around them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// Nodes of the seam are sites; the elements overlap into the peridynamic zone by one cell, whose far nodes follow the PD points around them.
    Overlap,
    /// Nodes of the seam follow a least-squares fit to the sites within a horizon, [SAND2015-7998] section 7.3.
    Constrained(FitDegree),
    /// Nodes of the seam are sites with the rows of their own elements only: nothing overlaps, and bonds end on the faces of elements.
    Faces,
    /// As [`Interface::Faces`], where families end at places on the faces.
    Feet,
}

/// A method that couples both regions.
pub trait Coupling<const D: usize>: Send + Sync {
    /// Its usual name.
    fn name(&self) -> &'static str;

    /// Returns the symmetry of the stiffness.
    fn symmetry(&self) -> Symmetry {
        Symmetry::Unsymmetric
    }

    /// Returns the role of each cell, given the zones that the scene asks for.
    fn roles(&self, mesh: &Mesh<D>, zones: &[Zone], largest_horizon: f64) -> Vec<CellRole>;

    /// Returns the extent to which families have to be complete.
    fn reach(&self, law: &dyn LinearForceState<D>) -> Reach {
        if law.is_pairwise() {
            Reach::Own
        } else {
            Reach::Neighbours
        }
    }

    /// Returns the depth, in families from the elements, within which every process needs the families of all points; elsewhere it may hold those of its own alone. None if that is not known.
    ///
    /// Rows of sites beside a seam take the families of several, and every process works out and proves all of a seam.
    fn families_of_all(&self, _law: &dyn LinearForceState<D>) -> Option<usize> {
        None
    }

    /// Returns true if processes may also hold families so in motion: which rows are those of the body alone, and where these end, does not depend on families that lie elsewhere.
    fn moves_with_own_families(&self) -> bool {
        false
    }

    /// Returns true if its rows hold the products of dilatations and deviatoric extensions of a law with [`LinearForceState::has_deviators`]; any other coupling is refused for such a law.
    fn takes_deviators(&self) -> bool {
        false
    }

    /// The treatment of nodes at the seam.
    fn interface(&self) -> Interface {
        Interface::Overlap
    }

    /// Prepares what the rows need.
    ///
    /// # Errors
    /// [`ModelError`] if the method cannot be applied to this model, with the remedy.
    fn operator<'a>(&self, model: &'a Model<D>) -> Result<Box<dyn Operator<D> + 'a>, ModelError>;
}

/// [`Coupling::operator`] of the method `C` in `D` dimensions.
type Rows<C, const D: usize> =
    for<'a> fn(&C, &'a Model<D>) -> Result<Box<dyn Operator<D> + 'a>, ModelError>;

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

/// Adds to the row of a site.
pub type AddRow<'a, const D: usize> = dyn Fn(usize, &mut Row<D>) + Sync + 'a;

/// Bonds of a seam that a nonlinear system takes over.
pub struct SeamBonds<'a, const D: usize> {
    /// The bonds, which may be geometrically exact, and break.
    pub bonds: NonlinearSeam<D>,
    /// Adds what is left of the row of a site without them.
    pub add_rest: Box<AddRow<'a, D>>,
}

/// The rows of a coupled model.
pub trait Operator<const D: usize>: Sync {
    /// Adds the internal force of a site, times −1 (`K u = f`).
    fn add_row(&self, site: usize, row: &mut Row<D>);

    /// The blending function β of a site: 1 where it is peridynamic, 0 where it is local.
    fn beta(&self, site: usize) -> f64;

    /// Returns true if the row of a site is that of the peridynamic body alone, all of its bonds whole: only there may bonds be geometrically exact, and break.
    fn is_body_row(&self, site: usize) -> bool;

    /// Returns true if rows count elements and bonds by their materials, [`Row::count_only`]: only then do materials expand differently at the seam.
    fn counts_materials(&self) -> bool {
        false
    }

    /// The bonds of the body that rows hold among other terms, where the operator has such rows.
    fn mixed_rows(&self) -> Option<&dyn MixedRows<D>>;

    /// The bonds of a seam that may be geometrically exact, and break, where the operator has such, and what rows are without them.
    fn seam_bonds(&self) -> Option<SeamBonds<'_, D>>;

    /// The partial stresses that rows of sites have, where the operator has such: of geometrically exact bonds a nonlinear system adds what is not linear in them.
    fn exact_stresses(&self) -> Option<ExactStresses<D>>;

    /// Returns the evidence that the energy behind symmetric rows is never negative.
    fn definiteness(&self) -> Definiteness {
        Definiteness::SumOfSquares
    }

    /// Number of directed bonds that the method adds to those of the peridynamic body (Gauss points).
    fn additional_bonds(&self) -> usize {
        0
    }

    /// The mean partial stress of a cell whose stress is the partial stress at its Gauss points.
    fn cell_stress(&self, _cell: usize, _u: &[f64]) -> Option<crate::tensor::Tensor<D>> {
        None
    }

    /// The sum of [`Operator::cell_stress`] over cells, for displacements that have one component: entry `[f][c]` is that of `u_c` = field `f`, the others zero.
    ///
    /// Shapes: each field has one number per site; empty where no cell has such a stress. One pass over the families does for all fields.
    fn sums_of_cell_stress(
        &self,
        _cells: &[usize],
        _fields: &[Vec<f64>],
    ) -> Vec<[crate::tensor::Tensor<D>; D]> {
        Vec::new()
    }
}
