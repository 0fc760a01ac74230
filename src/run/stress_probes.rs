//! Stresses at probes with each row of a history.

use super::solution::Solved;
use super::solution_samples::Intact;
use super::stress_settings::StressSettings;
use super::stresses::{KnownStresses, names};
use crate::coupling::{Carrier, Model, Sampler};
use crate::scene::validated::Output;
use crate::tensor::Vector;

/// What carries each probe; nothing where no stress is asked for.
pub(super) struct StressProbes {
    carriers: Vec<Option<Carrier>>,
}

/// The columns of a scene's probes: the stress, then the numbers made of it; none where no stress is asked for.
pub(super) fn header<const D: usize>(output: &Output<D>) -> Vec<String> {
    let probes = output.probes.iter().filter(|_| !output.stresses.is_empty());
    probes
        .flat_map(|(name, _)| {
            let columns = names::<D>(&output.stresses).into_iter();
            columns.map(move |column| format!("{name}_{column}"))
        })
        .collect()
}

impl StressProbes {
    /// In a model.
    pub fn new<const D: usize>(
        model: &Model<D>,
        settings: &StressSettings<D>,
        probes: &[(String, Vector<D>)],
    ) -> Self {
        if settings.asked.is_empty() || probes.is_empty() {
            return Self {
                carriers: Vec::new(),
            };
        }
        let sampler = Sampler::new(model);
        let carriers = probes.iter().map(|(_, x)| sampler.carrier(x));
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
        let (known, intact) = (KnownStresses::of(solved), Intact::of(solved));
        let columns = names::<D>(solved.asked()).len();
        let of_probe = |carrier: &Option<Carrier>| match carrier {
            Some(carrier) => {
                let (stress, derived) = solved.carried_stress(*carrier, &known, &intact);
                let mut row = Vec::with_capacity(columns);
                for i in 0..D {
                    row.extend((i..D).map(|j| stress[(i, j)]));
                }
                row.extend(derived);
                row
            }
            None => vec![0.0; columns],
        };
        self.carriers.iter().flat_map(of_probe).collect()
    }
}
