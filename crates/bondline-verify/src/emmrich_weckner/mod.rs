//! The nonlocal bar of infinite length of \[EmmrichWeckner2007\]: Gauss–Hermite quadrature, midpoint rule and linear finite elements.
//!
//! Lengths are in units of L, times of L/c₀, displacements of U, energies of E U²/L; `λ = ℓ/L = 0.75` is the width of the micromodulus
//! `C = 4 exp(−(ζ̂−ζ)²/λ²) / (λ³ √π)`. The ordinary differential equations are solved exactly, by the eigenvectors of M⁻¹K, as in the paper. The
//! figures' curves are not in the text; what it states of them is.
//!
//! | file | what |
//! |---|---|
//! | `bar` | the three discretisations and their motion |

pub mod bar;
pub(crate) mod closed_form;

use std::f64::consts::PI;

use crate::Effort;
use bar::{Bar, Method};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};
use closed_form::{LAMBDA, energy_ratio, exact, exact_adaptive, initial, micromodulus};

fn solution() -> Table {
    let mut table = Table::new(
        "Emmrich & Weckner 2007: exact solution (3.1) and f(lambda)",
        Columns::Full,
    );
    let mut largest: f64 = 0.0;
    for tau in [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0] {
        for zeta in [0.0, 0.3, 1.0, 2.5, 4.0, 7.0, 13.0] {
            let difference = exact(zeta, tau, LAMBDA) - exact_adaptive(zeta, tau, LAMBDA, 1e-13);
            largest = largest.max(difference.abs());
        }
    }
    table.push(TableRow::at_most(
        "lambda = 0.75",
        "(3.1) against adaptive quadrature, 49 places and times",
        largest,
        1e-10,
    ));
    let start = [0.0, 0.4, 1.3, 3.0].map(|z| (exact(z, 0.0, LAMBDA) - initial(z)).abs());
    table.push(TableRow::at_most(
        "lambda = 0.75",
        "(3.1) at tau = 0 against the initial displacement",
        start.into_iter().fold(0.0, f64::max),
        1e-14,
    ));
    let dalembert = [0.0, 1.0, 2.0, 3.5].map(|z| {
        let wave = 0.5 * (initial(z - 2.0) + initial(z + 2.0));
        (exact(z, 2.0, 1e-4) - wave).abs()
    });
    table.push(TableRow::at_most(
        "lambda = 1e-4",
        "(3.1) at tau = 2 against d'Alembert",
        dalembert.into_iter().fold(0.0, f64::max),
        1e-7,
    ));
    for lambda in [0.1, 0.75, 3.0, 30.0] {
        // elastic energy by Fourier: ∫ û² (1 − exp(−k²λ²/4)) dk, apart from the closed form
        let h = 0.01;
        let transform: f64 = (-2000..=2000)
            .map(|i| {
                let k = h * f64::from(i);
                let u = PI.sqrt() * (-0.25 * k * k).exp();
                let kernel = 4.0 / (lambda * lambda) * -(-0.25 * (k * lambda).powi(2)).exp_m1();
                h * 0.5 * kernel * u * u / (2.0 * PI)
            })
            .sum();
        let classical = PI.sqrt() / (2.0 * 2f64.sqrt());
        table.push(TableRow::within(
            format!("lambda = {lambda}"),
            "f(lambda), closed form against the energy by Fourier",
            energy_ratio(lambda),
            transform / classical,
            1e-10,
        ));
    }
    table.push(TableRow::within(
        "lambda -> 0",
        "f",
        energy_ratio(1e-4),
        1.0,
        1e-7,
    ));
    table.push(TableRow::at_most(
        "lambda -> infinity",
        "f",
        energy_ratio(1e4),
        1e-7,
    ));
    table
}

/// The methods against each other, as far as the text compares them.
fn compare(table: &mut Table, between: &[[f64; 2]]) {
    if let [hermite, midpoint, elements, half_hats] = *between {
        for (k, time) in ["tau = 2", "tau = 8"].into_iter().enumerate() {
            table.push(
                TableRow::info(
                    time,
                    "error midpoint / Gauss-Hermite",
                    midpoint[k] / hermite[k],
                )
                .because("the text: almost the same accuracy, Gauss-Hermite somewhat better"),
            );
            let ratio = elements[k] / hermite[k];
            let row = TableRow::info(time, "error elements / Gauss-Hermite", ratio);
            table.push(if ratio < 1.0 {
                row.because("the text: elements are best")
            } else {
                row.differs(
                    "the text: elements are best. At the nodes they are so only once waves have come back from the ends, and owe that to whole hats, whose rows at \
                    the ends do not add up to 0 and hold the bar there; half hats do not",
                )
            });
            table.push(TableRow::info(
                time,
                "error half hats / whole hats",
                half_hats[k] / elements[k],
            ));
        }
    }
}

