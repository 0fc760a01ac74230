//! Tables of numbers that expressions name: `NAME(t)`.
//!
//! An expression is read before the file of a table is: it shares the table, whose rows come afterwards. As with functions of a program, a deserialiser that is derived knows
//! of nothing but its text, so the tables of the scene that is read are kept beside it.

use std::cell::RefCell;
use std::sync::{Arc, OnceLock};

/// A function of one number by its values at some: linear between them, constant beyond the first and the last.
#[derive(Clone, Debug)]
pub struct Table {
    name: Arc<str>,
    /// Arguments and values; empty until they are read.
    rows: Arc<OnceLock<Vec<(f64, f64)>>>,
}

impl Table {
    /// A table whose rows are not read yet.
    pub(crate) fn named(name: &str) -> Self {
        Self {
            name: name.into(),
            rows: Arc::default(),
        }
    }

    /// Returns the name by which expressions call it.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// The value at `s`; not a number before the rows are read.
    pub(crate) fn at(&self, s: f64) -> f64 {
        let rows = self.rows.get().map_or(&[][..], Vec::as_slice);
        // the first row beyond `s`, which is not a number beyond all
        let next = rows.partition_point(|(a, _)| *a <= s);
        match (next.checked_sub(1).map(|k| rows[k]), rows.get(next)) {
            _ if s.is_nan() => f64::NAN,
            (Some((a, f)), Some((b, g))) => f + (g - f) * ((s - a) / (b - a)),
            (Some((_, f)), None) => f,
            (None, Some((_, g))) => *g,
            (None, None) => f64::NAN,
        }
    }

    /// Takes its rows; those that it has stay.
    pub(crate) fn fill(&self, rows: Vec<(f64, f64)>) {
        self.rows.get_or_init(|| rows);
    }
}

thread_local! {
    /// The tables of the source that is read at present.
    static IN_SCOPE: RefCell<Vec<Table>> = const { RefCell::new(Vec::new()) };
}

/// Takes the tables out of scope again, whatever happened.
struct Scope(Vec<Table>);

impl Drop for Scope {
    fn drop(&mut self) {
        IN_SCOPE.set(std::mem::take(&mut self.0));
    }
}

/// Reads something in whose expressions `tables` may be named.
pub(crate) fn with_tables<T>(tables: &[Table], read: impl FnOnce() -> T) -> T {
    let _scope = Scope(IN_SCOPE.replace(tables.to_vec()));
    read()
}

/// The tables that an expression may name at present.
pub(crate) fn in_scope() -> Vec<Table> {
    IN_SCOPE.with_borrow(Clone::clone)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_linear_between_rows_and_constant_beyond() {
        let table = Table::named("f");
        assert!(table.at(0.0).is_nan());
        table.fill(vec![(-1.0, 2.0), (0.0, 4.0), (2.0, -4.0)]);
        for (s, value) in [
            (-9.0, 2.0),
            (-1.0, 2.0),
            (-0.5, 3.0),
            (0.0, 4.0),
            (0.5, 2.0),
            (2.0, -4.0),
            (f64::INFINITY, -4.0),
        ] {
            assert_eq!(table.at(s), value, "{s}");
        }
        assert!(table.at(f64::NAN).is_nan());
    }
}
