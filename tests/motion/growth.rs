//! Partial stress whose modes grow: refused before the first step.

use crate::{bondline, run, write};

/// A bar with peridynamics in the middle and a constant influence function, whose short waves have a negative stiffness.
const GROWING: &str = r#"
kinematics = "bar"
[mesh.line]
min = 0
max = 30
x = { cells = 60 }
[materials.bar.lps]
youngs-modulus = 1
poisson-ratio = 0
density = 1
[peridynamics]
horizon = 1.5
influence = { degree = 0, alpha = 0 }
points.lattice = { spacing = 0.5 }
[zones]
nonlocal = { box = { min = 12, max = 18 } }
transition = { around = 3 }
[coupling.partial-stress]
form = "elements"
[solve.explicit]
duration = 200
outputs = 2
[initial.pulse.displacement]
x = "1e-3 * exp(-(x - 6)^2)"
[conditions.left.displacement]
on = "left"
x = 0
"#;

#[test]
fn partial_stress_that_would_grow_is_refused_with_a_remedy_before_the_first_step() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", GROWING);
    let output = bondline(folder.path())
        .args(["run", "bar.toml"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr).replace('│', " ");
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("influence function P_n/|xi|"), "{said}");
    assert!(said.contains("use coupling.truncated"), "{said}");
    assert!(said.contains("solver.unproven"), "{said}");
    let number = |before: &str| -> f64 {
        let rest = said.split_once(before).unwrap().1;
        let end = rest.find([' ', ')']).unwrap();
        rest[..end].parse().unwrap()
    };
    // a run long enough for powers of ten
    let rate = number("grows as exp(");
    assert!(rate > 0.316, "{said}");
    assert!(
        (number("by a factor of exp(") - 200.0 * rate).abs() < 0.1,
        "{said}"
    );
    // not one row of a history: nothing has moved
    assert!(!folder.path().join("out").exists());
}

#[test]
fn the_remedies_run() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", GROWING);
    let set = ["--set", "coupling=truncated"];
    run(folder.path(), &[&["bar.toml"][..], &set].concat());
    let shorter = [
        "--set",
        "peridynamics.influence={degree=1,alpha=1}",
        "--set",
        "solve.explicit.duration=15",
    ];
    let said = run(folder.path(), &[&["bar.toml"][..], &shorter].concat());
    // what is left grows too little to double the energy, and is told; the motion has so little of it that nothing is warned of
    assert!(said.contains("a mode grows by a factor of 1.0"), "{said}");
    assert!(!said.contains("W17"), "{said}");
}
