//! Estimates of [SAND2015-7998] chapters 2 and 3 against what they estimate: (2.18), (2.23) to (2.28), (3.15), and the ghost strain of figure 2.1.
//!
//! | file | what |
//! |---|---|
//! | `continuum` | the bar of variable horizon by quadrature, without a grid |

pub mod continuum;

use crate::{
    Effort,
    bobaru::{
        line::{Line, Rule, Sharing, Weights},
        slope,
    },
    variable_horizon::{BarLaw, BarModel, linear_scale, profile},
};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    peridynamics::Micromodulus,
    progress::Progress,
};
use continuum::{Continuum, derivative, gauss_legendre};

/// Positions at which continuum fields are sampled.
const PLACES: [f64; 5] = [-0.9, -0.35, 0.1, 0.55, 1.2];

type Field = fn(f64) -> f64;

fn wave(x: f64) -> f64 {
    (1.3 * x + 0.2).sin()
}

fn uniform(x: f64) -> f64 {
    x
}

/// Stresses where the slope of the horizon is kept while the horizon goes to zero.
fn push_ramp(table: &mut Table, rule: &[(f64, f64)]) {
    // slope of the horizon kept while the horizon goes to zero
    let mut gaps = Vec::new();
    for e in [0.2, 0.1, 0.05] {
        let horizon = |x: f64| e + 0.3 * x;
        let bar = Continuum {
            displacement: &uniform,
            horizon: &horizon,
            rule,
        };
        gaps.push((bar.stress(0.0) - bar.partial_stress(0.0)).abs());
    }
    let spread =
        gaps.iter().copied().fold(0.0, f64::max) - gaps.iter().copied().fold(1.0, f64::min);
    table.push(TableRow::info("slope 0.3 kept, u = x", "stress, pd - ps", gaps[2]).differs(
        "(2.23) bounds it by delta |grad T1|, which is 0 under a uniform strain; a linear ramp leaves a constant stress difference of the order of the squared slope, \
         whatever the horizon. No ghost force follows (its divergence is 0), but pd and ps stresses do not meet",
    ));
    table.push(TableRow::at_most(
        "slope 0.3 kept, u = x",
        "its spread over three horizons",
        spread,
        1e-12,
    ));
}

/// Orders of (2.23) to (2.28) in δ = ε d(x).
fn orders() -> Table {
    let mut table = Table::new(
        "SAND2015-7998 (2.23)-(2.28): observed orders in the horizon, delta = eps d(x), u = sin(1.3 x + 0.2), eps 0.2 to 0.025",
        Columns::Full,
    );
    let rule = gauss_legendre(24);
    let scales: [(&str, &dyn Fn(f64) -> f64); 3] = [
        ("constant", &|_| 1.0),
        ("linear", &|x| 1.0 + 0.3 * x),
        ("curved", &|x| 1.0 + 0.3 * (1.7 * x).sin()),
    ];
    let names = [
        "(2.23) stress, pd - ps",
        "(2.25) stress, ps - 0",
        "(2.27) stress, pd - 0",
        "(2.24) force, pd - ps",
        "(2.26) force, ps - 0",
        "(2.28) force, pd - 0",
    ];
    for (case, scale) in scales {
        let eps = [0.2, 0.1, 0.05, 0.025];
        let mut differences = [[0.0f64; 4]; 6];
        let mut balance: f64 = 0.0;
        for (k, &e) in eps.iter().enumerate() {
            let horizon = |x: f64| e * scale(x);
            let bar = Continuum {
                displacement: &wave,
                horizon: &horizon,
                rule: &rule,
            };
            for x in PLACES {
                let phase = 1.3 * x + 0.2;
                let stress = [bar.stress(x), bar.partial_stress(x), 1.3 * phase.cos()];
                let force = [bar.force(x), bar.partial_force(x), -1.69 * phase.sin()];
                for (d, (i, j)) in [(0, 1), (1, 2), (0, 2)].into_iter().enumerate() {
                    let s = (stress[i] - stress[j]).abs();
                    differences[d][k] = differences[d][k].max(s);
                    let f = (force[i] - force[j]).abs();
                    differences[3 + d][k] = differences[3 + d][k].max(f);
                }
                balance = balance.max((derivative(|x| bar.stress(x), x, 0.02) - force[0]).abs());
            }
        }
        table.push(
            TableRow::at_most(case, "div of (2.8) against (2.5), largest", balance, 1e-9)
                .because("independent: the stress counts crossing bonds, the force those that end at the point"),
        );
        for (name, d) in names.into_iter().zip(&differences) {
            table.push(
                TableRow::at_least(case, format!("{name}: order"), slope(&eps, d), 0.95)
                    .with_reference(1.0)
                    .because("stated: O(delta) at least; in one dimension odd moments vanish or come with the slope of the horizon, which is of order eps too"),
            );
            table.push(TableRow::info(
                case,
                format!("{name}: at eps = 0.025"),
                d[3],
            ));
        }
    }
    push_ramp(&mut table, &rule);
    table
}

