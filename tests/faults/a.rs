//! Points at the centroids of graded triangles beside finite elements: stresses were eight times too large without a word.

use crate::{Case, flat, percent};

const PLATE: &str = r#"
kinematics = "plane-stress"
[mesh.file]
path = "grad.msh"
[materials.m.lps]
youngs-modulus = 210e3
poisson-ratio = 0.3
[peridynamics]
horizon = 3
points = "cells"
[zones.nonlocal]
box = { min = [6, 6], max = [14, 14] }
[coupling.splice]
[output]
vtu = false
"#;

const PULLED: &str = r#"
[conditions.l.displacement]
on = "left"
x = 0
[conditions.b.displacement]
on = "bottom"
y = 0
[conditions.r.traction]
on = "right"
x = 100
"#;

const AFFINE: &str = r#"
[conditions.l.displacement]
inside = { without = { from = { everywhere = true }, removed = { box = { min = [0.01,0.01], max=[19.99,19.99] } } } }
x = "1e-3*x + 2e-4*y"
y = "-3e-4*y + 1e-4*x"
"#;

#[test]
fn points_at_centroids_of_graded_triangles_are_refused_with_the_error() {
    for conditions in [PULLED, AFFINE] {
        let case = Case::new(&format!("{PLATE}{conditions}")).with_file("grad.msh");
        let refusal = flat(&case.run(&[]).expect_err("it is refused"));
        assert!(
            refusal.contains("at the seam") && refusal.contains("lattice"),
            "{refusal}"
        );
        // solved all the same, the pulled plate shows −843 and 817 for 100
        let error = percent(&refusal).abs() / 100.0;
        assert!((9.4 / 3.0..9.4 * 3.0).contains(&error), "{refusal}");
        let check = case.command("check", &[]);
        assert!(!check.status.success());
        assert!(flat(&String::from_utf8_lossy(&check.stderr)).contains("at the seam"));
    }
}

#[test]
fn the_same_plate_with_a_lattice_carries_the_affine_field() {
    let case = Case::new(&format!("{PLATE}{AFFINE}")).with_file("grad.msh");
    let lattice = ["--set", "peridynamics.points={lattice={spacing=1}}"];
    let summary = case.run(&lattice).expect("it runs");
    let warnings = summary["warnings"].to_string();
    assert!(!warnings.contains("uniform stress"), "{warnings}");
    // the reaction of a whole boundary under a uniform stress
    for k in 0..2 {
        let force = summary["reactions"][0]["force"][k]
            .as_f64()
            .expect("a number");
        assert!(force.abs() < 1e-8, "{force}");
    }
}
