//! Dimensionless results do not depend on units, hardly on the place, and a linear body on the size of its displacements only in proportion.

use super::{
    body::{Body, METHODS, Solved},
    kept,
};
use crate::{observe::report::Row, verify::Effort};

/// Relative change that rounding may leave under other units.
pub const UNITS_LIMIT: f64 = 1e-10;

/// Relative change a million lengths from the origin: coordinates there have 1e-10 of the length left.
pub const FAR_LIMIT: f64 = 1e-6;

pub(super) fn rows(effort: Effort) -> Vec<Row> {
    let mut rows = Vec::new();
    let dimensions: &[usize] = match effort {
        Effort::Quick => &[1, 2],
        Effort::Full => &[1, 2, 3],
    };
    for &dimension in dimensions {
        for coupling in METHODS.iter().chain(&["local", "nonlocal"]) {
            let base = Body {
                dimension,
                cells: if dimension == 3 { 15 } else { 24 },
                ..Body::new(coupling)
            };
            let case = format!("{dimension}D {coupling}");
            match base.solve() {
                Ok(solved) => of(&case, &base, &solved, &mut rows),
                Err(why) => rows.push(kept(&case, "relative residual", Err(why), 1e-10)),
            }
        }
    }
    rows
}

fn of(case: &str, base: &Body, solved: &Solved, rows: &mut Vec<Row>) {
    let against = |body: Body, scale: f64| -> Result<f64, String> {
        let mut other = body.solve()?;
        other.samples.iter_mut().for_each(|u| *u *= scale);
        Ok(other.difference(solved))
    };
    let mut worst = Ok(0.0f64);
    for size in [1e-9, 1e-3, 1e3] {
        for modulus in [1e-6, 1.0, 1e15] {
            let changed = against(
                Body {
                    size,
                    modulus,
                    ..base.clone()
                },
                1.0,
            );
            worst = worst.and_then(|w| Ok(w.max(changed?)));
        }
    }
    rows.push(kept(
        case,
        "lengths 1e-9 to 1e3, moduli 1e-6 to 1e15: largest change",
        worst,
        UNITS_LIMIT,
    ));
    rows.push(kept(
        case,
        "a million lengths from the origin: change",
        against(
            Body {
                origin: 1e6,
                ..base.clone()
            },
            1.0,
        ),
        FAR_LIMIT,
    ));
    let mut worst = Ok(0.0f64);
    for stretch in [1e-14, 10.0] {
        let changed = against(
            Body {
                stretch,
                ..base.clone()
            },
            base.stretch / stretch,
        );
        worst = worst.and_then(|w| Ok(w.max(changed?)));
    }
    rows.push(kept(
        case,
        "displacements of 1e-14 and 10 lengths, linear bonds: largest change",
        worst,
        UNITS_LIMIT,
    ));
}
