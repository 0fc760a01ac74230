//! Tables III and IV: a wave on grids that do not change.

use crate::{
    Effort,
    bobaru::{
        KERNELS, PLAIN,
        line::{Line, Motion, Rule, RungeKutta, Weights},
        slope,
    },
};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    peridynamics::Micromodulus,
};

/// Step of the Runge–Kutta method: every printed arrival time is a multiple of it.
pub const STEP: f64 = 0.15;

/// Initial displacement, eq. of section 6.
pub fn initial(x: f64) -> f64 {
    0.02 * (-0.01 * x * x).exp()
}

/// The largest value at a place, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Displacement.
    pub amplitude: f64,
    /// Time of the step at which it is met.
    pub time: f64,
}

/// Lets the wave run over a bar that does not change, and looks for the peak at `at` between two times.
pub fn peak(line: &Line, at: f64, from: f64, to: f64) -> Peak {
    let mut motion = Motion::at_rest(line, initial);
    let mut work = RungeKutta::default();
    let mut best = Peak {
        amplitude: f64::NEG_INFINITY,
        time: from,
    };
    let steps = (to / STEP).round() as usize;
    for s in 1..=steps {
        motion.runge_kutta(line, STEP, &mut work);
        let time = s as f64 * STEP;
        let amplitude = line.value(&motion.u, at);
        if time >= from && amplitude > best.amplitude {
            best = Peak { amplitude, time };
        }
    }
    best
}

fn uniform(length: f64, nodes: usize) -> Vec<f64> {
    (0..nodes)
        .map(|i| length * i as f64 / (nodes - 1) as f64)
        .collect()
}

/// Table III: the reflection at a change of spacing.
pub fn table_three() -> Table {
    let mut table = Table::new(
        "Bobaru 2009, Table III: wave reflected at x = 200, where the spacing changes; horizon 0.5 everywhere, L = 300, met at x = 150",
        Columns::Full,
    );
    for (case, middle, printed) in [
        ("a 2:1", 1000, [(252.15, 1.169), (249.15, 0.084)]),
        ("b 4:1", 2000, [(252.30, 3.356), (252.30, 1.495)]),
    ] {
        let mut shares = [0.0; 2];
        for (k, (kernel, micromodulus)) in KERNELS.into_iter().enumerate() {
            let mut x: Vec<f64> = (0..500).map(|i| 0.2 * f64::from(i)).collect();
            x.extend((0..middle).map(|i| 100.0 + 100.0 * f64::from(i) / f64::from(middle)));
            x.extend((0..=500).map(|i| 200.0 + 0.2 * f64::from(i)));
            let horizon = vec![0.5; x.len()];
            let line = Line::new(
                x,
                &horizon,
                Rule {
                    micromodulus,
                    ..PLAIN
                },
            );
            let found = peak(&line, 150.0, 230.0, 270.0);
            shares[k] = 100.0 * found.amplitude / 0.01;
            let name = format!("{case} {kernel}");
            table.push(TableRow::within(
                &name,
                "time at the middle",
                found.time,
                printed[k].0,
                0.002,
            ));
            let row = TableRow::info(&name, "reflected amplitude [%]", shares[k])
                .with_reference(printed[k].1);
            let near = (shares[k] / printed[k].1 - 1.0).abs() < 0.02;
            table.push(if near {
                row
            } else {
                row.differs("the cells at the two changes of spacing are not stated; here each cell ends half-way to its neighbour, and there is one node more (2001, 3001)")
            });
        }
        table.push(TableRow::at_least(
            case,
            "reflection constant / triangular",
            shares[0] / shares[1],
            1.0,
        ));
    }
    table.push(
        TableRow::within("a 2:1", "stiffness of the coarse part, constant", modulus(Micromodulus::InverseDistance, 0.2), 0.96, 1e-12)
            .because("the reflection is that of a change of stiffness: a midpoint rule with m = 2.5 has 0.96 of it for either micromodulus, m = 5 has 1 (constant) \
                or 0.96 (triangular), so that in case a the triangular one meets no change, by chance and not by its continuity"),
    );
    table.push(TableRow::within(
        "a 2:1",
        "stiffness of the fine part, constant",
        modulus(Micromodulus::InverseDistance, 0.1),
        1.0,
        1e-12,
    ));
    table.push(TableRow::within(
        "a 2:1",
        "stiffness of the coarse part, triangular",
        modulus(Micromodulus::Triangular, 0.2),
        0.96,
        1e-12,
    ));
    table.push(TableRow::within(
        "a 2:1",
        "stiffness of the fine part, triangular",
        modulus(Micromodulus::Triangular, 0.1),
        0.96,
        1e-12,
    ));
    table
}

/// Young's modulus of a uniform grid with horizon 0.5.
fn modulus(micromodulus: Micromodulus, spacing: f64) -> f64 {
    let x: Vec<f64> = (0..21).map(|i| spacing * f64::from(i)).collect();
    let line = Line::new(
        x,
        &[0.5; 21],
        Rule {
            micromodulus,
            ..PLAIN
        },
    );
    line.bonds(10)
        .map(|(j, k)| 0.5 * k * (line.x[j] - line.x[10]).powi(2))
        .sum()
}