/// The ghost forces of both models on a bar of 400 points.
fn push_models(table: &mut Table, progress: &dyn Progress) {
    for (name, model) in [
        ("partial stress", BarModel::PartialStress),
        ("standard", BarModel::Standard),
    ] {
        let case = format!("{name}, 400 points, delta = 0.2 + 0.06 sin x");
        let what = "largest ghost force over E u'/L";
        let bar = profile::<1>(
            BarLaw::Correspondence,
            model,
            0.025,
            1,
            "0.2 + 0.06 * sin(x)",
            progress,
        );
        table.push(match bar {
            Ok(bar) => {
                let largest = bar.linear.iter().fold(0.0, |m: f64, a| m.max(a.abs()));
                let value = largest / linear_scale();
                match model {
                    BarModel::PartialStress => TableRow::at_most(case, what, value, 1e-8),
                    BarModel::Standard => TableRow::info(case, what, value),
                }
            }
            Err(e) => TableRow::refused(case, what, e.to_string()),
        });
    }
}

/// (2.18): the ghost force of a bar of variable horizon under u = x.
fn ghost_force(progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "SAND2015-7998 (2.18): ghost force under u = x, standard peridynamics, E = 1",
        Columns::Full,
    );
    let rule = gauss_legendre(24);
    let force = |horizon: &dyn Fn(f64) -> f64, x: f64| {
        Continuum {
            displacement: &uniform,
            horizon,
            rule: &rule,
        }
        .force(x)
    };
    let mut largest: f64 = 0.0;
    for ramp in [0.0, 0.1, 0.3, -0.3, 0.6] {
        largest = largest.max(force(&|x| 0.2 + ramp * x, 0.05).abs());
    }
    table.push(TableRow::at_most(
        "linear ramps of slope up to 0.6",
        "largest ghost force",
        largest,
        1e-11,
    ));
    let curvatures = [0.1, 0.05, 0.025, 0.0125, 0.00625];
    let forces: Vec<f64> = curvatures
        .iter()
        .map(|k| force(&|x| 0.2 + 0.3 * x + 0.5 * k * x * x, 0.0))
        .collect();
    table.push(TableRow::within(
        "slope 0.3, delta'' from 0.1 to 0.00625",
        "order in delta''",
        slope(&curvatures, &forces),
        1.0,
        0.02,
    ));
    table.push(TableRow::info(
        "slope 0.3",
        "ghost force over delta''",
        forces[4] / curvatures[4],
    ));
    table.push(
        TableRow::at_most(
            "slope 0, delta'' = 0.4",
            "ghost force",
            force(&|x| 0.2 + 0.2 * x * x, 0.0).abs(),
            1e-12,
        )
        .because("in one dimension the force is odd under reflection and delta'' is even: what is left is proportional to delta' delta'' and to delta delta'''"),
    );
    let eps = [0.2, 0.1, 0.05, 0.025];
    let shrinking: Vec<f64> = eps
        .iter()
        .map(|e| force(&|x| e * (1.0 + 0.3 * (1.7 * x).sin()), 0.4))
        .collect();
    table.push(
        TableRow::within(
            "delta = eps d(x)",
            "order in eps",
            slope(&eps, &shrinking),
            2.0,
            0.05,
        )
        .because("(2.18) alone would give 1; the factor delta' adds one"),
    );
    let bar = Continuum {
        displacement: &uniform,
        horizon: &|x| 0.2 + 0.3 * x + 0.2 * x * x,
        rule: &rule,
    };
    table.push(TableRow::at_most(
        "slope 0.3, delta'' = 0.4",
        "partial stress: its force",
        bar.partial_force(0.0).abs(),
        1e-12,
    ));
    push_models(&mut table, progress);
    table
}

