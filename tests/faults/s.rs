//! The balanced coupling in motion: a mode that grows is told, and the run stops where it gains energy.

use crate::Case;

const PLATE: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [12, 6]
x = { cells = 24 }
y = { cells = 12 }
[materials.plate.bond-based]
youngs-modulus = 1
density = 1
[peridynamics]
horizon = 1.5
points.lattice = { spacing = 0.5 }
[zones]
nonlocal = { box = { min = [3, 0], max = [9, 6] } }
[coupling.balanced]
[solve.explicit]
duration = 110
outputs = 1
history-interval = 1
[initial.v.velocity]
x = "1e-3*sin(x)"
y = "1e-3*cos(y)*sin(x/2)"
[output]
vtu = false
"#;

#[test]
fn a_mode_that_grows_is_told_and_stops_the_run() {
    let case = Case::new(PLATE);
    let told = case.command("run", &[]);
    assert_eq!(told.status.code(), Some(3));
    let said = String::from_utf8_lossy(&told.stdout);
    assert!(said.contains("a mode of the seam grows as exp("), "{said}");
    assert!(
        said.contains("% of its largest energy without work"),
        "{said}"
    );
}
