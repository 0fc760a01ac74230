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

/// Supports that shift all of a body along one axis leave nothing but round-off to solve for along the other: by factors, by iteration and in load steps.
#[test]
fn a_shift_of_all_sites_is_no_load() {
    let plate = r#"
kinematics = "plane-stress"
mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 8 }, y = { cells = 4 } }
materials.m.lps = { youngs-modulus = 10, poisson-ratio = 0.2 }
conditions.d.displacement = { x = 0.5, inside.everywhere = true }
conditions.g.displacement = { on = "bottom", y = 0 }
output = { vtu = false, probes.p = { at = [1.1, 0.9] } }
"#;
    let points = "peridynamics={horizon=0.5,points={lattice={spacing=0.25,origin=[0.125,0.125]}}}";
    for (coupling, points) in [("local", "zones={}"), ("nonlocal", points)] {
        let coupling = format!("coupling={coupling}");
        for solve in [
            "solver.method=direct",
            "solver.method=krylov",
            "solve.quasi-static.steps=1",
        ] {
            let done = run(plate, &[&coupling, points, solve]);
            let (csv, end) = match solve.contains("steps") {
                true => ("scene_history.csv", "p_"),
                false => ("scene_probes.csv", ""),
            };
            let u = ["ux", "uy"].map(|name| {
                let column = done.column(csv, &format!("{end}{name}"));
                *column.last().unwrap()
            });
            let off = (u[0] - 0.5).abs().max(u[1].abs());
            assert!(off < 1e-14, "{coupling} {solve}: {u:?}");
            assert!(
                done.summary
                    .warnings
                    .iter()
                    .all(|w| !w.message.contains("balance by"))
            );
        }
    }
}
