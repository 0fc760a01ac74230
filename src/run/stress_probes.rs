//! Stresses at probes with each row of a history.

use super::solution::Solved;
use super::solution_samples::Intact;
use super::stresses::{Expansions, Stress, names};
use crate::coupling::{Carrier, Model, Sampler};
use crate::scene::validated::Output;

/// What carries each probe; nothing where no stress is asked for.
pub(super) struct StressProbes {
    carriers: Vec<Option<Carrier>>,
}

/// The columns of a scene's probes: the stress, then the numbers made of it; none where no stress is asked for.
pub(super) fn header<const D: usize>(output: &Output<D>) -> Vec<String> {
    let probes = output
        .probes
        .iter()
        .filter(|_| !output.stresses.numbers.is_empty());
    probes
        .flat_map(|(name, _)| {
            let columns = names::<D>(&output.stresses).into_iter();
            columns.map(move |column| format!("{name}_{column}"))
        })
        .collect()
}

impl StressProbes {
    /// In a model.
    pub fn new<const D: usize>(model: &Model<D>, output: &Output<D>) -> Self {
        if output.stresses.numbers.is_empty() || output.probes.is_empty() {
            return Self {
                carriers: Vec::new(),
            };
        }
        let sampler = Sampler::new(model);
        let carriers = output.probes.iter().map(|(_, x)| sampler.carrier(x));
        Self {
            carriers: carriers.collect(),
        }
    }

    /// Whether there is nothing to tell.
    pub fn is_empty(&self) -> bool {
        self.carriers.is_empty()
    }

    /// Stress at each probe, and the numbers made of it; zero where nothing carries it.
    pub fn row<const D: usize>(&self, solved: &Solved<'_, D>) -> Vec<f64> {
        let (expansions, intact) = (Expansions::of(solved), Intact::of(solved));
        let output = solved.stress_output();
        let of_probe = |carrier: &Option<Carrier>| {
            let stress = carrier.map_or_else(Stress::zero, |carrier| {
                solved.carried_stress(carrier, &expansions, &intact)
            });
            let derived = stress.derived(output);
            stress.components(output).chain(derived)
        };
        self.carriers.iter().flat_map(of_probe).collect()
    }
}
