//! A square and its loads, rotated by 30°: isotropic weights served the upright one only.

use crate::Case;

fn energy(mesh: &str, x: &str, y: &str) -> f64 {
    let case = Case::new(&format!(
        r#"
kinematics="plane-stress"
[mesh.file]
path="{mesh}"
[materials.m.bond-based]
youngs-modulus=1.0
[peridynamics]
horizon=0.15
points="cells"
weights="isotropic"
[coupling.nonlocal]
[conditions.a.displacement]
on="bottom"
x=0
y=0
[conditions.p.traction]
on="top"
x="{x}"
y="{y}"
[output]
vtu = false
"#
    ))
    .with_file(mesh);
    let summary = case.run(&[]).expect("it runs");
    let check = case.command("check", &[]);
    let told = String::from_utf8_lossy(&check.stdout).into_owned();
    assert!(
        told.contains("the lattice carries the typed elastic constants"),
        "{told}"
    );
    summary["energy"].as_f64().expect("an energy")
}

#[test]
fn energies_of_a_square_and_of_the_same_rotated_agree() {
    let upright = energy("a0.msh", "0.0003", "0.001+0.001*x");
    let rotated = energy(
        "a30.msh",
        "-0.00024019237886466834+-0.0004999999999999999*(0.8660254037844387*x+0.49999999999999994*y)",
        "0.0010160254037844387+0.0008660254037844387*(0.8660254037844387*x+0.49999999999999994*y)",
    );
    assert!(
        (rotated / upright - 1.0).abs() < 1e-8,
        "{upright:e} {rotated:e}"
    );
}