fn discretisations(n: usize) -> Table {
    let mut table = Table::new(
        format!(
            "Emmrich & Weckner 2007, figures 2 to 7: N = {}, lambda = 0.75, exact in time",
            n - 1
        ),
        Columns::Full,
    );
    let total = PI.sqrt() / (2.0 * 2f64.sqrt()) * energy_ratio(LAMBDA);
    let mut between = Vec::new();
    for method in Method::ALL {
        let Some(bar) = Bar::new(method, n) else {
            table.push(TableRow::info(method.name(), "mass matrix", f64::NAN));
            continue;
        };
        let name = method.name();
        let row_sum = bar.largest_row_sum();
        table.push(match method {
            Method::Elements => TableRow::info(name, "largest sum of a row of K", row_sum)
                .because("remark 1: approximately zero; the rows at the ends are not"),
            _ => TableRow::at_most(name, "largest sum of a row of K", row_sum, 1e-12),
        });
        let (kinetic, elastic) = bar.energies(0.0);
        let first = kinetic + elastic;
        let drift = (1..=40)
            .map(|k| {
                let (kinetic, elastic) = bar.energies(0.5 * f64::from(k));
                ((kinetic + elastic) / first - 1.0).abs()
            })
            .fold(0.0, f64::max);
        table.push(TableRow::at_most(
            name,
            "change of the energy, tau <= 20",
            drift,
            1e-10,
        ));
        table.push(TableRow::info(name, "energy at tau = 0", first).with_reference(total));
        for tau in [1.0, 2.0, 4.0, 8.0, 16.0] {
            let value = bar.error(tau);
            let quantity = format!("error at the nodes, tau = {tau}");
            let sharp = method == Method::GaussHermite && n == 99 && tau == 4.0;
            table.push(if sharp {
                TableRow::at_most(name, quantity, value, 1e-9)
            } else {
                TableRow::info(name, quantity, value)
            });
        }
        if method == Method::GaussHermite && n == 99 {
            table.push(TableRow::at_most(
                name,
                "largest error at a node, tau = 4",
                bar.largest_error(4.0),
                1e-9,
            ));
        }
        let e = bar.error_between(2.0);
        table.push(TableRow::info(
            name,
            "error of the function linear between nodes, tau = 2",
            e,
        ));
        between.push([bar.error(2.0), bar.error(8.0)]);
    }
    compare(&mut table, &between);
    table
}

/// The printed stiffness of the midpoint rule, whose factor h² misses a parenthesis.
fn misprint() -> Table {
    let mut table = Table::new(
        "Emmrich & Weckner 2007: K of the midpoint rule, N = 24",
        Columns::Full,
    );
    if let Some(bar) = Bar::new(Method::Midpoint, 25) {
        let n = bar.x.len();
        let h = bar.x[1] - bar.x[0];
        let c = |i: usize, j: usize| micromodulus(bar.x[j] - bar.x[i], LAMBDA);
        let row = |i: usize| {
            let all: f64 = (0..n).map(|k| c(i, k)).sum();
            // h² Σ_k C_ik δ_ij − C_ij, as printed
            h * h * all - all
        };
        let largest = (0..n).map(|i| row(i).abs()).fold(0.0, f64::max);
        table.push(TableRow::info("as printed", "largest sum of a row of K", largest).differs(
            "printed: h^2 sum_k C_ik delta_ij - C_ij; meant: h^2 (sum_k C_ik delta_ij - C_ij), whose rows add up to 0 as remark 1 says",
        ));
        table.push(TableRow::at_most(
            "with the parenthesis",
            "largest sum of a row of K",
            bar.largest_row_sum(),
            1e-12,
        ));
    }
    table
}

/// Runs the suite.
pub fn run(_effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    progress.stage("bar of Emmrich and Weckner", None);
    let tables = vec![
        solution(),
        misprint(),
        discretisations(25),
        discretisations(99),
    ];
    progress.finish();
    tables
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_row_is_short() {
        for table in run(Effort::Quick, &bondline::progress::Silent) {
            assert_eq!(
                table.count(bondline::observe::report::Verdict::Short),
                0,
                "{}",
                table.text()
            );
        }
    }
}
