//! Factors that precondition the corrections of a load step, and their iterations so far.

use crate::solve::krylov::LinearMap;

/// Preconditioner of the corrections within a load step.
#[derive(Default)]
pub(super) struct Lead {
    /// Factors of a tangent of this load step.
    pub factors: Option<Box<dyn LinearMap>>,
    /// Iterations beyond the first of each correction since the factors at hand came to hand.
    pub spent: usize,
    /// Iterations beyond the first of each correction since bonds broke or were last left out of factors.
    pub spent_torn: usize,
    /// Iterations of the correction before.
    pub last: usize,
    /// True if new factors have led hardly better than those before: the part of the tangent that elements do not have decides.
    pub is_useless: bool,
    /// Factorisations within the load step.
    pub factorisations: usize,
}
