//! Stresses at probes with each row of a history.

use super::{Done, run};

/// A plate between rollers that load steps pull, with a probe in elements and one at points.
const PLATE: &str = r#"
kinematics = "plane-strain"
coupling = "truncated"
mesh.rectangle = { min = [0, 0], max = [4, 1], x = { cells = 24 }, y = { cells = 6 } }
materials.m.lps = { youngs-modulus = 100, poisson-ratio = 0.3, density = 1 }
peridynamics = { horizon = 0.4, points = { lattice = { spacing = 0.13 } } }
zones.nonlocal.box = { min = [1.4, 0], max = [2.6, 1] }
conditions.left.displacement = { on = "left", x = 0 }
conditions.base.displacement = { on = "bottom", y = 0 }
conditions.right.traction = { on = "right", x = "2 * t" }
solve.quasi-static.steps = 2
[output]
vtu = false
stresses = ["von-mises", "max-principal"]
probes.element.at = [0.4, 0.55]
probes.point.at = [2, 0.5]
lines.through = { from = [0.4, 0.55], to = [3.6, 0.55], samples = 9 }
"#;

const COLUMNS: [&str; 5] = ["sxx", "sxy", "syy", "von_mises", "max_principal"];

fn probed(done: &Done, probe: &str) -> Vec<Vec<f64>> {
    let columns = COLUMNS.map(|c| done.column("scene_history.csv", &format!("{probe}_{c}")));
    let rows = columns[0].len();
    (0..rows)
        .map(|r| columns.iter().map(|c| c[r]).collect())
        .collect()
}

#[test]
fn a_plate_that_is_pulled_tells_its_stress_step_by_step() {
    let done = run(PLATE, &[]);
    // the same at rest, under the load of the last step
    let at_rest = PLATE
        .replace("solve.quasi-static.steps = 2\n", "")
        .replace("\"2 * t\"", "2");
    let at_rest = run(&at_rest, &[]);
    for (k, probe) in ["element", "point"].into_iter().enumerate() {
        let rows = probed(&done, probe);
        assert_eq!(rows.len(), 3);
        assert!(rows[0].iter().all(|s| *s == 0.0), "{:?}", rows[0]);
        for (column, last) in COLUMNS.iter().zip(&rows[2]) {
            let still = at_rest.column("scene_probes.csv", column)[k];
            assert!(
                (last - still).abs() < 1e-6,
                "{probe} {column}: {last} {still}"
            );
        }
        for (half, whole) in rows[1].iter().zip(&rows[2]) {
            assert!((2.0 * half - whole).abs() < 1e-6, "{rows:?}");
        }
    }
    // along the line each state that is shown, the last of them that at rest
    let time = done.column("scene_through.csv", "time");
    assert_eq!(time, [[0.0; 9], [0.5; 9], [1.0; 9]].concat());
    for column in ["x", "ux", "uy", "exx", "sxx", "von_mises", "model"] {
        let along = done.column("scene_through.csv", column);
        let still = at_rest.column("scene_through.csv", column);
        for (last, still) in along[18..].iter().zip(&still) {
            assert!((last - still).abs() < 1e-6, "{column}: {last} {still}");
        }
    }
    // uniaxial in the plane, ν σ across it
    let element = &probed(&done, "element")[2];
    let mises = 2.0 * (1.0f64 - 0.3 + 0.09).sqrt();
    for (found, exact) in element.iter().zip([2.0, 0.0, 0.0, mises, 2.0]) {
        assert!((found - exact).abs() < 0.02, "{element:?}");
    }
}

/// In time: behind its front a wave has the stress of its load.
#[test]
fn a_wave_has_its_stress_at_a_probe() {
    let bar = r#"
kinematics = "bar"
coupling = "local"
mesh.line = { min = 0, max = 2, x = { cells = 200 } }
materials.m.lps = { youngs-modulus = 4, poisson-ratio = 0, density = 1 }
conditions.left.displacement = { on = "left", x = 0 }
conditions.right.traction = { on = "right", x = "0.01 * min(1, t / 0.1)" }
solve.explicit = { duration = 0.8, outputs = 0, history-interval = 0.01 }
[output]
vtu = false
stresses = ["von-mises"]
probes.middle.at = 1.002
"#;
    let done = run(bar, &[]);
    let (time, stress) = (
        done.column("scene_history.csv", "time"),
        done.column("scene_history.csv", "middle_sxx"),
    );
    for (t, s) in time.iter().zip(&stress) {
        match t {
            t if *t < 0.45 => assert!(s.abs() < 1e-5, "{t}: {s}"),
            t if *t > 0.7 => assert!((s - 0.01).abs() < 5e-4, "{t}: {s}"),
            _ => {}
        }
    }
    let mises = done.column("scene_history.csv", "middle_von_mises");
    assert!(
        mises
            .iter()
            .zip(stress)
            .all(|(m, s)| (m - s.abs()).abs() < 1e-15)
    );
}

/// A plate of points that is pulled, with a hole or without.
const HOLE: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
mesh.rectangle = { min = [-25, -25], max = [25, 25], x = { cells = 50 }, y = { cells = 50 } }
materials.m.correspondence = { youngs-modulus = 100, poisson-ratio = 0.3 }
peridynamics = { horizon = 3, points = { lattice = { spacing = 1, origin = [-24.5, -24.5] } } }
voids.hole.inside.ball = { center = [0, 0], radius = 10 }
conditions.left.displacement = { inside.box = { min = [-26, -26], max = [-22, 26] }, x = "0.01*x", y = "-0.003*y" }
conditions.right.displacement = { inside.box = { min = [22, -26], max = [26, 26] }, x = "0.01*x", y = "-0.003*y" }
[output]
vtu = false
"#;

