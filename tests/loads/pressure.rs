//! Pressure and planes of symmetry.

use super::run;

/// A quarter of a thick ring under internal pressure, its mesh from Gmsh.
const RING: &str = r#"
kinematics = "plane-strain"
coupling = "local"
mesh.file.path = "MESHES/quarter_ring.msh"
materials.steel.lps = { youngs-modulus = 200, poisson-ratio = 0.25 }
conditions.bottom.symmetry.on = "bottom"
conditions.left.symmetry.on = "left"
conditions.bore.pressure = { on = "bore", value = 0.5 }
output.lines.radius = { from = [1.05, 0.02], to = [1.95, 0.02], samples = 19 }
output.vtu = false
"#;

/// The radial displacement of Lamé's cylinder of radii 1 and 2 in plane strain under an internal pressure p.
fn lame(p: f64, r: f64) -> f64 {
    let (e, nu) = (200.0, 0.25);
    let c = p / (4.0 - 1.0);
    (1.0 + nu) / e * c * ((1.0 - 2.0 * nu) * r + 4.0 / r)
}

/// The largest relative error of the radial displacement along the line.
fn error(done: &super::Done, p: f64) -> f64 {
    let of_row = |row: &Vec<f64>| {
        let r = row[0].hypot(row[1]);
        let u = (row[2] * row[0] + row[3] * row[1]) / r;
        (u / lame(p, r) - 1.0).abs()
    };
    done.rows("scene_radius.csv")
        .iter()
        .map(of_row)
        .fold(0.0, f64::max)
}

#[test]
fn a_thick_cylinder_is_that_of_lame() {
    let done = run(RING, &[]);
    let found = error(&done, 0.5);
    // linear triangles of 0.09, sampled between their nodes: measured 4.4e-3
    assert!(found < 5e-3, "{found}");
    // the polygon from (1, 0) to (0, 1): ∫ n ds is exact, and symmetry planes take it
    let force = done.applied("bore");
    assert!(
        (force[0] - 0.5).abs() < 1e-12 && (force[1] - 0.5).abs() < 1e-12,
        "{force:?}"
    );
    let (x, y) = (done.reaction("left"), done.reaction("bottom"));
    assert!((x[0] + 0.5).abs() < 1e-10 && x[1].abs() < 1e-10, "{x:?}");
    assert!((y[1] + 0.5).abs() < 1e-10 && y[0].abs() < 1e-10, "{y:?}");
}

#[test]
fn points_along_a_bore_take_the_same_pressure() {
    for coupling in ["splice", "truncated", "nonlocal"] {
        let zones = match coupling {
            "nonlocal" => "zones={}",
            _ => "zones.nonlocal.ball={center=[0,0],radius=1.45}",
        };
        let set = [
            &format!("coupling={coupling}") as &str,
            "peridynamics={horizon=0.12,points={lattice={spacing=0.04}}}",
            zones,
        ];
        let done = run(RING, &set);
        let force = done.applied("bore");
        let off = (force[0] - 0.5).abs().max((force[1] - 0.5).abs());
        assert!(off < 1e-12, "{coupling}: {force:?}");
        let found = error(&done, 0.5);
        println!("{coupling}: {found:.4}");
        assert!(found < 0.06, "{coupling}: {found}");
    }
}

/// Pressure on all of a hole that fits no lattice of points: nothing is left over.
#[test]
fn pressure_on_a_closed_surface_adds_up_to_zero() {
    let plate = r#"
kinematics = "plane-stress"
mesh.rectangle = { min = [0, 0], max = [1, 1], x = { cells = 20 }, y = { cells = 20 }, cell = "tri3", cutouts.hole = { min = [0.4, 0.4], max = [0.6, 0.55] } }
materials.steel.lps = { youngs-modulus = 200, poisson-ratio = 0.25 }
conditions.left.displacement = { on = "left", x = 0, y = 0 }
conditions.hole.pressure = { on = "hole", value = 3 }
output.vtu = false
"#;
    let block = r#"
kinematics = "solid"
mesh.box = { min = [0, 0, 0], max = [1, 1, 1], x = { cells = 5 }, y = { cells = 5 }, z = { cells = 5 }, cell = "tet4", cutouts.hole = { min = [0.4, 0.4, 0.4], max = [0.6, 0.6, 0.6] } }
materials.steel.lps = { youngs-modulus = 200, poisson-ratio = 0.25 }
conditions.left.displacement = { on = "left", x = 0, y = 0, z = 0 }
conditions.hole.pressure = { on = "hole", value = 3 }
output.vtu = false
"#;
    let plate_points = "peridynamics={horizon=0.11,points={lattice={spacing=0.037}}}";
    let block_points = "peridynamics={horizon=0.27,points={lattice={spacing=0.09}}}";
    for (text, points) in [(plate, plate_points), (block, block_points)] {
        for coupling in ["coupling=local", "coupling=nonlocal"] {
            let set = match coupling {
                "coupling=local" => vec![coupling],
                _ => vec![coupling, points],
            };
            let done = run(text, &set);
            let force = done.applied("hole");
            assert!(
                force.iter().all(|f| f.abs() < 1e-12),
                "{coupling} {force:?}"
            );
            let support = done.reaction("left");
            assert!(
                support.iter().all(|f| f.abs() < 1e-8),
                "{coupling} {support:?}"
            );
        }
    }
}

#[test]
fn pressure_that_grows_in_load_steps_and_in_time() {
    let steps = [
        "conditions.bore.pressure.value=0.5*t",
        "solve.quasi-static.steps=2",
    ];
    let done = run(RING, &steps);
    let x = done.column("scene_history.csv", "left_reaction_x");
    assert!(
        (x[1] + 0.25).abs() < 1e-7 && (x[2] + 0.5).abs() < 1e-7,
        "{x:?}"
    );
    // in time: the work of the pressure is the energy of the body
    let time = [
        "conditions.bore.pressure.value=0.5*min(1,t/0.2)*(1+0*x)",
        "materials.steel.lps.density=1",
        "solve.explicit.duration=0.4",
    ];
    let done = run(RING, &time);
    let motion = done.summary.motion.as_ref().unwrap();
    assert!(motion.external_work > 0.0);
    let missing = motion.missing_energy.abs() / motion.external_work;
    assert!(missing < 1e-3, "{missing}");
    assert!((done.applied("bore")[0] - 0.5).abs() < 1e-12);
}

#[test]
fn surfaces_without_an_outside_and_slanted_planes_are_refused() {
    let refused = |set: &[&str], words: &[&str]| super::refused(RING, set, words);
    refused(
        &["conditions.bore.pressure.on=bores"],
        &["`conditions.bore.pressure.on`", "bores"],
    );
    refused(
        &["conditions.bore.pressure.value=t"],
        &["depends on the time"],
    );
    refused(
        &["conditions.left.symmetry.on=bore"],
        &["is no plane x, y or z = constant"],
    );
}
