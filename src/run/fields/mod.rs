//! Fields of a solution, one file each: files for viewers, tables along lines and at probes, histories at probes, Python and `bondline fields` read this list.
//!
//! | file | field |
//! |---|---|
//! | `displacement.rs`, `velocity.rs` | motion of nodes and points |
//! | `beta.rs`, `horizon.rs`, `size.rs` | blending function, horizon and spacing of points |
//! | `residual.rs` | force out of balance, on supports the reaction |
//! | `damage.rs` | share of the bonds that are broken |
//! | `model.rs`, `material.rs`, `volume.rs` | model, material and volume of a cell |
//! | `strain.rs`, `stress.rs`, `stress_numbers.rs` | strain, stress and the numbers made of it |
//! | `temperature.rs` | temperature |
//! | `energy_density.rs`, `strain_energy_density.rs` | stored energy of points; of elements and points |
//! | `stored_energy.rs` | the energies of both |
//! | `place.rs` | where fields are asked for |
//! | `columns.rs` | arrays of a file and columns of a table, made of fields |
//!
//! A field that implements `OutputField` and has its line in `all` is written wherever it is asked for: no other place names it. What laws remember ([`crate::peridynamics::HistoryLayout`]) is written beside them, by the names that the laws give.

mod beta;
pub(super) mod columns;
mod damage;
mod displacement;
mod energy_density;
mod horizon;
mod material;
mod model;
pub(super) mod place;
mod residual;
mod size;
mod stored_energy;
mod strain;
mod strain_energy_density;
mod stress;
mod stress_numbers;
mod temperature;
mod velocity;
mod volume;

use std::borrow::Cow;

use super::solution::Solved;
use super::stresses::Stress;
use crate::scene::validated::FieldChoice;
use crate::tensor::{Tensor, Vector};
use place::Place;

/// Every field, in the order in which files have them.
fn all<const D: usize>() -> Vec<&'static dyn OutputField<D>> {
    vec![
        &displacement::Displacement,
        &beta::Beta,
        &horizon::Horizon,
        &size::Size,
        &residual::Residual,
        &velocity::Velocity,
        &damage::Damage,
        &energy_density::EnergyDensity,
        &model::ModelLabel,
        &volume::Volume,
        &strain::Strain,
        &stress::StressTensor,
        &stress::StressMeasure,
        &stress_numbers::VON_MISES,
        &stress_numbers::MAX_PRINCIPAL,
        &stress_numbers::MIN_PRINCIPAL,
        &strain_energy_density::StrainEnergyDensity,
        &temperature::Temperature,
        &material::Material,
    ]
}

/// A field of a solution.
pub(super) trait OutputField<const D: usize>: Sync {
    /// Name, unit, places and rank.
    fn about(&self) -> About;

    /// The field of a solution; none where the solution has no such field.
    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>>;
}

/// A field of a solution at hand.
pub(super) struct Found<'s, const D: usize> {
    /// Name in files.
    pub name: Cow<'static, str>,
    /// Its value at a place.
    pub at: Box<dyn Fn(&Place<'_, D>) -> Value<D> + Sync + 's>,
}

impl<'s, const D: usize> Found<'s, D> {
    /// A field by its usual name.
    fn new(name: &'static str, at: impl Fn(&Place<'_, D>) -> Value<D> + Sync + 's) -> Option<Self> {
        Some(Self {
            name: name.into(),
            at: Box::new(at),
        })
    }
}

/// Places of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum On {
    /// Nodes of elements, corners of parts of elements, and peridynamic points, or the corners of the cells that points are shown as.
    Points,
    /// Elements, parts of elements that are cut, and peridynamic points.
    Cells,
}

/// Numbers of a field at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rank {
    /// A small label.
    Label,
    /// An integer.
    Integer,
    /// A real.
    Scalar,
    /// A vector.
    Vector,
    /// A tensor of second order.
    Tensor,
}

/// Condition under which files have a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrittenWhen {
    /// Always, where a solution has it.
    Always,
    /// Only in scenes that ask for it, by this key.
    By(&'static str),
}

/// Columns of tables along lines and at probes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableColumns {
    /// None.
    Never,
    /// Always, beginning so; of a label and a scalar the whole name.
    Always(&'static str),
    /// The same where numbers made of the stress are asked for.
    WithStresses(&'static str),
    /// By the name of the field, where the scene asks for it.
    Asked,
}

/// Description of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct About {
    /// Name in files.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Places.
    pub on: On,
    /// Numbers at a place.
    pub rank: Rank,
    /// Condition under which it is written.
    pub wanted: WrittenWhen,
    /// In tables.
    pub columns: TableColumns,
    /// One sentence.
    pub text: &'static str,
}

/// A value of a field.
#[derive(Clone, Copy, Debug)]
pub(super) enum Value<const D: usize> {
    Label(u8),
    Integer(i32),
    Scalar(f64),
    Vector(Vector<D>),
    Tensor(Tensor<D>),
    Stress(Stress<D>),
}

/// Descriptions of all fields.
pub fn list() -> Vec<About> {
    all::<3>().iter().map(|field| field.about()).collect()
}

/// Names of the fields that a scene asks for by a key.
pub fn asked_by(key: &str) -> Vec<&'static str> {
    let all = list().into_iter();
    all.filter(|about| matches!(about.wanted, WrittenWhen::By(own) if own == key))
        .map(|about| about.name)
        .collect()
}

/// The fields that are written of what a scene asks for: those that it names in its own order, where the first of them would stand.
fn wanted<const D: usize>(choice: &FieldChoice) -> Vec<&'static dyn OutputField<D>> {
    let place = |field: &&dyn OutputField<D>| {
        let name = field.about().name;
        choice.asked.iter().position(|asked| asked == name)
    };
    let is_wanted = |field: &&'static dyn OutputField<D>| {
        field.about().wanted == WrittenWhen::Always || place(field).is_some()
    };
    let mut found: Vec<_> = all::<D>().into_iter().filter(is_wanted).collect();
    for named in found.chunk_by_mut(|a, b| {
        a.about().wanted != WrittenWhen::Always && b.about().wanted != WrittenWhen::Always
    }) {
        named.sort_by_key(place);
    }
    found
}