/// The warning of a peak that falls off within a family, if there is one.
fn told_of_a_peak(text: &str, overrides: &[&str]) -> Option<String> {
    let texts = run(text, overrides).summary.warnings.into_iter();
    let mut texts = texts.map(|warning| warning.message);
    texts.find(|w| w.contains("falls off within a family"))
}

#[test]
fn a_peak_of_stress_that_families_do_not_resolve_is_told() {
    let found = told_of_a_peak(HOLE, &[]).unwrap();
    // at the edge of the hole, across the pull
    assert!(found.contains("(0.5") && found.contains("10.5"), "{found}");
    // the first of several load steps that strains the body tells as much, of a law that may flow later on
    let steps = HOLE
        .replace(
            "m.correspondence = {",
            "m.plastic-correspondence = { yield-stress = 5, hardening-modulus = 10,",
        )
        .replace("0.01*x", "0.01*x*t")
        .replace("-0.003*y", "-0.003*y*t");
    let steps = steps + "[solve.quasi-static]\nduration = 1\nsteps = 1\n";
    let flows = told_of_a_peak(&steps, &[]).unwrap();
    assert!(
        flows.contains("0.5") && flows.contains("10.5") && flows.contains("within two horizons"),
        "{flows}"
    );
}

#[test]
fn no_peak_is_told_where_a_finer_lattice_would_show_none() {
    let uniform = HOLE.replace(
        "voids.hole.inside.ball = { center = [0, 0], radius = 10 }\n",
        "",
    );
    assert_eq!(told_of_a_peak(&uniform, &[]), None);
    // edges of an LPS strain by another part, which another warning tells: no peak
    let bar = include_str!("../../examples/coupled_bar_3d.toml");
    let coarse = [
        "peridynamics.horizon=0.004",
        "mesh.box.x.cells=20",
        "mesh.box.y.cells=6",
        "mesh.box.z.cells=6",
    ];
    assert_eq!(told_of_a_peak(bar, &coarse), None);
    // the tip of a crack has no peak that a finer lattice would show
    let crack = HOLE.replace(
        "voids.hole.inside.ball = { center = [0, 0], radius = 10 }",
        "cracks.slit.segment = { from = [0, -8], to = [0, 8] }",
    );
    assert_eq!(told_of_a_peak(&crack, &[]), None);
}

/// A beam of one cell of second order over its height, bent: its stress at the surface, not the mean of the cell.
#[test]
fn a_bent_beam_has_its_stress_at_the_surface() {
    let beam = r#"
kinematics = "KINEMATICS"
coupling = "local"
mesh.rectangle = { min = [0, -1], max = [10, 1], x = { cells = 5 }, y = { cells = 1 }, cell = "CELL" }
materials.m.lps = { youngs-modulus = 100, poisson-ratio = 0.3 }
conditions.left.displacement = { on = "left", x = 0 }
conditions.corner.displacement = { inside.ball = { center = [0, -1], radius = 0.1 }, y = 0 }
conditions.right.traction = { on = "right", x = "3 * y" }
[output]
vtu = false
stresses = ["von-mises"]
probes.top.at = [4.7, 1]
probes.inside.at = [4.7, 0.3]
probes.low.at = [6, -1]
lines.up = { from = [4.7, -1], to = [4.7, 1], samples = 5 }
"#;
    for cell in ["quad8", "tri6"] {
        let beam = beam.replace("CELL", cell);
        let still = beam.replace("KINEMATICS", "plane-stress");
        let bent = run(&still, &[]);
        let stress = bent.column("scene_probes.csv", "sxx");
        for (found, exact) in stress.iter().zip([0.9, -3.0, 3.0]) {
            assert!((found - exact).abs() < 1e-9, "{cell}: {stress:?}");
        }
        let along = bent.column("scene_up.csv", "sxx");
        let strains = bent.column("scene_up.csv", "exx");
        for ((s, e), exact) in along.iter().zip(&strains).zip([-3.0, -1.5, 0.0, 1.5, 3.0]) {
            assert!((s - exact).abs() < 1e-9, "{cell}: {along:?}");
            assert!((e - exact / 100.0).abs() < 1e-11, "{cell}: {strains:?}");
        }
        // warmer above, a free beam bends without a stress, but for that across the plane
        let warm = beam.replace("KINEMATICS", "plane-strain");
        let warm = warm.replace("ratio = 0.3", "ratio = 0.3, thermal-expansion = 1e-3");
        let warm = warm.replace(
            "conditions.right.traction = { on = \"right\", x = \"3 * y\" }",
            "temperature.value = \"20 * y\"",
        );
        let warm = run(&warm, &[]);
        let in_plane = warm.column("scene_probes.csv", "sxx");
        assert!(
            in_plane.iter().all(|s| s.abs() < 1e-9),
            "{cell}: {in_plane:?}"
        );
        let across = warm.column("scene_probes.csv", "von_mises");
        for (found, exact) in across.iter().zip([0.6, 2.0, 2.0]) {
            assert!((found - exact).abs() < 1e-9, "{cell}: {across:?}");
        }
    }
}
