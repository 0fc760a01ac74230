//! The coupling of a scene once it is selected.

use super::source::Span;
use super::spec::{CouplingSpec, CouplingTraits};

/// A coupling, and why it was chosen if the scene names none.
pub(crate) struct SelectedCoupling {
    /// The coupling to go on with if this one turns out not to hold.
    pub otherwise: Option<CouplingSpec>,
    pub coupling: CouplingSpec,
    pub traits: CouplingTraits,
    /// Span at which the scene names it, or that of its kinematics if it does not.
    pub span: Span,
    pub why: Option<String>,
}
