//! Supports of the body: the force of each condition that prescribes the motion of sites, and the displacement that it has given them.

#![deny(clippy::wildcard_enum_match_arm)]

use std::sync::Arc;

use crate::observe::summary::ConditionForce;
use crate::run::condition_terms::ConditionTerms;
use crate::scene::conditions::{Condition, Prescribed};
use crate::tensor::AXES;

/// The conditions that hold something, with the dofs that each holds.
pub(super) struct Supports<const D: usize> {
    conditions: Vec<Support<D>>,
    /// Prescribed dofs with the condition that holds each, by its number among all conditions.
    holders: Vec<(u32, u32)>,
    /// The conditions that are springs, by their names.
    term_names: Vec<String>,
    /// The springs themselves; none before the model is known.
    terms: Option<Arc<ConditionTerms>>,
    /// Forces of the springs at the last row.
    last_of_terms: Vec<ConditionForce>,
    /// Forces of the last row, `D` of each condition; empty before the first.
    last: Vec<f64>,
}

struct Support<const D: usize> {
    /// Its number among all conditions.
    number: u32,
    name: String,
    /// True for each axis along which it prescribes anything.
    prescribes: [bool; D],
}

impl<const D: usize> Supports<D> {
    pub fn new(conditions: &[Condition<D>]) -> Self {
        let all = conditions.iter().enumerate().filter(|(_, c)| c.holds());
        let support = |(number, c): (usize, &Condition<D>)| Support {
            number: number as u32,
            name: c.name.clone(),
            prescribes: std::array::from_fn(|k| match c.prescribed {
                Prescribed::Field(_) => true,
                Prescribed::Displacement(_)
                | Prescribed::Velocity(_)
                | Prescribed::Load(_)
                | Prescribed::Term(_) => c.components.0[k].is_some(),
            }),
        };
        let terms = conditions.iter();
        let terms = terms.filter(|c| c.term().is_some());
        Self {
            term_names: terms.map(|c| c.name.clone()).collect(),
            terms: None,
            last_of_terms: Vec::new(),
            conditions: all.map(support).collect(),
            holders: Vec::new(),
            last: Vec::new(),
        }
    }

    /// Learns which condition holds each prescribed dof.
    pub fn hold(&mut self, holders: impl Iterator<Item = (u32, u32)>) {
        self.holders = holders.collect();
    }

    /// The prescribed dofs.
    pub fn dofs(&self) -> impl Iterator<Item = u32> {
        self.holders.iter().map(|(dof, _)| *dof)
    }

    /// Takes the springs that hold the body.
    pub fn take_terms(&mut self, terms: Arc<ConditionTerms>) {
        self.terms = Some(terms);
    }

    /// Returns the springs that hold the body, if they are known.
    pub fn terms(&self) -> Option<&ConditionTerms> {
        self.terms.as_deref()
    }

    /// The columns of a row: all reactions, then the displacements that are prescribed, then the forces of springs.
    pub fn header(&self) -> Vec<String> {
        let of_all = self.conditions.iter();
        let mut header: Vec<String> = of_all
            .flat_map(|c| AXES[..D].iter().map(|a| format!("{}_reaction_{a}", c.name)))
            .collect();
        header.extend(self.prescribed().map(|(c, k)| {
            let name = &self.conditions[c].name;
            format!("{name}_displacement_{}", AXES[k])
        }));
        let terms = self.term_names.iter();
        header.extend(terms.flat_map(|name| {
            let axes = AXES[..D].iter();
            axes.map(move |a| format!("{name}_reaction_{a}"))
        }));
        header
    }

    /// Conditions by their place in the list, with each axis along which they prescribe.
    fn prescribed(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let all = self.conditions.iter().enumerate();
        all.flat_map(|(c, support)| {
            (0..D)
                .filter(|&k| support.prescribes[k])
                .map(move |k| (c, k))
        })
    }

    /// Forces of all conditions by components, then the means of the displacements that each prescribes, then the forces of springs.
    ///
    /// `forces` are those of supports and loads together by dof, `loads` those of loads alone on each prescribed dof, `u` displacements by dof.
    /// A condition all of whose dofs are held by others has force and displacement zero.
    pub fn row(&mut self, (forces, loads): (&[f64], &[f64]), u: &[f64]) -> Vec<f64> {
        let mut reactions = vec![0.0; self.conditions.len() * D];
        let mut sums = vec![(0.0, 0.0); reactions.len()];
        for (&(dof, holder), load) in self.holders.iter().zip(loads) {
            let place = self
                .conditions
                .binary_search_by_key(&holder, |support| support.number);
            if let Ok(place) = place {
                let k = place * D + dof as usize % D;
                reactions[k] += forces[dof as usize] - load;
                sums[k].0 += u[dof as usize];
                sums[k].1 += 1.0;
            }
        }
        self.last.clone_from(&reactions);
        reactions.extend(self.prescribed().map(|(c, k)| {
            let (sum, count) = sums[c * D + k];
            if count > 0.0 { sum / count } else { 0.0 }
        }));
        match &self.terms {
            Some(terms) => self.last_of_terms = terms.reactions::<D>(u),
            None => reactions.extend(vec![0.0; self.term_names.len() * D]),
        }
        let terms = self.last_of_terms.iter();
        reactions.extend(terms.flat_map(|r| r.force.iter().copied()));
        reactions
    }

    /// The forces of the last row; none where this program wrote no row.
    pub fn reactions(&self) -> Vec<ConditionForce> {
        let forces = self.last.chunks_exact(D);
        let all = self.conditions.iter().zip(forces);
        all.map(|(support, force)| ConditionForce {
            condition: support.name.clone(),
            force: force.to_vec(),
        })
        .chain(self.last_of_terms.iter().cloned())
        .collect()
    }
}