/// Arrival, amplitude and the size of families of a grid, against the printed ones.
fn push_raw(
    table: &mut Table,
    case: &str,
    found: &Peak,
    (n, horizon, inside, time, amplitude): (i32, f64, i32, f64, f64),
) {
    table.push(TableRow::within(case, "arrival", found.time, time, 1e-9));
    // the table cuts its digits
    table.push(TableRow::within(
        case,
        "amplitude",
        found.amplitude,
        amplitude,
        1.1e-3,
    ));
    let m = horizon * f64::from(n - 1) / 450.0;
    let family = 2.0 * (m + 1e-9).floor() + 1.0;
    let row =
        TableRow::info(case, "nodes in the horizon", family).with_reference(f64::from(inside));
    table.push(if family == f64::from(inside) {
                    row
                } else {
                    row.differs("the printed horizon and number of nodes give another m than the printed count; the arrival times are those of the horizon")
                });
    table.push(TableRow::info(
        case,
        "arrival by stiffness alone, 400/sqrt(1 - 1/m^2)",
        400.0 / (1.0 - 1.0 / (m * m)).sqrt(),
    ));
}

/// Rates of convergence of the arrival and the amplitude.
fn push_rates(table: &mut Table, weights: Weights, effort: Effort, late: f64, low: f64) {
    if weights == Weights::Raw && effort == Effort::Full {
        table.push(TableRow::within(
            "raw",
            "rate of the arrival",
            late,
            1.245,
            0.05,
        ));
        table.push(TableRow::within(
            "raw",
            "rate of the amplitude",
            low,
            1.371,
            0.05,
        ));
    } else if effort == Effort::Full {
        table.push(TableRow::info("normalised", "rate of the arrival", late));
        table.push(TableRow::info("normalised", "rate of the amplitude", low));
    }
}

/// Table IV: uniform refinement, with the volumes of the text and with normalised weights.
pub fn table_four(effort: Effort) -> Table {
    let mut table = Table::new(
        "Bobaru 2009, Table IV: wave at x = 400, uniform grids, L = 450, triangular micromodulus, Runge-Kutta with dt = 0.15",
        Columns::Full,
    );
    let cases = [
        (451, 3.0, 7, 426.60, 0.00970),
        (901, 2.5, 11, 409.95, 0.00982),
        (1351, 2.0, 13, 406.80, 0.00991),
        (2701, 1.5, 21, 403.20, 0.00997),
        (3001, 1.4, 23, 402.15, 0.00998),
    ];
    let cases = match effort {
        Effort::Quick => &cases[..3],
        Effort::Full => &cases[..],
    };
    let nodes: Vec<f64> = cases.iter().map(|c| f64::from(c.0)).collect();
    for weights in [Weights::Raw, Weights::Normalised] {
        let mut late = Vec::new();
        let mut low = Vec::new();
        for &(n, horizon, inside, time, amplitude) in cases {
            let line = Line::new(
                uniform(450.0, n as usize),
                &vec![horizon; n as usize],
                Rule {
                    weights,
                    micromodulus: Micromodulus::Triangular,
                    ..PLAIN
                },
            );
            let found = peak(&line, 400.0, 380.0, 440.0);
            late.push(100.0 * (found.time - 400.0) / 400.0);
            low.push(100.0 * (0.01 - found.amplitude) / 0.01);
            let word = if weights == Weights::Raw {
                "raw"
            } else {
                "normalised"
            };
            let case = format!("{word}, {n} nodes");
            if weights == Weights::Raw {
                push_raw(
                    &mut table,
                    &case,
                    &found,
                    (n, horizon, inside, time, amplitude),
                );
            } else {
                table.push(TableRow::info(&case, "arrival", found.time).with_reference(time));
                table.push(
                    TableRow::info(&case, "amplitude", found.amplitude).with_reference(amplitude),
                );
            }
        }
        push_rates(
            &mut table,
            weights,
            effort,
            -slope(&nodes, &late),
            -slope(&nodes, &low),
        );
    }
    table.push(TableRow::within(
        "initial",
        "elastic energy over E a^2/2, with omega = 1/4",
        gaussian_energy(0.25),
        (std::f64::consts::PI * 0.125).sqrt(),
        1e-12,
    ).because("section 6.1: sqrt(pi omega/2) E a^2/2 for u = a exp(-omega x^2), by quadrature of u'^2"));
    table
}

/// `∫ (u′)² dx` of `exp(−ω x²)` by the trapezoidal rule, which is spectrally exact here.
fn gaussian_energy(omega: f64) -> f64 {
    let h = 0.05;
    (-600..=600)
        .map(|i| {
            let x = h * f64::from(i);
            let slope = -2.0 * omega * x * (-omega * x * x).exp();
            h * slope * slope
        })
        .sum()
}
