//! A splice whose points lie between the nodes of a bar: a mode grows, and the run that it would spoil does not begin.

use crate::Case;

const BAR: &str = r#"
kinematics = "bar"
[mesh.line]
min = 0
max = 1
x = { cells = 160 }
[materials.m.bond-based]
youngs-modulus = 1
density = 1
[peridynamics]
horizon = 0.01875
points = "cells"
[zones]
nonlocal.box = { min = 0.3, max = 0.7 }
[coupling.splice]
[conditions.l.displacement]
on = "left"
x = 0
[initial.u.displacement]
x = "1e-3*sin(pi*x/2)"
[solve.explicit]
duration = 12
step-fraction = 0.5
outputs = 1
[output]
vtu = false
"#;

/// Kinetic plus stored energy of every row of the history.
fn energies(case: &Case) -> Vec<f64> {
    let rows = case.read("out/scene_history.csv");
    rows.lines()
        .skip(1)
        .map(|row| {
            let column = |k: usize| -> f64 { row.split(',').nth(k).unwrap().parse().unwrap() };
            column(2) + column(3)
        })
        .collect()
}

#[test]
fn the_energy_is_bounded_or_the_run_is_refused_or_stops() {
    let case = Case::new(BAR);
    match case.run(&[]) {
        Ok(_) => {
            // a seam that is stable there keeps the energy to what it exchanges with a wave
            let energies = energies(&case);
            let largest = energies.iter().copied().fold(0.0, f64::max);
            assert!(largest < 1.1 * energies[0], "{}", largest / energies[0]);
        }
        Err(said) => {
            for part in [
                "grows as exp(",
                "largest at (",
                "coupling.truncated",
                "growing-modes",
            ] {
                assert!(said.contains(part), "{said}");
            }
            // let begin all the same, it stops once a tenth of the energy comes from nowhere
            let longer = "solve.explicit.duration=24";
            let warn = "solve.explicit.growing-modes=warn";
            let output = case.command("run", &["--set", warn, "--set", longer]);
            assert_eq!(output.status.code(), Some(3));
            let said = String::from_utf8_lossy(&output.stdout);
            assert!(said.contains("without work"), "{said}");
            let energies = energies(&case);
            let last = energies.last().unwrap() / energies[0];
            assert!((1.09..1.25).contains(&last), "{last}");
        }
    }
}
