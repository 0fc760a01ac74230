//! Statements that sections 5.3 to 5.5 conclude from their figures, as rows.

use super::{
    figure,
    norms::median,
    problem::residual,
    study::{FIT_FROM, KERNELS, Kernel, Norm, Study, grid_sizes},
};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    peridynamics::{
        PartialVolume::{Exact, Full, Hhb, PdLammps},
        influence::{Alpha, Degree},
    },
};

/// Tolerance of an order of about one.
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

/// The residual of the exact solution over every N of the figure, which needs no solution: the error is that residual times the response to a uniform
/// body force, which hardly depends on the kernel.
pub(super) fn residuals<const D: usize>() -> Table {
    let mut table = Table::new(
        format!(
            "{D}D, {}: residual of the exact solution over |b|, every N from 75 to 150",
            figure::<D>()
        ),
        Columns::ByQuantity,
    );
    for alpha in Alpha::ALL {
        let mut medians = Vec::new();
        for kernel in KERNELS {
            let name = format!("{D}D {}", kernel.name::<D>(alpha));
            let all: Result<Vec<f64>, _> = grid_sizes(1)
                .into_iter()
                .map(|n| residual::<D>(&kernel.discretisation(n, alpha)).map(f64::abs))
                .collect();
            match all {
                Err(why) => table.push(TableRow::refused(name, "median", why.to_string())),
                Ok(all) => {
                    let middle = median(all.iter().copied());
                    let largest = all.iter().copied().fold(0.0, f64::max);
                    table.push(TableRow::info(&name, "median", middle));
                    table.push(TableRow::info(&name, "largest", largest));
                    medians.push((kernel, middle));
                }
            }
        }
        let of = |algorithm, degree| {
            let found = medians
                .iter()
                .find(|(k, _)| *k == Kernel { algorithm, degree });
            found.map_or(f64::NAN, |m| m.1)
        };
        let (full, ramp) = (of(Full, Degree::P0), of(PdLammps, Degree::P0));
        let (hhb, exact) = (of(Hhb, Degree::P0), of(Exact, Degree::P0));
        let case = format!("{D}D alpha = {}, P0", alpha.exponent());
        let rough = full.min(ramp);
        table.push(TableRow::at_most(
            &case,
            "HHB over the better of full and PDLAMMPS",
            hhb / rough,
            1.0,
        ));
        table.push(TableRow::at_most(&case, "exact over HHB", exact / hhb, 1.0));
    }
    table
}

/// Compares the accuracy of the algorithms, by medians of the nodal error over N.
fn accuracy<const D: usize>(study: &Study, table: &mut Table) {
    let norm = Norm::Nodal;
    for alpha in Alpha::ALL {
        let of = |algorithm, degree| study.curve(alpha, algorithm, degree);
        // the text says "for most grid spacings": fewer than three are not judged
        let judged = study.sizes().len() >= 3;
        let mut compare = |better: Option<&super::study::Curve>,
                           worse: Option<&super::study::Curve>,
                           limit: f64| {
            if let (Some(b), Some(w)) = (better, worse) {
                let case = format!("{} against {}", b.name::<D>(), w.name::<D>());
                let ratio = b.median(norm) / w.median(norm);
                table.push(ratio_row(
                    case,
                    "ratio of median errors, nodal L2",
                    ratio,
                    judged.then_some(limit),
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
                TableRow::at_most(
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
                TableRow::info(
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
                table.push(ratio_row(
                    format!("{} against {}", c.name::<D>(), w.name::<D>()),
                    "ratio of largest errors over N, nodal L2",
                    c.worst(norm) / w.worst(norm),
                    judged.then_some(1.0),
                ));
            }
        }
    }
}

fn ratio_row(case: String, quantity: &str, ratio: f64, limit: Option<f64>) -> TableRow {
    match limit {
        Some(limit) => TableRow::at_most(case, quantity, ratio, limit),
        None => TableRow::info(case, quantity, ratio),
    }
}

/// Tests the kernels that are said to converge with the first order or better, in the norm of the piecewise constant function.
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
                (1, Alpha::Zero) => TableRow::within(&name, quantity, order, 1.0, FIRST_ORDER),
                (1, Alpha::One) => TableRow::at_least(&name, quantity, order, 1.0),
                _ => TableRow::within(&name, quantity, order, 1.0, FIRST_ORDER_ROUGH),
            });
            if D == 1 {
                let rises = if curve.is_monotone(norm) { 0.0 } else { 1.0 };
                table.push(TableRow::at_most(
                    &name,
                    format!("error rises somewhere, {}, N >= {FIT_FROM}", norm.name()),
                    rises,
                    0.0,
                ));
            }
            table.push(TableRow::info(
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
    table.push(TableRow::info(
        &case,
        "inner points",
        most(&|o| o.points as f64),
    ));
    table.push(TableRow::info(
        &case,
        "directed bonds, most",
        most(&|o| o.bonds as f64),
    ));
    table.push(TableRow::info(
        &case,
        "iterations, median",
        median(at.iter().map(|o| o.1.iterations as f64)),
    ));
    table.push(TableRow::info(
        &case,
        "seconds a solve, most",
        most(&|o| o.time.as_secs_f64()),
    ));
}
