//! Sub-cycling in scenes: the seam alone takes the small step.

use crate::{BREAKING, bondline, column, run, same, write};

/// Elements twice as long as the spacing: the seam limits the step.
fn truncated() -> String {
    BREAKING
        .replace(
            "[coupling.splice]",
            "[coupling.truncated]\ncut-bonds = \"linear\"",
        )
        .replace("cells = 12", "cells = 6")
        .replace("cells = 24", "cells = 12")
}

const TWO: [&str; 2] = ["--set", "solve.explicit.sub-steps=2"];

#[test]
fn sub_steps_leave_the_same_bytes_on_any_threads_and_across_a_resume() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", &truncated());
    let every = [&["bar.toml", "--checkpoint-every", "7"][..], &TWO].concat();
    let to = |output: &'static str, more: &[&'static str]| {
        run(
            folder.path(),
            &[&every[..], &["--output", output], more].concat(),
        );
    };
    to("one", &["--threads", "1"]);
    to("two", &["--threads", "2"]);
    let said = run(folder.path(), &[&every[..], &["--output", "told"]].concat());
    assert!(said.contains("2 sub-steps of"), "{said}");
    let broken = column(&folder.path().join("one/bar_history.csv"), "broken_bonds");
    assert!(*broken.last().unwrap() > 20.0, "{broken:?}");
    same(&folder.path().join("one"), &folder.path().join("two"));
    // from the last checkpoint but one
    std::fs::remove_file(folder.path().join("two/bar.checkpoint")).unwrap();
    to("two", &["--resume"]);
    same(&folder.path().join("one"), &folder.path().join("two"));
}

#[test]
fn a_seam_without_an_energy_is_not_sub_cycled() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", BREAKING);
    let output = bondline(folder.path())
        .args(["run", "bar.toml"])
        .args(TWO)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr);
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("symmetric stiffness"), "{said}");
    assert!(said.contains("coupling.truncated"), "{said}");
}

/// A plate of perfect plasticity, pulled to ten times its strain at yield.
const YIELDING: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
[mesh.rectangle]
min = [0, 0]
max = [1, 1]
x = { cells = 10 }
y = { cells = 10 }
[materials.plate.plastic-correspondence]
youngs-modulus = 1
poisson-ratio = 0.3
density = 1
yield-stress = 1e-4
[peridynamics]
horizon = 0.3
points.lattice = { spacing = 0.1 }
[solve.explicit]
duration = 1
outputs = 1
[conditions.bottom.displacement]
on = "bottom"
x = 0
y = 0
[conditions.top.displacement]
on = "top"
y = "0.001 * t"
[output]
stresses = ["von-mises"]
probes.middle = { at = [0.5, 0.5] }
"#;

#[test]
fn results_of_laws_with_memory_are_theirs_with_sub_steps_too() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "plate.toml", YIELDING);
    run(folder.path(), &[&["plate.toml"][..], &TWO].concat());
    let history = folder.path().join("out/plate_history.csv");
    let stress = column(&history, "middle_von_mises");
    // the elastic stress of that strain is ten times the yield stress, which the law never exceeds
    let last = *stress.last().unwrap();
    assert!((0.5e-4..=1.000001e-4).contains(&last), "{last}");
    let vtu = std::fs::read(folder.path().join("out/plate_0001.vtu")).unwrap();
    assert!(String::from_utf8_lossy(&vtu).contains("equivalent plastic strain"));
}
