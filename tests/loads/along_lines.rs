//! Stress along lines through elements of first order, the rim of a patch, and points.

use super::{Done, run};

/// A plate in pure bending, whose stress is `y`.
const BENT: &str = r#"
kinematics = "plane-stress"
mesh.rectangle = { min = [0, -1], max = [4, 1], x = { cells = 32 }, y = { cells = 16 } }
materials.m.bond-based = { youngs-modulus = 100 }
[conditions]
left.displacement = { on = "left", x = 0 }
pin.displacement = { inside.box = { min = [-0.01, -0.01], max = [0.01, 0.01] }, y = 0 }
right.traction = { on = "right", x = "y" }
[output]
vtu = false
stresses = ["von-mises"]
lines.up = { from = [2, -1], to = [2, 1], samples = 33 }
"#;

/// The largest difference of σ_xx from the height.
fn off(done: &Done) -> f64 {
    let [y, stress] = ["y", "sxx"].map(|name| done.column("scene_up.csv", name));
    let each = y.iter().zip(&stress);
    each.map(|(y, s)| (s - y).abs()).fold(0.0, f64::max)
}

#[test]
fn a_linear_stress_is_told_as_one_up_to_the_surface() {
    // cells of 1/8 told their mean: 1/16 off at the surface and between cells
    let elements = off(&run(BENT, &["coupling=\"local\""]));
    assert!(elements < 0.008, "{elements}");
    let zone = [
        "peridynamics={ horizon = 0.36, points.lattice = { spacing = 0.12, origin = [0.05, 0.01] } }",
        "zones.nonlocal.box={ min = [1.3, -2], max = [2.7, 2] }",
    ];
    // elements of a rim along the surface, points inside
    let coupled = off(&run(BENT, &zone));
    // at the surface lies a sliver of elements that the rim has cut, of no strain of its own
    assert!(coupled < 0.03, "{coupled}");
}

/// A plate of points that a crack parts, its lower half at rest.
const PARTED: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
mesh.rectangle = { min = [0, 0], max = [2, 2], x = { cells = 20 }, y = { cells = 20 } }
materials.m.bond-based = { youngs-modulus = 100 }
peridynamics = { horizon = 0.3, points.lattice = { spacing = 0.1 } }
cracks.middle.segment = { from = [-0.1, 1], to = [2.1, 1] }
[conditions]
low.displacement = { inside.box = { min = [-1, -1], max = [3, 0.99] }, x = 0, y = 0 }
high.displacement = { inside.box = { min = [-1, 1.01], max = [3, 3] }, x = "0.01*x", y = 0 }
[output]
vtu = false
lines.up = { from = [1.03, 0.96], to = [1.03, 1.04], samples = 2 }
"#;

#[test]
fn nothing_is_told_across_a_crack() {
    let done = run(PARTED, &[]);
    let strain = done.column("scene_up.csv", "exx");
    // the slope across would be a tenth of the jump
    assert!(strain[0].abs() < 1e-12 && strain[1] > 0.0098, "{strain:?}");
}
