//! Couplings of a finite-element region to a peridynamic region. The surface between the two is the *seam*.
//!
//! | file | method | source |
//! |---|---|---|
//! | `uncoupled.rs` | finite elements alone, peridynamics alone | |
//! | `splice.rs` | each site has the equation of its own model | [SAND2015-7998] eq. (2.30) |
//! | `blending.rs` | force-based blending with a blending function β | eq. (3.9), (3.11), (3.12), (3.13), (3.14) |
//! | `balanced.rs` | rows between a splice's and a blending's, whose out-of-balance forces cancel to leading order | `docs/methods.md` |
//! | `truncated/` | truncated bonds: symmetric, patch-exact, in equilibrium | `docs/truncated.md` |
//! | `truncated_families/` | the same for laws whose points have a stress, patch-exact at any strain | `docs/truncated.md` |
//! | `partial_stress.rs`, `partial_stress_elements.rs` | partial stress, meshfree and in finite elements | eq. (2.19), (2.20), (2.29), sections 7.2, 7.3 |
//! | `exact_stresses.rs` | partial stresses of geometrically exact bonds | eq. (2.19) |
//! | `terms.rs` | the sum of terms that every method returns, `f(u) = Σ R_k F_k(T u)` | |
//! | `stresses.rs` | partial stresses as a term | eq. (2.19), (2.29) |
//! | `problem.rs` | a body with its zones and a coupling | |
//! | `rows.rs` | shared: rows of elements, the assembled stiffness | |
//! | `error_indicator.rs` | error of the local model, and places where a bond could break | |
//! | `cauchy_born.rs` | elements with the stress of the points' bonds at any stretch (Cauchy–Born) | eq. (2.10) |
//! | `semidiscrete.rs`, `semidiscrete/` | a coupled model in motion: bonds that stretch and break, beside linear rows | |
//! | `impact.rs`, `impact/` | contact with rigid impactors, as a force term | |
//! | `state_transfer.rs` | transfer of a motion to another layout of zones | |
//! | `crate::model` | sites, points, families and the transfer, shared by all methods | |
//! | `crate::assembly` | rows, and places expressed through sites | |
//!
//! A *site* is a node or a peridynamic point with degrees of freedom, and has one row of the stiffness. The truncated couplings derive their rows from an energy. All others are *force-based*: a row is
//! the internal force by the model that holds at the site. If each row vanishes by itself under every affine field, the patch test passes. A seam must therefore provide (a) complete families and complete
//! patches of cells around every site and (b) displacements outside a site's own region that are interpolated exactly for affine fields.
//! A new method is a file with a [`Coupling`], a line in this table and an entry in the scene (`docs/extending.md`).

/// Implements [`Coupling`] by the function `rows` of a method, compiled here for one, two and three dimensions.
macro_rules! coupling_by_rows {
    ($method:ident) => {
        impl<const D: usize> $crate::coupling::Coupling<D> for $method {
            fn operator<'a>(&self, model: &'a Model<D>) -> Result<Operator<'a, D>, ModelError> {
                type Rows<const D: usize> =
                    for<'a> fn(&$method, &'a Model<D>) -> Result<Operator<'a, D>, ModelError>;
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
mod stresses;
mod terms;
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
pub use stresses::{NO_GAUSS_POINT, PartialStresses, StressesOn};
pub use terms::{AddRow, BodyBonds, BondsOfSite, Definiteness, Operator, SeamBonds, Term};
pub use truncated::{NonlinearSeam, Truncated};
pub use truncated_families::TruncatedFamilies;
pub use uncoupled::{Local, Nonlocal};

use crate::model::{Model, ModelError, ZoneLayout};

/// A method that couples both regions.
pub trait Coupling<const D: usize>: ZoneLayout<D> {
    /// The internal force of the model by this method, as a sum of terms.
    ///
    /// # Errors
    /// [`ModelError`] if the method cannot be applied to this model, with the remedy.
    fn operator<'a>(&self, model: &'a Model<D>) -> Result<Operator<'a, D>, ModelError>;
}
