//! Truncated families: the seam of laws whose points have a stress (correspondence), symmetric, patch-exact at any strain and in exact equilibrium.
//!
//! | file | content |
//! |---|---|
//! | `rows.rs` | the coupling: rows that are gradients of the energy |
//! | `crate::model::family_ends` | places on the faces of elements at which families end, and the weights that balance every uniform stress |
//!
//! The energy is that of the finite elements and of the points in the nonlocal zone, `Σ V_p W(F̄_p)` with the energy density W \[J/m^D\] of a local law. A family does not reach beyond the faces of the zone. It ends there at *feet*: places on the faces with the displacement
//! of the elements behind. With `F̄_p = I + Σ_q (u_q − u_p) ⊗ b_pq` and `b_pq = ω_pq V_q K_p⁻¹ ξ_pq` every affine field has its own gradient, and all forces derive from the energy, whatever the local law is. A uniform stress P leaves
//! on a point q the force `P · Σ_p V_p b_pq`. These sums vanish where all families are whole. At the seam the weights ω are changed so that they vanish too, and that the feet give each node of a face `∫ N n dA`, n out of the zone: the traction that its elements lack.
//! Such conditions are those of variationally consistent integration \[ChenHillmanRueter2013\]. Here test and trial functions change together, so that the stiffness stays symmetric.

mod rows;

pub use rows::TruncatedFamilies;
