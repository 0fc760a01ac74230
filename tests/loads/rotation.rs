//! Prescribed rotation.

use super::run;

const BLOCK: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
mesh.rectangle = { min = [-0.5, -0.5], max = [0.5, 0.5], x = { cells = 10 }, y = { cells = 10 } }
materials.rubber.bond-based = { youngs-modulus = 1, density = 1 }
peridynamics = { horizon = 0.301, points.lattice = { spacing = 0.1 }, bonds = "exact" }
conditions.grip.rotation = { inside = { everywhere = true }, center = [0.2, -0.1], angle = "120 * t" }
output.probes = { a = { at = [0.31, 0.27] }, b = { at = [-0.4, 0.1] } }
output.vtu = false
solve.quasi-static.steps = 3
"#;

#[test]
fn a_body_turns_by_any_angle_as_a_whole() {
    // points rotate exactly, and exact bonds have no energy
    let done = run(BLOCK, &[]);
    let energy = done.column("scene_history.csv", "stored_energy");
    assert!(energy.iter().all(|e| e.abs() < 1e-20), "{energy:?}");
    for (probe, x, y) in [("a", 0.31, 0.27), ("b", -0.4, 0.1)] {
        let u = |axis: &str| done.column("scene_history.csv", &format!("{probe}_u{axis}"));
        for (step, (ux, uy)) in u("x").iter().zip(u("y")).enumerate() {
            let (s, c) = (40.0 * step as f64).to_radians().sin_cos();
            let (rx, ry): (f64, f64) = (x - 0.2, y + 0.1);
            assert!((ux - (c * rx - s * ry - rx)).abs() < 1e-13, "{step}");
            assert!((uy - (s * rx + c * ry - ry)).abs() < 1e-13, "{step}");
        }
    }
}

#[test]
fn a_bar_is_twisted_about_any_axis() {
    // one end held, the other turned by one degree: pure torsion in a moment's direction, whatever the axis' length
    let bar = r#"
kinematics = "solid"
coupling = "local"
mesh.file.path = "MESHES/bar_hexes.msh"
materials.steel.lps = { youngs-modulus = 1, poisson-ratio = 0 }
conditions.a.rotation = { inside = { everywhere = true }, center = [0, 0.1, 0.2], axis = [3, 0, 4], angle = 90 }
output.probes = { a = { at = [0.3, 0.05, 0.04] } }
output.vtu = false
"#;
    let done = run(bar, &[]);
    let row = &done.rows("scene_probes.csv")[0];
    // R r = k (k·r) + k × r for 90 degrees
    let (k, r) = ([0.6, 0.0, 0.8], [row[0], row[1] - 0.1, row[2] - 0.2]);
    let dot = k[0] * r[0] + k[2] * r[2];
    let cross = [-k[2] * r[1], k[2] * r[0] - k[0] * r[2], k[0] * r[1]];
    for i in 0..3 {
        let u = k[i] * dot + cross[i] - r[i];
        assert!((row[3 + i] - u).abs() < 1e-14, "{i}: {} {u}", row[3 + i]);
    }
}
