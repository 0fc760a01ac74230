//! The out-of-balance force is measured by nodal forces, which do not cancel.

use crate::Case;

#[test]
fn loads_in_balance_are_a_measure() {
    // a hole under pressure: the loads add up to nothing, and supports at single nodes have nothing to do
    let case = Case::new(
        r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [3, 3]
x = { cells = 9 }
y = { cells = 9 }
cutouts.hole = { min = [1, 1], max = [2, 2] }
[materials.m.lps]
youngs-modulus = 2
poisson-ratio = 0.3
[coupling.local]
[conditions.corner.displacement]
inside.box = { min = [-0.1, -0.1], max = [0.1, 0.1] }
x = 0
y = 0
[conditions.edge.displacement]
inside.box = { min = [2.9, -0.1], max = [3.1, 0.1] }
y = 0
[conditions.pressure.traction]
on = "hole"
x = "if(abs(x - 1.5) > abs(y - 1.5), sign(x - 1.5), 0)"
y = "if(abs(x - 1.5) > abs(y - 1.5), 0, sign(y - 1.5))"
[output]
vtu = false
"#,
    );
    let summary = case.run(&[]).expect("it runs");
    let relative = summary["out_of_balance_relative"].as_f64().unwrap();
    assert!(relative < 1e-12, "{relative}");
}

#[test]
fn one_support_is_a_measure() {
    // the support's own force is the sum of all internal ones: over itself it would always be one
    let case = Case::new(
        r#"
kinematics = "plane-stress"
coupling = "splice"
[mesh.rectangle]
min = [0, 0]
max = [12, 6]
x = { cells = 12 }
y = { cells = 6 }
[materials.m.bond-based]
youngs-modulus = 1
[peridynamics]
horizon = 2
points.lattice = { spacing = 1 }
[zones]
nonlocal = { box = { min = [4, 0], max = [8, 6] } }
[conditions.all.displacement]
inside = { any = [{ box = { min = [-1, -1], max = [0.1, 7] } }, { box = { min = [11.9, -1], max = [13, 7] } }] }
x = "0.001 * x^2"
y = 0
[output]
vtu = false
"#,
    );
    let summary = case.run(&[]).expect("it runs");
    let relative = summary["out_of_balance_relative"].as_f64().unwrap();
    assert!(relative < 0.2, "{relative}");
}
