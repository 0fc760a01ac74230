//! Finite elements: cells, quadrature, the element kernel, loads, and where a point lies in a mesh.
//!
//! # Weak form
//!
//! Find u, equal to the prescribed displacement where one is prescribed, such that for every test field v that
//! vanishes there
//!
//! ```text
//!   ∫ ∇v : σ(∇u) dV  =  ∫ v · b dV + ∫ v · t dA          σ = C : ∇u
//! ```
//!
//! With `u = Σ_b u_b N_b` and `v = e_i N_a` this is `K u = f`:
//!
//! ```text
//!   K_ab,ik = ∫ ∂N_a/∂x_j C_ijkl ∂N_b/∂x_l dV      f_a = ∫ N_a b dV + ∫ N_a t dA
//! ```
//!
//! The integrals are sums over quadrature points `x_q = Σ N_a(ξ_q) x_a` of weight `|det J| w_q`, `J = ∂x/∂ξ`, and
//! `∂N_a/∂x = J⁻ᵀ ∂N_a/∂ξ`. The internal force of a node is `−Σ_b K_ab u_b`: the force that the body exerts on it.
//!
//! # Notation
//!
//! | symbol | code | meaning | unit |
//! |---|---|---|---|
//! | ξ | `reference`, `xi` | reference coordinates of a cell | 1 |
//! | N_a | `shape[a]` | shape function of local node a | 1 |
//! | ∂N_a/∂x | `gradient[a]` | its gradient in space | 1/m |
//! | `abs(det J) w` | `weight` | quadrature weight | m^D |
//! | G | `gradient` | displacement gradient `G_ij = ∂u_i/∂x_j` | 1 |
//! | C | `tangent` | stiffness tensor of the law | Pa |
//! | b, t | | body force per volume, traction | N/m^D, Pa |
//!
//! # Files
//!
//! | file | what |
//! |---|---|
//! | `cell.rs` | description of a reference cell |
//! | `line2.rs`, `tri3.rs`, `quad4.rs`, `tet4.rs`, `hex8.rs` | one linear cell each |
//! | `line3.rs`, `tri6.rs`, `quad8.rs`, `tet10.rs`, `hex20.rs` | one cell of second order each |
//! | `geometry.rs` | places of nodes, Jacobians, normals of facets |
//! | `element.rs` | quadrature points in space, block rows of an element's stiffness, fields at a point |
//! | `superconvergent.rs` | the displacement gradient anywhere in a cell, from where it is most accurate |
//! | `cut.rs` | quadrature rules of a part of a cell |
//! | `divided.rs` | quadrilaterals and hexahedra that are linear in simplices around their middle |
//! | `crack_band.rs` | the width in which a law that softens localises in a cell |
//! | `nonlinear.rs`, `nonlinear/` | elements of a law that is not linear: their excess over the linear ones, and their history variables |
//! | `load.rs` | consistent nodal forces of tractions and body forces |
//! | `locate.rs` | from a point in space to a cell and its shape functions |
//! | `conduction.rs` | matrices of heat conduction |
//! | `nodal_field.rs` | a scalar field by its values at nodes |
//! | `lumping.rs` | lumped volumes and masses, body forces beside these |
//! | `body.rs` | the check that elements can live on the cells of a body |
//!
//! A new cell is one file, one line in [`CELLS`], and its variant of [`CellShape`].

mod body;
mod cell;
mod conduction;
mod crack_band;
mod cut;
mod divided;
mod element;
mod geometry;
mod hex20;
mod hex8;
mod line2;
mod line3;
mod load;
mod locate;
mod lumping;
mod nodal_field;
mod nonlinear;
mod quad4;
mod quad8;
mod superconvergent;
mod tet10;
mod tet4;
mod tri3;
mod tri6;

#[cfg(test)]
pub(crate) mod sample;
#[cfg(test)]
mod second_order_tests;

pub use body::{FemError, check};
pub use cell::{MAX_NODES, PerNode, ReferenceCell, Rule, RulePoint};
pub use conduction::{add_heat_transfer, conductance, heat_capacity};
pub use crack_band::{CellBandError, banded_law, crack_band};
pub use cut::{places_of_part, rule_of_parts};
pub use divided::may_be_divided;
pub use element::{
    QuadraturePoint, cell_volume, displacement_gradient, displacement_gradient_at,
    displacement_gradient_at_centre, for_each_point, quadrature, row_at, shape_values,
    stiffness_into,
};
pub use load::{
    FacetPoint, body_force_vector, facet_area, facet_normals, facet_points, outward_points,
    outward_traction_vector, traction_vector,
};
pub use locate::{Located, Locator, reference_of};
pub use lumping::{for_each_share, lumped_body_force_vector, nodal_volumes};
pub use nodal_field::NodalField;
pub use nonlinear::NonlinearElements;
pub use superconvergent::{place_in, position_in, superconvergent_gradient};

use crate::mesh::CellShape;

/// Every cell that an element can live on.
pub static CELLS: &[&ReferenceCell] = &[
    &line2::CELL,
    &tri3::CELL,
    &quad4::CELL,
    &tet4::CELL,
    &hex8::CELL,
    &line3::CELL,
    &tri6::CELL,
    &quad8::CELL,
    &tet10::CELL,
    &hex20::CELL,
];

/// The cell of a shape; `None` for a shape on which no element lives (a vertex).
pub fn reference_cell(shape: CellShape) -> Option<&'static ReferenceCell> {
    CELLS.iter().copied().find(|cell| cell.shape == shape)
}
