//! Fields at probes with each row of a history: those that the scene asks for.

use super::fields::columns::{Rows, header as columns};
use super::fields::place::{Place, Shared};
use super::slopes::{Slope, Slopes};
use super::solution::Solved;
use crate::model::{Carrier, Model, Sampler};
use crate::scene::validated::Output;
use crate::tensor::Vector;

/// The probes that something carries; none in a scene that asks for no field.
pub(super) struct FieldProbes {
    carriers: Vec<Option<CarriedProbe>>,
}

/// Position of a probe, its carrier, and the slope there.
struct CarriedProbe {
    x: Vec<f64>,
    carrier: Carrier,
    slope: Option<Slope>,
}

/// The columns of a scene's probes.
pub(super) fn header<const D: usize>(output: &Output<D>) -> Vec<String> {
    let columns = columns::<D>(&output.fields, false);
    let of_probe = |(name, _): &(String, Vector<D>)| -> Vec<String> {
        columns
            .iter()
            .map(|column| format!("{name}_{column}"))
            .collect()
    };
    output.probes.iter().flat_map(of_probe).collect()
}

impl FieldProbes {
    /// In a model.
    pub fn new<const D: usize>(model: &Model<D>, output: &Output<D>) -> Self {
        if header(output).is_empty() {
            return Self {
                carriers: Vec::new(),
            };
        }
        let sampler = Sampler::new(model);
        let slopes = Slopes::new(model);
        let carriers = output.probes.iter().map(|(_, x)| {
            let carrier = sampler.carrier(x)?;
            Some(CarriedProbe {
                x: x.as_slice().to_vec(),
                carrier,
                slope: slopes.at(x, carrier),
            })
        });
        Self {
            carriers: carriers.collect(),
        }
    }

    /// True of a scene without such columns.
    pub fn is_empty(&self) -> bool {
        self.carriers.is_empty()
    }

    /// The fields at each probe; zero where nothing carries it.
    pub fn row<const D: usize>(&self, solved: &Solved<'_, D>) -> Vec<f64> {
        let (rows, shared) = (Rows::new(solved, false), Shared::of(solved));
        let of_probe = |probe: &Option<CarriedProbe>| {
            let Some(CarriedProbe { x, carrier, slope }) = probe else {
                return rows.at(None);
            };
            let slope = slope.as_ref().filter(|_| solved.has_slope(*carrier));
            let slope = slope.map(|slope| slope.of_whole(solved.model, &shared.intact));
            let here = (&Vector::from_column_slice(x), *carrier, None);
            let place = Place::of_position(solved, &shared, here, slope.as_deref(), None);
            rows.at(Some(&place))
        };
        self.carriers.iter().flat_map(of_probe).collect()
    }
}