/// The horizon of figure 2.1 as assumed: 1 on the left, 0.4 on the right, a ramp over |x| < 1.5.
fn figure_horizon(x: f64, smooth: Smooth) -> f64 {
    let t = ((x + 1.5) / 3.0).clamp(0.0, 1.0);
    let s = match smooth {
        Smooth::No => t,
        Smooth::Cubic => t * t * (3.0 - 2.0 * t),
    };
    1.0 - 0.6 * s
}

#[derive(Clone, Copy)]
enum Smooth {
    No,
    Cubic,
}

/// Largest |strain − 1| of the bar in equilibrium, and the largest force under u = x over E/δ.
fn ghost_strain(spacing: f64, sharing: Sharing, horizon: impl Fn(f64) -> f64) -> (f64, f64) {
    let half = 6.0;
    let n = (2.0 * half / spacing).round() as usize + 1;
    let x: Vec<f64> = (0..n).map(|i| i as f64 * spacing - half).collect();
    let horizons: Vec<f64> = x.iter().map(|&x| horizon(x)).collect();
    let rule = Rule {
        micromodulus: Micromodulus::Triangular,
        weights: Weights::Normalised,
        sharing,
    };
    let line = Line::new(x, &horizons, rule);
    // displacements are prescribed in layers as thick as the horizon, two horizons at the thick end for those who see them
    let held = |i: usize| (line.x[i].abs() > half - 1.5).then(|| line.x[i]);
    let u = line.equilibrium(&vec![0.0; n], held);
    let (mut strain, mut force): (f64, f64) = (0.0, 0.0);
    let mut forces = vec![0.0; n];
    line.force_into(&line.x, &mut forces);
    for i in 1..n - 1 {
        if held(i - 1).is_none() && held(i + 1).is_none() {
            strain = strain.max(((u[i + 1] - u[i - 1]) / (2.0 * spacing) - 1.0).abs());
            force = force.max(forces[i].abs());
        }
    }
    (strain, force)
}

/// Figure 2.1, and its cures.
fn figure() -> Table {
    let mut table = Table::new(
        "SAND2015-7998 figure 2.1: ghost strain of a bar under a nominal strain of 1, horizon from 1 to 0.4 over 3 (assumed), triangular micromodulus",
        Columns::Full,
    );
    let mut strains = [[0.0; 2]; 2];
    for (k, (name, smooth)) in [("piecewise linear", Smooth::No), ("cubic", Smooth::Cubic)]
        .into_iter()
        .enumerate()
    {
        for (l, spacing) in [0.04, 0.02].into_iter().enumerate() {
            let (strain, force) =
                ghost_strain(spacing, Sharing::Mean, |x| figure_horizon(x, smooth));
            strains[k][l] = strain;
            let case = format!("{name}, dx = {spacing}");
            table.push(TableRow::info(&case, "largest ghost strain", strain));
            table.push(TableRow::info(
                &case,
                "largest ghost force under u = x",
                force,
            ));
        }
    }
    table.push(
        TableRow::at_least(
            "dx = 0.02",
            "ghost strain, piecewise linear / cubic",
            strains[0][1] / strains[1][1],
            1.0,
        )
        .because("the report: the smoothed horizon has lower ghost strains; its geometry is only in the figure"),
    );
    let step = |x: f64| if x < 0.0 { 1.0 } else { 0.4 };
    let (strain, force) = ghost_strain(0.04, Sharing::Source, step);
    table.push(
        TableRow::at_most("splice of 1 and 0.4, dx = 0.04", "largest ghost strain", strain, 1e-11)
            .because("section 2.5: each point with its own horizon for both ends of a bond; the source-node rule of Bobaru 2009 is this splice"),
    );
    table.push(TableRow::at_most(
        "splice of 1 and 0.4, dx = 0.04",
        "largest ghost force under u = x",
        force,
        1e-11,
    ));
    let (strain, _) = ghost_strain(0.04, Sharing::Mean, step);
    table.push(TableRow::info(
        "step from 1 to 0.4, dx = 0.04",
        "largest ghost strain of standard peridynamics",
        strain,
    ));
    table
}

