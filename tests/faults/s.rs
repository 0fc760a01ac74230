//! The balanced coupling in motion: refused where a mode would double the energy, stopped where it does.

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
fn a_mode_that_doubles_the_energy_is_found_before_the_first_step() {
    let case = Case::new(PLATE);
    let said = case.run(&[]).unwrap_err();
    for part in ["unstable in time", "largest at (", "coupling.truncated"] {
        assert!(said.contains(part), "{said}");
    }
    let told = case.command("run", &["--set", "solve.explicit.growing-modes=warn"]);
    assert_eq!(told.status.code(), Some(3));
    let said = String::from_utf8_lossy(&told.stdout);
    assert!(
        said.contains("a mode of the seam grows by a factor of"),
        "{said}"
    );
    assert!(
        said.contains("% of its largest energy without work"),
        "{said}"
    );
}
