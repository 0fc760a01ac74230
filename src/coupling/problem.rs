//! A coupled problem: a body with its zones, and the method that couples them.

use crate::coupling::Coupling;
use crate::model::{Model, ModelError, ZonedBody};
use crate::progress::Progress;
use crate::system::Ranks;

/// Everything that makes a coupled model, before it is assembled.
pub struct Problem<const D: usize> {
    /// The body with its zones.
    pub body: ZonedBody<D>,
    /// The method.
    pub coupling: Box<dyn Coupling<D>>,
}

/// A model, and the method that makes rows of it.
pub type LaidOut<const D: usize> = Result<(Model<D>, Box<dyn Coupling<D>>), ModelError>;

impl<const D: usize> Problem<D> {
    /// Lays out sites and families. Collective with `ranks`, see [`Model::new`].
    ///
    /// # Errors
    /// As [`Model::new`].
    pub fn lay_out(self, ranks: Option<&dyn Ranks>, progress: &dyn Progress) -> LaidOut<D> {
        let model = Model::new(self.body, self.coupling.as_ref(), ranks, progress)?;
        Ok((model, self.coupling))
    }
}
