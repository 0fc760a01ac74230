//! The list of fields.

use bondline::run::fields::{self, On, WrittenWhen};

/// All fields, a line each.
pub fn table() -> String {
    let rows = fields::list().into_iter().map(|field| {
        let on = match field.on {
            On::Points => "points",
            On::Cells => "cells",
        };
        let rank = format!("{:?}", field.rank).to_lowercase();
        let key = match field.wanted {
            WrittenWhen::Always => "",
            WrittenWhen::By(key) => key,
        };
        [field.name, field.unit, on, &rank, key, field.text].map(str::to_owned)
    });
    let head = ["field", "unit", "on", "rank", "asked for by", ""].map(str::to_owned);
    let rows: Vec<[String; 6]> = std::iter::once(head).chain(rows).collect();
    let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max();
    let widths: [usize; 6] = std::array::from_fn(|k| width(k).unwrap_or(0));
    let line = |row: &[String; 6]| {
        let cells = row.iter().zip(widths);
        let cells = cells.map(|(cell, width)| format!("{cell:width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    let lines = rows.iter().map(line).collect::<Vec<_>>().join("\n");
    format!(
        "{lines}\n\nFiles have points and cells apart: nodes and points, elements and points. What laws remember of points and elements comes beside these, by the names that the laws give."
    )
}
