//! Poisson ratios up to incompressible, and any ratio of horizon to spacing.

use super::{
    body::{Body, METHODS},
    kept, refused,
};
use crate::Effort;
use bondline::observe::report::TableRow;

/// Relative residual that every solution must reach.
pub const RESIDUAL_LIMIT: f64 = 1e-10;

/// Relative change of a result when m passes a whole number by 1e-9 on either side, with an influence function that vanishes at the horizon.
pub const CONTINUITY_LIMIT: f64 = 1e-6;

/// The same where cells change their role at a whole m.
pub const ROLES_LIMIT: f64 = 1e-3;

pub(super) fn poisson(effort: Effort) -> Vec<TableRow> {
    let ratios: &[f64] = match effort {
        Effort::Quick => &[-0.9, 0.0, 0.4999],
        Effort::Full => &[-0.9, -0.5, 0.0, 0.25, 0.4, 0.49, 0.4999],
    };
    let mut rows = Vec::new();
    for coupling in METHODS.iter().chain(&["local", "nonlocal"]) {
        let body = |nu: f64| Body {
            poisson: Some(nu),
            ..Body::new(coupling)
        };
        for &nu in ratios {
            let case = format!("{coupling}, Poisson ratio {nu}");
            let result = body(nu).solve();
            // bonds of truncated need a positive part of the dilatation: ν at least 1/4 in the plane of strain
            if *coupling == "truncated" && nu < 0.25 && result.is_err() {
                rows.push(refused(&case, result.map(|s| s.residual), &["Poisson"]));
                continue;
            }
            rows.push(kept(
                &case,
                "relative residual",
                result.and_then(|s| match s.samples.iter().all(|u| u.is_finite()) {
                    true => Ok(s.residual),
                    false => Err("a displacement is no number".to_owned()),
                }),
                RESIDUAL_LIMIT,
            ));
        }
        for nu in [0.5, -1.0] {
            rows.push(refused(
                &format!("{coupling}, Poisson ratio {nu}"),
                body(nu).solve().map(|s| s.residual),
                &["poisson-ratio"],
            ));
        }
    }
    rows
}

pub(super) fn ratio(effort: Effort) -> Vec<TableRow> {
    let ratios: &[f64] = match effort {
        Effort::Quick => &[1.01, 1.5, 3.015, 6.0],
        Effort::Full => &[
            1.01, 1.2, 1.5, 2.0, 2.5, 3.015, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0,
        ],
    };
    let mut rows = Vec::new();
    for coupling in METHODS {
        for &m in ratios {
            // the zone holds families whole, and its surroundings the transition
            let cells = if m > 2.5 { 72 } else { 24 };
            // the rows of a blending, as far as a collar of one horizon, keep their families off the faces that are held and pulled
            let (cells, room) = match coupling {
                "blending" => {
                    let cells = if m > 8.0 { 96 } else { cells };
                    (cells, 1.0 / 3.0 - (2.0 * m + 1.0) / cells as f64)
                }
                _ => (cells, f64::INFINITY),
            };
            let body = Body::new(coupling);
            let result = Body {
                ratio: m,
                cells,
                transition: body.transition.min(room),
                ..body
            }
            .solve();
            let case = format!("{coupling}, m = {m}");
            let result = result.map(|s| s.residual);
            rows.push(if m < 2f64.sqrt() {
                // bonds along the axes alone carry no shear
                refused(
                    &case,
                    result,
                    &["peridynamics.weights", "isotropic", "horizon"],
                )
            } else {
                kept(&case, "relative residual", result, RESIDUAL_LIMIT)
            });
        }
    }
    rows.push(refused(
        "splice, m = 0.99: no point has a neighbour",
        Body {
            ratio: 0.99,
            ..Body::new("splice")
        }
        .solve()
        .map(|s| s.residual),
        &["horizon"],
    ));
    for coupling in METHODS.iter().chain(&["nonlocal"]) {
        for m in [2.0, 3.0, 4.0] {
            let at = |m: f64| {
                Body {
                    ratio: m,
                    influence: Some(3),
                    cells: 48,
                    ..Body::new(coupling)
                }
                .solve()
            };
            // there a layer of cells more takes part when families reach it: another model, as close as its discretisation
            let limit = match *coupling {
                "blending" | "partial-stress" => ROLES_LIMIT,
                _ => CONTINUITY_LIMIT,
            };
            let jump = at(m * (1.0 - 1e-9)).and_then(|a| Ok(a.difference(&at(m * (1.0 + 1e-9))?)));
            rows.push(kept(
                &format!("{coupling}, m through {m}, P3"),
                "change of displacement",
                jump,
                limit,
            ));
        }
    }
    rows
}
