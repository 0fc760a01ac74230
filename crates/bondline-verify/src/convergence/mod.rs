//! Convergence of meshfree quadratures: the studies of [SAND2015-7998] chapter 5, figures 5.3, 5.5 and 5.8.
//!
//! | file | what |
//! |---|---|
//! | `problem.rs` | the manufactured problems (5.9), (5.13), (5.19) |
//! | `stencil.rs` | the operator of a lattice, without a list of bonds |
//! | `transform.rs` | the convolution that applies it |
//! | `norms.rs` | error norms, observed orders, medians |
//! | `study.rs` | all kernels over a range of N |
//! | `statements.rs` | statements of the text on its figures, row by row |
//!
//! The figures have no numbers in the text; what it concludes from them does, and each conclusion is a row. The norm decides the order: the text
//! says "L²", and only the norm of the piecewise constant function shows what it reports.

pub mod norms;
pub mod problem;
mod statements;
pub mod stencil;
pub mod study;
pub mod transform;

use crate::Effort;
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};
use study::{KERNELS, Study, grid_sizes};

/// The suite `convergence`: bars and plates in full, solids to N = 90.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut tables = of_dimension::<1>(&grid_sizes(1), progress);
    let planes = grid_sizes(if effort == Effort::Quick { 15 } else { 1 });
    tables.extend(of_dimension::<2>(&planes, progress));
    tables.push(statements::residuals::<3>());
    if effort == Effort::Full {
        tables.extend(of_dimension::<3>(&[75, 90], progress));
    }
    progress.finish();
    tables
}

/// The suite `convergence-3d`: solids from N = 75 to 150 in steps of 15, quickly only the first.
pub fn run_solid(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut sizes = grid_sizes(15);
    if effort == Effort::Quick {
        sizes.truncate(1);
    }
    let tables = of_dimension::<3>(&sizes, progress);
    progress.finish();
    tables
}

fn of_dimension<const D: usize>(sizes: &[usize], progress: &dyn Progress) -> Vec<Table> {
    let cases = (2 * KERNELS.len() * sizes.len()) as u64;
    progress.stage(&format!("convergence, {D}D"), Some(cases));
    let study = Study::run::<D>(sizes, progress);
    let mut tables = vec![figures::<D>(&study)];
    tables.extend(statements::table::<D>(&study));
    tables
}

/// Name of a figure of the report.
fn figure<const D: usize>() -> &'static str {
    ["figure 5.3", "figure 5.5", "figure 5.8"][D - 1]
}

/// Medians and orders of every kernel, in all norms.
fn figures<const D: usize>(study: &Study) -> Table {
    let sizes = study.sizes();
    let range = match (sizes.first(), sizes.last()) {
        (Some(a), Some(b)) if a != b => format!("{} values of N from {a} to {b}", sizes.len()),
        (Some(a), _) => format!("N = {a}"),
        _ => String::new(),
    };
    let mut table = Table::new(
        format!(
            "{D}D, {}: error of {range} (median), and observed order over N >= {}",
            figure::<D>(),
            study::FIT_FROM
        ),
        Columns::ByQuantity,
    );
    for curve in &study.curves {
        let case = format!("{D}D {}", curve.name::<D>());
        if let Some(why) = &curve.failure {
            table.push(TableRow::refused(case, "median, nodal L2", why.clone()));
            continue;
        }
        for norm in study::Norm::ALL {
            table.push(TableRow::info(
                &case,
                format!("median, {}", norm.name()),
                curve.median(norm),
            ));
        }
        if study.fits() {
            for norm in study::Norm::ALL {
                table.push(order_row(
                    &case,
                    format!("order, {}", norm.name()),
                    curve.order(norm),
                ));
            }
        }
    }
    table
}

/// An order; a kernel that is exact at some N (1D, α = 1, exact lengths at whole δ/h) has none.
fn order_row(case: &str, quantity: String, order: f64) -> TableRow {
    if order.is_finite() {
        TableRow::info(case, quantity, order)
    } else {
        TableRow::refused(
            case,
            quantity,
            "the error is zero at some N, so that there is no order",
        )
    }
}
