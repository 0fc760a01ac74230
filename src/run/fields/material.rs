//! Material of a cell.

use super::{About, Found, On, OutputField, Rank, TableColumns, Value, WrittenWhen};
use crate::peridynamics::PdBody;
use crate::run::solution::Solved;

/// Material of a cell.
pub(super) struct Material;

impl<const D: usize> OutputField<D> for Material {
    fn about(&self) -> About {
        About {
            name: "material",
            unit: "1",
            on: On::Cells,
            rank: Rank::Integer,
            wanted: WrittenWhen::Always,
            columns: TableColumns::Never,
            text: "Number of the material, in scenes of several.",
        }
    }

    fn of<'s>(&self, solved: &'s Solved<'s, D>) -> Option<Found<'s, D>> {
        let model = solved.model;
        let by_points = model.body().is_some_and(|b| !b.cloud.material.is_empty());
        let of_point = |(body, p): (&PdBody<D>, usize)| {
            let material = body.cloud.material.get(p).copied();
            material.unwrap_or(model.peridynamic_material())
        };
        let found = Found::new("material", move |place| {
            let of_cell = place.cell().map(|c| model.material_of_cell(c));
            let found = of_cell.or_else(|| place.point().map(of_point));
            Value::Integer(found.map_or(0, i32::from))
        });
        found.filter(|_| model.several().is_some() || by_points)
    }
}
