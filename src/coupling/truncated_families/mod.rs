//! Truncated families: the seam of laws whose points have a stress (correspondence), symmetric, patch-exact at any strain and in exact equilibrium.
//!
//! | file | what |
//! |---|---|
//! | `rows.rs` | the coupling: rows that are gradients of the energy |
//! | `crate::model::family_ends` | places on the faces of elements at which families end, and the weights that balance every uniform stress |
//!
//! The energy is that of the finite elements and of the points in the nonlocal zone, `Σ V_p W(F̄_p)`, in which a family has no points beyond the faces of the zone: it ends at *feet*, places on the faces that follow the
//! nodes of the elements there. With `F̄_p = I + Σ_q (u_q − u_p) ⊗ b_pq`, `b_pq = ω_pq V_q K_p⁻¹ ξ_pq`, every affine field has its own gradient, and the forces on points and nodes are those of an energy, whatever the local law is: a uniform stress P leaves
//! on a point q the force `P · Σ_p V_p b_pq`. These sums vanish between whole families; at the seam, weights are so changed that they do there too, and that feet give the nodes of a face the traction `∫ N n dA` that its elements lack.
//! Such conditions are those of variationally consistent integration, \[ChenHillmanRueter2013\], met here by the weights of both test and trial functions, so that the stiffness stays symmetric.

mod rows;

pub use rows::TruncatedFamilies;
