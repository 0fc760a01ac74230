//! Arrays of a file and columns of a table, made of fields.

use super::{
    About, Found, On, Rank, TableColumns, Value, place::Place, place::Shared, place::Spot, wanted,
};
use crate::observe::vtu::{Field, Values};
use crate::parallel;
use crate::run::solution::Solved;
use crate::run::stresses;
use crate::scene::validated::FieldChoice;
use crate::tensor::{AXES, padded};

/// Places of which values are held at a time.
const CHUNK: usize = 4096;

/// The arrays of the fields on some places of a file.
pub(in crate::run) fn arrays<const D: usize>(
    solved: &Solved<'_, D>,
    shared: &Shared,
    on: On,
    spots: &[Spot],
) -> Vec<Field> {
    let fields = wanted::<D>(solved.choice()).into_iter();
    let found: Vec<(Rank, Found<'_, D>)> = fields
        .filter(|field| field.about().on == on)
        .filter_map(|field| Some((field.about().rank, field.of(solved)?)))
        .collect();
    let mut arrays: Vec<Field> = found
        .iter()
        .map(|(rank, f)| empty(&f.name, *rank))
        .collect();
    for spots in spots.chunks(CHUNK) {
        let rows: Vec<Vec<Value<D>>> = parallel::map_slice(spots, |spot| {
            let place = Place::new(solved, shared, *spot);
            found.iter().map(|(_, field)| (field.at)(&place)).collect()
        });
        for (array, k) in arrays.iter_mut().zip(0..) {
            rows.iter().for_each(|row| push(&mut array.values, &row[k]));
        }
    }
    arrays
}

fn empty(name: &str, rank: Rank) -> Field {
    match rank {
        Rank::Label => Field::labels(name, Vec::new()),
        Rank::Integer => Field::integers(name, Vec::new()),
        Rank::Scalar => Field::scalar(name, Vec::new()),
        Rank::Vector => Field::reals(name, 3, Vec::new()),
        Rank::Tensor => Field::reals(name, 9, Vec::new()),
    }
}

/// Appends a value, vectors and tensors filled up with zeros.
fn push<const D: usize>(values: &mut Values, value: &Value<D>) {
    match (values, value) {
        (Values::Byte(list), Value::Label(label)) => list.push(*label),
        (Values::Integer(list), Value::Integer(number)) => list.push(*number),
        (Values::Real(list), Value::Scalar(x)) => list.push(*x),
        (Values::Real(list), Value::Vector(x)) => list.extend(padded(x)),
        (Values::Real(list), Value::Tensor(t)) => {
            let entry = |i: usize, j: usize| if i < D && j < D { t[(i, j)] } else { 0.0 };
            list.extend((0..9).map(|k| entry(k / 3, k % 3)));
        }
        (Values::Real(list), Value::Stress(stress)) => {
            list.extend(stress.rows().iter().flatten());
        }
        (values, value) => debug_assert!(false, "{values:?} of {value:?}"),
    }
}

/// Beginning of the names of the columns of a field; none of one without columns.
fn prefix(about: &About, choice: &FieldChoice) -> Option<&'static str> {
    match about.columns {
        TableColumns::Never => None,
        TableColumns::Always(name) => Some(name),
        TableColumns::WithStresses(name) => choice.has_numbers().then_some(name),
        TableColumns::Asked => Some(about.name),
    }
}

/// The fields with columns, and how these begin: of all, or without those that every table has.
fn in_tables<const D: usize>(
    choice: &FieldChoice,
    has_all: bool,
) -> Vec<(&'static str, &'static dyn super::OutputField<D>)> {
    let fields = wanted::<D>(choice).into_iter();
    let named = fields.filter_map(|field| Some((prefix(&field.about(), choice)?, field)));
    let mut named: Vec<_> = named
        .filter(|(_, f)| has_all || !matches!(f.about().columns, TableColumns::Always(_)))
        .collect();
    // the label of the model ends a row
    named.sort_by_key(|(_, field)| field.about().rank == Rank::Label);
    named
}

