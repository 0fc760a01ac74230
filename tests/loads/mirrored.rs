//! The mirror image of a scene.

use super::run;

/// A plate or block of points under loads that vary across it, and its image at the middle plane across y: the place `y` is typed as `Y`.
const PLATE: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 20 }, y = { cells = 10 } }
materials.m.lps = { youngs-modulus = 1000, poisson-ratio = 0.3 }
peridynamics.horizon = 0.25
conditions.left.displacement = { on = "left", x = 0, y = 0 }
conditions.pull.traction = { on = "right", x = "1 + 0.3*Y" }
conditions.press.pressure = { on = "right", value = "0.2*Y" }
conditions.weight.body-force.x = "0.5*x*Y"
output.vtu = false
"#;

const BLOCK: &str = r#"
kinematics = "solid"
coupling = "nonlocal"
mesh.box = { min = [0, 0, 0], max = [1.5, 1, 1], x = { cells = 6 }, y = { cells = 4 }, z = { cells = 4 } }
materials.m.bond-based.youngs-modulus = 1000
peridynamics.horizon = 0.5
conditions.left.displacement = { on = "left", x = 0, y = 0, z = 0 }
conditions.pull.traction = { on = "right", x = "1 + 0.3*Y + 0.2*z" }
output.vtu = false
"#;

/// The displacement at a place under a scene, and under its image at the image of the place, mirrored back.
fn both(scene: &str, spacing: f64, origin: &[f64], at: &[f64]) -> [Vec<f64>; 2] {
    [false, true].map(|is_image| {
        let y = if is_image { "(1 - y)" } else { "y" };
        let image = |x: &[f64]| {
            let mut x = x.to_vec();
            if is_image {
                x[1] = 1.0 - x[1];
            }
            format!("{x:?}")
        };
        let done = run(
            &scene.replace('Y', y),
            &[
                &format!(
                    "peridynamics.points.lattice={{spacing={spacing},origin={}}}",
                    image(origin)
                ),
                &format!("output.probes.p.at={}", image(at)),
            ],
        );
        let axes = &["x", "y", "z"][..at.len()];
        let u = axes.iter().map(|axis| {
            let u = done.column("scene_probes.csv", &format!("u{axis}"))[0];
            if is_image && *axis == "y" { -u } else { u }
        });
        u.collect()
    })
}

/// Places of parts of the load lie on planes of the lattice, between which cube of points is whose matters: neither side is preferred.
#[test]
fn loads_that_vary_on_points_have_the_forces_of_their_image() {
    for (origin, at) in [
        ([0.05, 0.05], [1.5, 0.33]),
        ([0.0, 0.0], [1.9, 0.81]),
        ([0.03, 0.02], [1.9, 0.81]),
        ([0.05, 0.02], [1.5, 0.33]),
    ] {
        let [u, image] = both(PLATE, 0.1, &origin, &at);
        for (a, b) in u.iter().zip(&image) {
            assert!(
                (a - b).abs() < 1e-11 * u[0].abs(),
                "{origin:?}: {u:?} {image:?}"
            );
        }
    }
    for origin in [[0.125; 3], [0.0; 3]] {
        let [u, image] = both(BLOCK, 0.25, &origin, &[1.3, 0.8, 0.3]);
        for (a, b) in u.iter().zip(&image) {
            assert!(
                (a - b).abs() < 1e-11 * u[0].abs(),
                "{origin:?}: {u:?} {image:?}"
            );
        }
    }
}
