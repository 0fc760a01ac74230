//! The seven-node system of section 2.3, its condition numbers, and the jumps (29) to (34).

use crate::bobaru::{
    KERNELS, PLAIN,
    line::{Line, Rule},
};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    peridynamics::Micromodulus,
};

/// The matrix as printed (its rows times 2Δx²), for the constant micromodulus.
const PRINTED: [[f64; 7]; 7] = [
    [-1.25, 1.0, 0.25, 0.0, 0.0, 0.0, 0.0],
    [0.5, -1.75, 1.0, 0.25, 0.0, 0.0, 0.0],
    [0.25, 1.0, -2.5, 1.0, 0.25, 0.0, 0.0],
    [0.0, 0.25, 1.0, -2.5, 1.0, 0.25, 0.0],
    [0.0, 0.0, 0.25, 1.0, -2.5, 1.0, 0.25],
    [0.0, 0.0, 0.0, 0.25, 1.0, -1.75, 0.5],
    [0.0, 0.0, 0.0, 0.0, 0.25, 1.0, -1.25],
];

const SINGULAR: &str = "every row of the printed matrix adds up to 0: it is singular, and the printed number is none of its condition \
    numbers; ours leaves out the rigid motion (largest over smallest singular value that is not 0)";

fn seven(micromodulus: Micromodulus) -> Line {
    let rule = Rule {
        micromodulus,
        ..PLAIN
    };
    Line::new((0..7).map(f64::from).collect(), &[2.0; 7], rule)
}

/// Entry by entry, and its condition.
pub fn matrix() -> Table {
    let mut table = Table::new(
        "Bobaru 2009, section 2.3: seven nodes, delta = 2 dx",
        Columns::Full,
    );
    let ours = 2.0 * seven(Micromodulus::InverseDistance).dense();
    let mut largest: f64 = 0.0;
    for i in 0..7 {
        for j in 0..7 {
            largest = largest.max((ours[(i, j)] - PRINTED[i][j]).abs());
        }
    }
    table.push(TableRow::at_most(
        "constant",
        "largest difference of 49 entries",
        largest,
        1e-14,
    ));
    for (name, kernel, printed) in [
        (KERNELS[0].0, KERNELS[0].1, Some(2.8e4)),
        (KERNELS[1].0, KERNELS[1].1, Some(0.7e4)),
        ("inverted triangular", Micromodulus::Constant, None),
    ] {
        let a = seven(kernel).dense();
        let rows = a.column_sum().amax();
        table.push(TableRow::at_most(name, "largest sum of a row", rows, 1e-14));
        let mut s: Vec<f64> = a.clone().singular_values().iter().copied().collect();
        s.sort_by(f64::total_cmp);
        let condition = s[6] / s[1];
        let row = TableRow::info(name, "condition number without the rigid motion", condition);
        table.push(match printed {
            Some(printed) => row.with_reference(printed).differs(SINGULAR),
            None => row.with_reference(1e18).differs(
                "printed for norm 1 and as 10^17 for the maximum norm: rounding of the inverse of the singular matrix",
            ),
        });
        let fixed = a.remove_row(3).remove_column(3);
        let s = fixed.singular_values();
        table.push(TableRow::info(
            name,
            "condition number with the middle node fixed",
            s.max() / s.min(),
        ));
    }
    table
}

/// Jumps of the bar under two forces, for the micromodulus whose spring stiffness is constant.
pub fn jumps() -> Table {
    let mut table = Table::new(
        "Bobaru 2009, eqs. (29)-(34): forces at x = +-1, delta = 1/4, inverted triangular micromodulus, by m = delta/dx",
        Columns::Full,
    );
    let (a, delta) = (1.0, 0.25);
    let mut errors = Vec::new();
    for m in [16usize, 32, 64] {
        let dx = delta / m as f64;
        let half = 8 * m;
        let x: Vec<f64> = (0..=2 * half)
            .map(|i| (i as f64 - half as f64) * dx)
            .collect();
        let n = x.len();
        let rule = Rule {
            micromodulus: Micromodulus::Constant,
            ..PLAIN
        };
        let line = Line::new(x, &vec![delta; n], rule);
        let mut load = vec![0.0; n];
        line.add_point_load(&mut load, a, 1.0);
        line.add_point_load(&mut load, -a, -1.0);
        let u = line.equilibrium(&load, |i| (i == half).then_some(0.0));
        let node = |at: f64| (at / dx + half as f64).round() as usize;
        // value on either side of a jump, each by the straight line through the two nodes before it
        let jump = |at: f64| {
            let k = node(at);
            let right = 2.0 * u[k + 1] - u[k + 2];
            let left = 2.0 * u[k - 1] - u[k - 2];
            right - left
        };
        // the singular part at the load: what stands out of the line through its neighbours, as an impulse
        let k = node(a);
        let peak = u[k] - 0.5 * (u[k - 1] + u[k + 1]);
        let case = format!("m = {m}");
        let (impulse, step) = (delta * delta / 6.0, delta / 12.0);
        let values = [
            peak * dx / impulse,
            jump(delta - a) / step,
            jump(delta + a) / -step,
        ];
        errors.push(values.map(|v| (v - 1.0).abs()));
        let last = m == 64;
        let names = [
            "impulse of u at a, (29)",
            "jump of u at delta - a, (32)",
            "jump of u at delta + a, (33)",
        ];
        for (k, what) in names.into_iter().enumerate() {
            let expected = [impulse, step, -step][k];
            let value = values[k] * expected;
            table.push(if last {
                TableRow::within(&case, what, value, expected, 0.03)
            } else {
                TableRow::info(&case, what, value).with_reference(expected)
            });
        }
        table.push(TableRow::within(
            &case,
            "peak of u at a over delta m, (34)",
            peak / (delta * m as f64),
            1.0 / 6.0,
            0.05,
        ));
    }
    for (k, what) in ["(29)", "(32)", "(33)"].iter().enumerate() {
        table.push(
            TableRow::at_least(
                *what,
                "order in 1/m between m = 16 and 64",
                (errors[0][k] / errors[2][k]).ln() / 4f64.ln(),
                0.8,
            )
            .because(
                "(30) to (33): the middle members of (32) and (33) lack the factor 1/P of (28), P = 6E/delta^2; their values have it",
            ),
        );
    }
    table
}
