//! A spacing that is far too small: refused, or counted, before anything is laid out.

use std::time::Instant;

use super::Case;

/// A plate whose zone holds 60 × 60 points.
const PLATE: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [1, 1]
x = { cells = 100 }
y = { cells = 100 }
[materials.m.bond-based]
youngs-modulus = 1
[peridynamics]
horizon = 0.03
points.lattice = { spacing = 0.01 }
[zones.nonlocal]
box = { min = [0.2, 0.2], max = [0.8, 0.8] }
[conditions.b.displacement]
on = "bottom"
x = 0
y = 0
"#;

/// Words of standard error, without the frame that miette draws.
fn words(output: &std::process::Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let words: Vec<&str> = text.split_whitespace().filter(|w| *w != "│").collect();
    words.join(" ")
}

#[test]
fn what_does_not_fit_is_refused_with_its_items_and_a_spacing_that_fits() {
    let case = Case::new(PLATE);
    for command in ["check", "run"] {
        let begun = Instant::now();
        let set = "peridynamics.points.lattice.spacing=0.0001";
        let output = case.command(command, &["--set", set]);
        let error = words(&output);
        assert_eq!(output.status.code(), Some(1), "{error}");
        for part in [
            "of memory",
            "bonds",
            "points",
            "a peridynamics.points.lattice.spacing of",
        ] {
            assert!(error.contains(part), "{part}: {error}");
        }
        assert!(begun.elapsed().as_secs_f64() < 5.0);
    }
}

#[test]
fn what_would_take_minutes_to_lay_out_is_counted() {
    let case = Case::new(PLATE);
    let begun = Instant::now();
    // 90 000 points with 2800 neighbours each, 250 million bonds: 10 GiB or so
    let set = "peridynamics.points.lattice.spacing=0.002";
    let output = case.command(
        "check",
        &["--json", "--set", set, "--set", "peridynamics.horizon=0.06"],
    );
    let seconds = begun.elapsed().as_secs_f64();
    assert!(seconds < 5.0, "{seconds} s");
    let Ok(told) = serde_json::from_slice::<serde_json::Value>(&output.stdout) else {
        // a machine with less memory refuses it
        assert!(words(&output).contains("of memory"), "{}", words(&output));
        return;
    };
    let points = told["sizes"]["points"].as_f64().unwrap_or(0.0);
    // 2820 lattice points lie within 30 spacings of one: Gauss's circle problem, N(30) − 1 = 2820; the circle has 2827
    let bonds = told["sizes"]["bonds"].as_f64().unwrap_or(0.0);
    assert!((points - 90_000.0).abs() < 1.0, "{points}");
    assert!(
        (bonds / points / 2820.0 - 1.0).abs() < 0.01,
        "{}",
        bonds / points
    );
    assert!(told["counted"].is_string(), "{told}");
}
