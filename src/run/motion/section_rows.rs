//! Columns of the history for the sections through the body.

use crate::model::Model;
use crate::observe::summary::SectionForce;
use crate::run::condition_terms::ConditionTerms;
use crate::run::error::RunError;
use crate::run::sections::{self, Sections};
use crate::run::setup::RunSettings;
use crate::scene::section::Section;

/// The sections of a scene, and their forces at the last row.
pub(super) struct SectionRows<'a, const D: usize> {
    wanted: &'a [Section<D>],
    /// Parts of the model beyond each; none before the model is known.
    found: Option<Sections<'a, D>>,
    /// Empty before the first row.
    last: Vec<SectionForce>,
}

impl<'a, const D: usize> SectionRows<'a, D> {
    pub fn new(wanted: &'a [Section<D>]) -> Self {
        Self {
            wanted,
            found: None,
            last: Vec::new(),
        }
    }

    /// Their columns.
    pub fn header(&self) -> Vec<String> {
        sections::header(self.wanted)
    }

    /// Finds the part of a model beyond each section.
    ///
    /// # Errors
    /// [`RunError::EmptySection`].
    pub fn find(&mut self, model: &Model<D>, rest: &'a RunSettings<D>) -> Result<(), RunError> {
        if !self.wanted.is_empty() {
            self.found = Some(Sections::new(model, rest)?);
        }
        Ok(())
    }

    /// Force and moment of each section at the displacement `u` and the time `t`, zero as long as no model is known.
    ///
    /// Internal and external forces are by dof, those of `springs` to the ground are taken from the internal ones; `held` are the prescribed dofs with the loads on them, which take the place of the external forces there.
    pub fn row<'h>(
        &mut self,
        (internal, external): (&[f64], &[f64]),
        terms: Option<&ConditionTerms>,
        held: impl Iterator<Item = (u32, &'h f64)>,
        (u, t): (&[f64], f64),
    ) -> Vec<f64> {
        let Some(found) = &self.found else {
            return vec![0.0; self.header().len()];
        };
        let both = internal.iter().zip(external);
        let mut excess: Vec<f64> = both.map(|(f, load)| f - load).collect();
        for (dof, load) in held {
            excess[dof as usize] = internal[dof as usize] - load;
        }
        if let Some(terms) = terms {
            terms.take_from(&mut excess, u);
        }
        self.last = found.forces(&excess, u, t);
        let forces = self.last.iter();
        forces.flat_map(SectionForce::numbers).collect()
    }

    /// The forces of the last row; none where this program wrote no row.
    pub fn last(&self) -> Vec<SectionForce> {
        self.last.clone()
    }
}