/// Names of the columns of the fields of a table: of all, or of those that the scene asks for.
pub(in crate::run) fn header<const D: usize>(choice: &FieldChoice, has_all: bool) -> Vec<String> {
    let mut names = Vec::new();
    for (prefix, field) in in_tables::<D>(choice, has_all) {
        let upper = |i: usize| (i..D).map(move |j| (i, j));
        match field.about().rank {
            Rank::Label | Rank::Integer | Rank::Scalar => names.push(prefix.replace('-', "_")),
            Rank::Vector => names.extend(AXES[..D].iter().map(|a| format!("{prefix}{a}"))),
            Rank::Tensor => {
                let both = (0..D).flat_map(upper);
                names.extend(both.map(|(i, j)| format!("{prefix}{}{}", AXES[i], AXES[j])));
                let across = has_across(&field.about(), choice);
                names.extend(across.then(|| "szz".to_owned()));
            }
        }
    }
    names
}

/// True of a tensor with a column for the component out of the plane: the stress in plane strain.
fn has_across(about: &About, choice: &FieldChoice) -> bool {
    about.name == stresses::FIELD && choice.across
}

/// Number of columns of a field.
fn width<const D: usize>(about: &About, choice: &FieldChoice) -> usize {
    match about.rank {
        Rank::Label | Rank::Integer | Rank::Scalar => 1,
        Rank::Vector => D,
        Rank::Tensor => D * (D + 1) / 2 + usize::from(has_across(about, choice)),
    }
}

/// Columns of the fields of a solution at places.
pub(in crate::run) struct Rows<'s, const D: usize> {
    found: Vec<Option<Found<'s, D>>>,
    widths: Vec<usize>,
    has_across: bool,
}

impl<'s, const D: usize> Rows<'s, D> {
    /// Of all fields, or of those that the scene asks for, in the order of [`header`].
    pub fn new(solved: &'s Solved<'s, D>, has_all: bool) -> Self {
        let choice = solved.choice();
        let fields = in_tables::<D>(choice, has_all);
        Self {
            widths: fields
                .iter()
                .map(|(_, f)| width::<D>(&f.about(), choice))
                .collect(),
            found: fields.iter().map(|(_, f)| f.of(solved)).collect(),
            has_across: choice.across,
        }
    }

    /// The numbers at a place; zeros of a field that the solution does not have, and of all where nothing carries the place.
    pub fn at(&self, place: Option<&Place<'_, D>>) -> Vec<f64> {
        let mut row = Vec::new();
        for (field, width) in self.found.iter().zip(&self.widths) {
            let upper = |t: crate::tensor::Tensor<D>| {
                (0..D).flat_map(move |i| (i..D).map(move |j| t[(i, j)]))
            };
            match field.as_ref().zip(place).map(|(f, place)| (f.at)(place)) {
                None => row.extend(std::iter::repeat_n(0.0, *width)),
                Some(Value::Label(label)) => row.push(f64::from(label)),
                Some(Value::Integer(number)) => row.push(f64::from(number)),
                Some(Value::Scalar(x)) => row.push(x),
                Some(Value::Vector(x)) => row.extend(x.iter()),
                Some(Value::Tensor(t)) => row.extend(upper(t)),
                Some(Value::Stress(stress)) => {
                    row.extend(upper(stress.tensor));
                    row.extend(self.has_across.then_some(stress.across));
                }
            }
        }
        row
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn agree<const D: usize>(across: bool) {
        let choice = FieldChoice {
            asked: vec!["von-mises".to_owned(), "strain-energy-density".to_owned()],
            stresses: 1,
            across,
        };
        for has_all in [false, true] {
            let fields = in_tables::<D>(&choice, has_all);
            let widths = fields.iter().map(|(_, f)| width::<D>(&f.about(), &choice));
            let names = header::<D>(&choice, has_all);
            assert_eq!(widths.sum::<usize>(), names.len(), "{names:?}");
        }
    }

    #[test]
    fn a_place_that_nothing_carries_has_as_many_numbers_as_there_are_columns() {
        agree::<1>(false);
        agree::<2>(false);
        agree::<2>(true);
        agree::<3>(false);
    }
}
