//! Doubts about the equilibria of load steps: forces out of balance, stresses that families do not resolve.

use std::sync::Arc;

use super::setup::ModelSetup;
use crate::model::Model;
use crate::observe::warning::Warning;
use crate::run::balance::{Balance, furthest, round_off};
use crate::run::condition_terms::ConditionTerms;
use crate::run::setup::RunSettings;
use crate::run::surface_gradient::{Asked, steep_stresses};
use crate::run::warnings::{Imbalance, out_of_balance};
use crate::scene::spec::CouplingTraits;
use crate::solve::quasi_static::LoadStep;
use crate::tensor::Vector;

/// Watches load steps for errors that their equilibria do not show.
pub(super) struct DoubtfulEquilibria<'a, const D: usize> {
    model: &'a Model<D>,
    rest: &'a RunSettings<D>,
    traits: CouplingTraits,
    terms: Arc<ConditionTerms>,
    /// The stress error of a uniform field at surfaces of points.
    uniform: f64,
    /// The largest sum of internal forces \[N\], and the largest scale of forces; not those of one load step, since little holds a body that is unloaded.
    force: Vector<D>,
    scale: f64,
    /// The largest displacement \[m\].
    furthest: f64,
    /// True once a load step has been examined for its peak of stress.
    asked: bool,
    steep: Vec<Warning>,
}

impl<'a, const D: usize> DoubtfulEquilibria<'a, D> {
    /// Of a run.
    pub fn new(setup: &ModelSetup<'a, D>) -> Self {
        let model = setup.model;
        Self {
            model,
            rest: setup.rest,
            traits: setup.setup.traits,
            terms: Arc::clone(&setup.terms),
            uniform: setup.proof.largest("stress error"),
            force: Vector::zeros(),
            scale: 0.0,
            furthest: 0.0,
            asked: false,
            steep: Vec::new(),
        }
    }

    /// Looks at an equilibrium.
    pub fn watch(&mut self, seen: &LoadStep<'_>) {
        let u = &seen.state.u;
        let mut internal = seen.force.to_vec();
        self.terms.take_from(&mut internal, u);
        let reactions: Vec<f64> = (seen.force.iter().zip(seen.load))
            .map(|(f, load)| f - load)
            .collect();
        let balance = Balance::<D>::of(&internal, seen.load, &reactions);
        if balance.force.norm() > self.force.norm() {
            self.force = balance.force;
        }
        self.scale = self.scale.max(balance.scale);
        self.furthest = self.furthest.max(furthest(u));
        self.ask_for_peak(seen);
    }

    /// Examines the first load step that deforms the body, as long as it is whole, for a peak of stress: beyond it, flow and cracks change the elastic response.
    fn ask_for_peak(&mut self, seen: &LoadStep<'_>) {
        let stresses = &self.rest.stresses;
        let u = &seen.state.u;
        if self.asked || self.model.body().is_none() || u.iter().all(|u| *u == 0.0) {
            return;
        }
        self.asked = true;
        // strains of free expansion are no stress
        if seen.state.broken == 0 && stresses.thermal.is_none() {
            let asked = Asked {
                stresses,
                displacement: u,
                uniform: self.uniform,
            };
            self.steep = steep_stresses(self.model, None, &asked);
        }
    }

    /// The warnings.
    pub fn told(self) -> impl Iterator<Item = Warning> {
        let Self { force, scale, .. } = self;
        let round_off = round_off(self.model, self.furthest);
        let relative = Balance { force, scale }.relative();
        let is_loaded = scale > round_off;
        let imbalance = Imbalance {
            force: force.as_slice(),
            relative,
            difference: None,
        };
        let balance = out_of_balance(&imbalance, self.traits);
        let balance = balance.filter(|_| is_loaded);
        balance.into_iter().chain(self.steep)
    }
}