/// The bound (3.15) against the remainder of (3.13).
fn blending_bound() -> Table {
    let mut table = Table::new(
        "SAND2015-7998 (3.15): remainder of force-based blending in 1D against its bound, u = sin(k x), E = 1",
        Columns::Full,
    );
    let rule = gauss_legendre(8);
    let betas: [(&str, Field); 3] = [
        ("constant 0.5", |x| {
            if x < 0.0 {
                1.0
            } else if x < 1.0 {
                0.5
            } else {
                0.0
            }
        }),
        ("linear", |x| (1.0 - x).clamp(0.0, 1.0)),
        ("cubic", |x| {
            let t = (1.0 - x).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        }),
    ];
    for (name, beta) in betas {
        for delta in [0.4, 0.1] {
            let mut largest: f64 = 0.0;
            let mut mean = (0.0, 0.0);
            for k in [0.5, 1.5, 4.0] {
                for i in 0..=60 {
                    let x = -1.0 + 0.05 * f64::from(i) + 1e-3;
                    let (remainder, bound) = bounded(beta, delta, k, x, &rule);
                    // where everything is local there is nothing blended to bound, but the bound holds all the same
                    if bound > 1e-12 {
                        largest = largest.max(remainder / bound);
                        mean = (mean.0 + remainder, mean.1 + bound);
                    }
                }
            }
            let case = format!("beta {name}, delta = {delta}");
            table.push(
                TableRow::at_most(&case, "largest remainder / bound", largest, 1.0).because(
                    "read as d^6 (d+2)/12 Lambda/3 {...}: printed with Lambda twice, which has the wrong unit; sup of u'''' over the family",
                ),
            );
            table.push(TableRow::info(
                &case,
                "mean remainder / mean bound",
                mean.0 / mean.1,
            ));
        }
    }
    table
}

/// `|E(x)|` of (3.13) and the right-hand side of (3.15), for the constant micromodulus with `Λ = 1`.
fn bounded(beta: Field, delta: f64, k: f64, x: f64, rule: &[(f64, f64)]) -> (f64, f64) {
    let panels = 80;
    let width = 2.0 * delta / f64::from(panels);
    let (mut remainder, mut fourth): (f64, f64) = (0.0, 0.0);
    let (mut high, mut low) = (beta(x), beta(x));
    let taylor =
        |xi: f64| (k * x).sin() + k * xi * (k * x).cos() - 0.5 * (k * xi).powi(2) * (k * x).sin();
    for panel in 0..panels {
        for &(s, w) in rule {
            let xi = -delta + (f64::from(panel) + 0.5 * (1.0 + s)) * width;
            let there = beta(x + xi);
            (high, low) = (high.max(there), low.min(there));
            fourth = fourth.max((k * (x + xi)).sin().abs());
            // λ ξ² = 2/(δ² |ξ|): ∫_0^δ λ r⁴ dr = 1
            let rest = (k * (x + xi)).sin() - taylor(xi);
            remainder += 0.5 * w * width * (1.0 - 0.5 * (beta(x) + there)) * 2.0
                / (delta * delta * xi.abs())
                * rest;
        }
    }
    let first = (high - low) * delta * k.powi(3) * (k * x).cos().abs();
    let second = (1.0 - 0.5 * (beta(x) + low)) * delta * delta * k.powi(4) * fourth;
    (remainder.abs(), (first + second) / 12.0)
}

/// Runs the suite.
pub fn run(_effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    progress.stage("estimates of SAND2015-7998", None);
    let tables = vec![orders(), ghost_force(progress), figure(), blending_bound()];
    progress.finish();
    tables
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legendre_rule_is_exact_for_its_degree() {
        let rule = gauss_legendre(6);
        for k in 0..12 {
            let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(k)).sum();
            let exact = if k % 2 == 0 {
                2.0 / f64::from(k + 1)
            } else {
                0.0
            };
            assert!((sum - exact).abs() < 1e-14, "{k}: {sum}");
        }
    }

    #[test]
    fn constant_horizon_gives_the_fourier_symbol() {
        // u″ (1 − (kδ)²/12 · ⟨n⁴⟩/⟨n²⟩ + …), with moments of 1 − n²: ⟨n⁴⟩/⟨n²⟩ = 3/7
        let rule = gauss_legendre(24);
        let (k, delta) = (1.3, 0.05);
        let bar = Continuum {
            displacement: &wave,
            horizon: &|_| delta,
            rule: &rule,
        };
        let x: f64 = 0.3;
        let second = -k * k * (k * x + 0.2).sin();
        let expected = second * (1.0 - (k * delta).powi(2) / 12.0 * 3.0 / 7.0);
        assert!(
            (bar.force(x) / expected - 1.0).abs() < 1e-7,
            "{} {expected}",
            bar.force(x)
        );
    }

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
