//! What sections 5.3 to 5.5 conclude from their figures, as rows.

use super::{
    figure,
    norms::median,
    study::{FIT_FROM, Norm, Study},
};
use crate::{
    observe::report::{Columns, Row, Table},
    peridynamics::{
        PartialVolume::{Exact, Full, Hhb, PdLammps},
        influence::{Alpha, Degree},
    },
};

/// How far an order of about one may lie from one.
const FIRST_ORDER: f64 = 0.05;
/// The same in 2D and 3D, where quadrature errors of the stiffness are still in sight at δ/h = 6.
const FIRST_ORDER_ROUGH: f64 = 0.3;

/// The rows of a dimension; none where nothing was solved.
pub(super) fn table<const D: usize>(study: &Study) -> Option<Table> {
    let mut table = Table::new(
        format!("{D}D, statements on {}", figure::<D>()),
        Columns::Full,
    );
    if study.sizes().is_empty() {
        return None;
    }
    accuracy::<D>(study, &mut table);
    if study.fits() {
        orders::<D>(study, &mut table);
    }
    times::<D>(study, &mut table);
    Some(table)
}

/// Which algorithm is more accurate than which, by medians of the nodal error over N.
fn accuracy<const D: usize>(study: &Study, table: &mut Table) {
    let norm = Norm::Nodal;
    for alpha in Alpha::ALL {
        let of = |algorithm, degree| study.curve(alpha, algorithm, degree);
        let mut compare = |better: Option<&super::study::Curve>,
                           worse: Option<&super::study::Curve>,
                           limit: f64| {
            if let (Some(b), Some(w)) = (better, worse) {
                table.push(Row::at_most(
                    format!("{} against {}", b.name::<D>(), w.name::<D>()),
                    "ratio of median errors, nodal L2",
                    b.median(norm) / w.median(norm),
                    limit,
                ));
            }
        };
        for degree in [Degree::P5, Degree::P7] {
            compare(of(Full, degree), of(Full, Degree::P0), 1.0);
        }
        for rough in [Full, PdLammps] {
            compare(of(Hhb, Degree::P0), of(rough, Degree::P0), 1.0);
            if D > 1 {
                compare(of(Exact, Degree::P0), of(rough, Degree::P0), 1.0);
            }
        }
        if D > 1 {
            compare(of(Exact, Degree::P0), of(Hhb, Degree::P0), 1.0);
        } else if let (Some(h), Some(e)) = (of(Hhb, Degree::P0), of(Exact, Degree::P0)) {
            let largest = h
                .errors(norm, 0)
                .zip(e.errors(norm, 0))
                .map(|(a, b)| (a.1 - b.1).abs())
                .fold(0.0, f64::max);
            table.push(
                Row::at_most(
                    format!("{} against {}", h.name::<D>(), e.name::<D>()),
                    "largest difference of errors, nodal L2",
                    largest,
                    1e-9,
                )
                .because("in 1D the ramp of HHB is the exact length, which the text does not say"),
            );
        }
        if let (Some(p), Some(f)) = (of(PdLammps, Degree::P0), of(Full, Degree::P0)) {
            table.push(
                Row::info(
                    format!("{} against {}", p.name::<D>(), f.name::<D>()),
                    "ratio of median errors, nodal L2",
                    p.median(norm) / f.median(norm),
                )
                .because("\"as poor as\" in the text"),
            );
        }
        // oscillation: how far the worst N lies above the median one
        for (calm, wild) in [
            (Hhb, Full),
            (Hhb, PdLammps),
            (Exact, Full),
            (Exact, PdLammps),
        ] {
            if let (Some(c), Some(w)) = (of(calm, Degree::P0), of(wild, Degree::P0)) {
                table.push(Row::at_most(
                    format!("{} against {}", c.name::<D>(), w.name::<D>()),
                    "ratio of largest errors over N, nodal L2",
                    c.worst(norm) / w.worst(norm),
                    1.0,
                ));
            }
        }
    }
}

/// Which kernels converge with the first order or better, in the norm of the piecewise constant function.
fn orders<const D: usize>(study: &Study, table: &mut Table) {
    let norm = Norm::Piecewise;
    for alpha in Alpha::ALL {
        for degree in [Degree::P3, Degree::P5, Degree::P7] {
            let Some(curve) = study.curve(alpha, Full, degree) else {
                continue;
            };
            let claimed = D == 3 || degree != Degree::P3;
            if !claimed {
                continue;
            }
            let name = curve.name::<D>();
            let quantity = format!("order, {}, N >= {FIT_FROM}", norm.name());
            let order = curve.order(norm);
            table.push(match (D, alpha) {
                (1, Alpha::Zero) => Row::within(&name, quantity, order, 1.0, FIRST_ORDER),
                (1, Alpha::One) => Row::at_least(&name, quantity, order, 1.0),
                _ => Row::within(&name, quantity, order, 1.0, FIRST_ORDER_ROUGH),
            });
            if D == 1 {
                let rises = if curve.is_monotone(norm) { 0.0 } else { 1.0 };
                table.push(Row::at_most(
                    &name,
                    format!("error rises somewhere, {}, N >= {FIT_FROM}", norm.name()),
                    rises,
                    0.0,
                ));
            }
            table.push(Row::info(
                &name,
                format!("order, nodal L2, N >= {FIT_FROM}"),
                curve.order(Norm::Nodal),
            ));
        }
    }
}

/// Time and iterations at the largest N.
fn times<const D: usize>(study: &Study, table: &mut Table) {
    let last = study.curves.iter().filter_map(|c| c.outcomes.last());
    let at: Vec<_> = last.collect();
    let Some(n) = at.first().map(|o| o.0) else {
        return;
    };
    let case = format!("{D}D, N = {n}");
    let most = |f: &dyn Fn(&super::problem::Outcome) -> f64| {
        at.iter().map(|o| f(&o.1)).fold(0.0, f64::max)
    };
    table.push(Row::info(&case, "inner points", most(&|o| o.points as f64)));
    table.push(Row::info(
        &case,
        "directed bonds, most",
        most(&|o| o.bonds as f64),
    ));
    table.push(Row::info(
        &case,
        "iterations, median",
        median(at.iter().map(|o| o.1.iterations as f64)),
    ));
    table.push(Row::info(
        &case,
        "seconds a solve, most",
        most(&|o| o.time.as_secs_f64()),
    ));
}
