//! Columns of the history for the probes.

use crate::model::Sampler;
use crate::tensor::{AXES, Vector};

/// The probes of a scene with the sites that each follows.
pub(super) struct ProbeRows<'a, const D: usize> {
    wanted: &'a [(String, Vector<D>)],
    /// Sites and weights of each.
    follows: Vec<Vec<(u32, f64)>>,
}

impl<'a, const D: usize> ProbeRows<'a, D> {
    /// In the model of a sampler.
    pub fn new(wanted: &'a [(String, Vector<D>)], sampler: &Sampler<'_, D>) -> Self {
        let mut rows = Self {
            wanted,
            follows: Vec::new(),
        };
        rows.find(sampler);
        rows
    }

    /// Finds the probes in another layout of the same body.
    pub fn find(&mut self, sampler: &Sampler<'_, D>) {
        let places = self.wanted.iter().map(|(_, x)| x);
        self.follows = places
            .map(|x| sampler.weights(x).unwrap_or_default())
            .collect();
    }

    /// Their columns: displacement, then velocity of each.
    pub fn header(&self) -> Vec<String> {
        let of_field = |name: &str, field: char| -> Vec<String> {
            let axes = AXES[..D].iter();
            axes.map(|a| format!("{name}_{field}{a}")).collect()
        };
        let names = self.wanted.iter();
        names
            .flat_map(|(name, _)| ['u', 'v'].map(|field| of_field(name, field)))
            .flatten()
            .collect()
    }

    /// Displacement and velocity of each probe, from those of all dofs.
    pub fn row(&self, u: &[f64], v: &[f64]) -> Vec<f64> {
        let mut row = Vec::new();
        for probe in &self.follows {
            for field in [u, v] {
                row.extend((0..D).map(|k| -> f64 {
                    let of_site = |&(s, w): &(u32, f64)| w * field[s as usize * D + k];
                    probe.iter().map(of_site).sum()
                }));
            }
        }
        row
    }
}
