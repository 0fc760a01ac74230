//! A splice whose points lie between the nodes of a bar: a mode grows, a run that it spoils stops, and one that has hardly any of it does not.

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

/// Time, and kinetic plus stored energy, of every row of the history.
fn energies(case: &Case) -> Vec<(f64, f64)> {
    let rows = case.read("out/scene_history.csv");
    rows.lines()
        .skip(1)
        .map(|row| {
            let column = |k: usize| -> f64 { row.split(',').nth(k).unwrap().parse().unwrap() };
            (column(1), column(2) + column(3))
        })
        .collect()
}

/// The rate of `exp(rate t)` that a message names.
fn rate(said: &str) -> f64 {
    let (_, behind) = said.split_once("grows as exp(").expect("a rate");
    let (number, _) = behind.split_once(" t)").expect("a rate");
    number.parse().expect("a number")
}

/// The mode grows by exp(12.3) from what a sine has of it, which is next to nothing.
#[test]
fn a_motion_that_has_hardly_any_of_the_mode_runs_without_a_warning() {
    let case = Case::new(BAR);
    let summary = case.run(&[]).expect("it runs");
    let warnings = &summary["warnings"];
    assert!(warnings.is_null(), "{warnings}");
    let energies = energies(&case);
    let last = energies.last().expect("a row").1 / energies[0].1;
    assert!((last - 1.0).abs() < 1e-3, "{last}");
}

#[test]
fn a_longer_run_stops_where_the_energy_grows() {
    let case = Case::new(BAR);
    let longer = ["--set", "solve.explicit.duration=24"];
    // one that is denied does not begin
    let denied = [&longer[..], &["--set", "warnings.deny=[\"W17\"]"]].concat();
    let said = case.run(&denied).unwrap_err();
    for part in [
        "grows as exp(",
        "largest at (",
        "coupling.truncated",
        "warnings.deny",
    ] {
        assert!(said.contains(part), "{said}");
    }
    // it stops once a tenth of the energy comes from nowhere
    let output = case.command("run", &longer);
    assert_eq!(output.status.code(), Some(3));
    let warned = String::from_utf8_lossy(&output.stdout);
    assert!(warned.contains("without work"), "{warned}");
    let energies = energies(&case);
    let gained = |e: &(f64, f64)| e.1 / energies[0].1 - 1.0;
    let last = energies.last().unwrap();
    assert!((0.09..0.25).contains(&gained(last)), "{last:?}");
    // the mode's own energy grows as exp(2 rate t): what the run gained is what was told, within a factor of 3
    let early = energies.iter().find(|e| gained(e) > 0.01).unwrap();
    let found = (gained(last) / gained(early)).ln() / (2.0 * (last.0 - early.0));
    let told = rate(&said);
    assert!(
        (told / 3.0..told * 3.0).contains(&found),
        "{found} for {told}"
    );
}
