//! A splice over a long duration: what is not known of its modes is not denied, and energy from nowhere stops the run.

use crate::Case;

const PLATE: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [12, 6]
x = { cells = 24 }
y = { cells = 12 }
[materials.plate.lps]
youngs-modulus = 1
density = 1
poisson-ratio = 0.34
[peridynamics]
horizon = 1.5
points.lattice = { spacing = 0.5 }
[zones]
nonlocal = { box = { min = [3, 0], max = [9, 6] } }
[coupling.splice]
[solve.explicit]
duration = 4000
outputs = 1
history-interval = 1
[initial.v.velocity]
x = "1e-3*sin(x)"
y = "1e-3*cos(y)*sin(x/2)"
[output]
vtu = false
"#;

#[test]
fn growth_that_a_run_from_noise_cannot_see_is_found_or_stopped() {
    let case = Case::new(PLATE);
    let output = case.command("run", &[]);
    let said = format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(!said.contains("no mode grows"), "{said}");
    assert_eq!(output.status.code(), Some(3));
    assert!(said.contains("without work"), "{said}");
    // what holds by construction is said as proved
    let truncated = case.command("check", &["--set", "coupling=truncated"]);
    let said = String::from_utf8_lossy(&truncated.stdout);
    assert!(said.contains("no mode grows, proved"), "{said}");
}
