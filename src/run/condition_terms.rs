//! Forces of a scene's conditions that depend on the displacement, on the sites of its model.

#![deny(clippy::wildcard_enum_match_arm)]

use std::borrow::Cow;
use std::sync::Arc;

use crate::model::Model;
use crate::observe::summary::ConditionForce;
use crate::run::error::RunError;
use crate::scene::conditions::Condition;
use crate::system::{ForceTerm, Interval, SpringRows};

/// The terms of a scene's conditions.
#[derive(Clone, Default)]
pub(crate) struct ConditionTerms {
    /// Rows of all of them together.
    pub rows: SpringRows,
    /// Each, by the name of its condition.
    each: Vec<(String, Arc<dyn ForceTerm>)>,
}

impl ConditionTerms {
    /// Finds the sites that the terms of `conditions` act on.
    ///
    /// # Errors
    /// [`RunError::Idle`] for a condition that meets no site.
    pub fn new<const D: usize>(
        model: &Model<D>,
        conditions: &[Condition<D>],
    ) -> Result<Self, RunError> {
        let mut terms = Self::default();
        for condition in conditions {
            let Some(term) = condition.term() else {
                continue;
            };
            let Some(own) = term.on_model(model) else {
                return Err(RunError::Idle {
                    condition: condition.name.clone(),
                    remedy: "name a set on the boundary of the body, or enlarge the shape: it acts on the cells whose centroid it holds",
                });
            };
            terms.each.push((condition.name.clone(), own));
        }
        let rows = terms.each.iter().filter_map(|(_, term)| term.rows(None));
        let rows: Vec<Cow<'_, SpringRows>> = rows.collect();
        let sum = SpringRows::sum(D, rows.iter().map(AsRef::as_ref));
        drop(rows);
        terms.rows = sum;
        Ok(terms)
    }

    /// Returns true if there are none.
    pub fn is_empty(&self) -> bool {
        self.each.is_empty()
    }

    /// The terms.
    pub fn all(&self) -> Vec<Arc<dyn ForceTerm>> {
        self.each.iter().map(|(_, term)| Arc::clone(term)).collect()
    }

    /// Subtracts their forces at the displacement `u` from forces by dof.
    pub fn take_from(&self, forces: &mut [f64], u: &[f64]) {
        if self.is_empty() {
            return;
        }
        let mut taken = vec![0.0; forces.len()];
        for (_, term) in &self.each {
            term.add_force(u, &mut taken, Interval::AT_ONCE);
        }
        let each = forces.iter_mut().zip(taken);
        each.for_each(|(f, own)| *f -= own);
    }

    /// The force of each condition on the body, at the displacement `u` of all dofs.
    pub fn reactions<const D: usize>(&self, u: &[f64]) -> Vec<ConditionForce> {
        let of_one = |(name, term): &(String, Arc<dyn ForceTerm>)| {
            let mut force = vec![0.0; u.len()];
            term.add_force(u, &mut force, Interval::AT_ONCE);
            let mut sum = vec![0.0; D];
            for (dof, f) in force.iter().enumerate() {
                sum[dof % D] -= f;
            }
            ConditionForce {
                condition: name.clone(),
                force: sum,
            }
        };
        self.each.iter().map(of_one).collect()
    }
}
