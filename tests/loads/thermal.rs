//! Thermal strain: free where it may expand, `−E α ΔT` where it may not.

use super::{Done, run};

/// A square with irregular triangles, peridynamics in the middle, held at a node so that it may expand as it likes.
const PLATE: &str = r#"
kinematics = "KINEMATICS"
mesh.file.path = "MESHES/quarter_ring.msh"
materials.steel.MATERIAL
zones.nonlocal.box = { min = [1.05, 0.25], max = [1.6, 0.75] }
peridynamics = { horizon = 0.121, points.lattice = { spacing = 0.04, origin = [0.013, 0.007] } }
temperature = { value = "VALUE", reference = 20 }
conditions.outer.displacement = { on = "outer", x = "UX", y = "UY" }
output.lines.through = { from = [1.02, 0.3], to = [1.9, 0.5], samples = 23 }
output.stresses = ["von-mises", "max-principal", "min-principal"]
output.vtu = false
"#;

/// The scene and its stress-free displacements for the temperature 20 + a + b x + c y.
fn scene(kinematics: &str, material: &str, alpha: f64, [a, b, c]: [f64; 3]) -> String {
    let u = format!("{alpha}*(({a}+{b}*x+{c}*y)*x - 0.5*{b}*(x^2+y^2))");
    let v = format!("{alpha}*(({a}+{b}*x+{c}*y)*y - 0.5*{c}*(x^2+y^2))");
    PLATE
        .replace("KINEMATICS", kinematics)
        .replace("MATERIAL", material)
        .replace("VALUE", &format!("20+{a}+{b}*x+{c}*y"))
        .replace("UX", &u)
        .replace("UY", &v)
}

/// Largest error of the displacement over the largest displacement, and largest stress.
fn errors(done: &Done, alpha: f64, [a, b, c]: [f64; 3]) -> (f64, f64) {
    let (header, rows) = done.table("scene_through.csv");
    let at = |name: &str| header.iter().position(|h| h == name).unwrap();
    let (sxx, sxy, syy) = (at("sxx"), at("sxy"), at("syy"));
    let (mut off, mut most, mut stress) = (0.0f64, 0.0f64, 0.0f64);
    for row in &rows {
        let (x, y) = (row[0], row[1]);
        let (t, r2) = (a + b * x + c * y, x * x + y * y);
        let u = [t * x - 0.5 * b * r2, t * y - 0.5 * c * r2].map(|u| alpha * u);
        off = off.max((row[2] - u[0]).abs()).max((row[3] - u[1]).abs());
        most = most.max(u[0].abs()).max(u[1].abs());
        for k in [sxx, sxy, syy] {
            stress = stress.max(row[k].abs());
        }
    }
    (off / most, stress)
}

const LPS: &str = "lps = { youngs-modulus = 200, poisson-ratio = 0.3, thermal-expansion = 1e-5 }";
const PAIRS: &str = "bond-based = { youngs-modulus = 200, thermal-expansion = 1e-5 }";

#[test]
fn a_body_expands_without_stress_through_every_seam() {
    for (material, couplings) in [
        (LPS, &["local", "nonlocal", "splice", "truncated"][..]),
        (PAIRS, &["local", "nonlocal", "splice", "truncated"][..]),
    ] {
        for coupling in couplings {
            let name = format!("coupling={coupling}");
            let everywhere = ["coupling=nonlocal", "zones={}"];
            let set: &[&str] = match *coupling {
                "nonlocal" => &everywhere,
                "local" => &["coupling=local", "zones={}"],
                _ => &[&name],
            };
            // of a uniform temperature displacements are linear: round-off at all samples
            let field = [100.0, 0.0, 0.0];
            let done = run(&scene("plane-stress", material, 1e-5, field), set);
            let (off, stress) = errors(&done, 1e-5, field);
            assert!(off < 1e-9, "{coupling} {material}: {off}");
            // over E α ΔT = 0.2
            assert!(stress < 1e-10, "{coupling} {material}: {stress}");
        }
    }
}

#[test]
fn a_linear_temperature_leaves_no_stress_either() {
    for material in [LPS, PAIRS] {
        for coupling in ["local", "splice", "truncated"] {
            let name = format!("coupling={coupling}");
            let set: &[&str] = match coupling {
                "local" => &["coupling=local", "zones={}"],
                _ => &[&name],
            };
            let field = [30.0, 50.0, -20.0];
            let done = run(&scene("plane-stress", material, 1e-5, field), set);
            let (off, stress) = errors(&done, 1e-5, field);
            // exact at sites; between them samples interpolate linearly what is quadratic: α g h²/8 over u
            assert!(off < 2e-3, "{coupling} {material}: {off}");
            println!("{coupling} {stress:.2e}");
            // E α ΔT is 0.2
            assert!(stress < 1e-9, "{coupling} {material}: {stress}");
        }
    }
}

/// A plate that is cold at its lower side, with a zone there whose lattice no cell of the mesh follows; symmetric at its left and its top.
const QUENCHED: &str = r#"
kinematics = "plane-stress"
mesh.rectangle = { min = [0, 0], max = [8, 3], x = { cells = 43 }, y = { cells = 17 } }
materials.glass.MATERIAL
temperature = { value = "300 - 280 * exp(-2 * y)", reference = 300 }
zones.nonlocal.box = { min = [3, -1], max = [9, 2] }
peridynamics.horizon = 0.4
conditions.left.symmetry.on = "left"
conditions.top.symmetry.on = "top"
output.probes.p = { at = [6, 0.5] }
output.vtu = false
"#;

/// A body that nothing loads exerts no force on what holds it, at a temperature that no element follows.
#[test]
fn expansion_is_in_balance_at_any_temperature() {
    for material in [LPS, PAIRS] {
        let text = QUENCHED.replace("MATERIAL", material);
        let exact = run(
            &text,
            &[
                "coupling=local",
                "mesh.rectangle.x.cells=160",
                "mesh.rectangle.y.cells=60",
            ],
        );
        let exact = exact.column("scene_probes.csv", "ux")[0];
        for set in [
            &["coupling=truncated", "zones.skin=free-surfaces"][..],
            &["coupling=truncated", "zones.skin=none"],
            &["coupling=nonlocal"],
        ] {
            let done = run(&text, set);
            // 0.07 where rows expanded about their own sites
            let off = done.summary.out_of_balance_force.iter();
            let off = off.fold(0.0f64, |most, f| most.max(f.abs()));
            // E α ΔT over a side of the zone
            assert!(
                off < 1e-9 * 200.0 * 1e-5 * 280.0,
                "{set:?} {material}: {off}"
            );
            let u = done.column("scene_probes.csv", "ux")[0];
            println!("{set:?} {material}: {}", u / exact);
            // without a skin the surfaces of points are others than those of the body
            if set.contains(&"zones.skin=free-surfaces") {
                assert!((u / exact - 1.0).abs() < 0.02, "{set:?}: {u} {exact}");
            }
            // load steps have other zones
            if set != ["coupling=nonlocal"] {
                continue;
            }
            let steps = [
                "temperature.value=300 - 280 * exp(-2 * y) * t",
                "solve.quasi-static.steps=1",
            ];
            let slowly = run(&text, &[set, &steps].concat());
            let last = slowly.column("scene_history.csv", "p_ux");
            assert!((last[last.len() - 1] / u - 1.0).abs() < 1e-6, "{set:?}");
        }
    }
}

/// A bar between two walls takes `−E α ΔT`, with finite elements, with points and with both.
#[test]
fn a_constrained_bar_is_pressed() {
    let bar = r#"
kinematics = "bar"
mesh.line = { min = 0, max = 1, x = { cells = 50 } }
materials.steel.bond-based = { youngs-modulus = 200, thermal-expansion = 1.2e-5, density = 1, cells = { everywhere = true } }
peridynamics = { horizon = 0.06, points.lattice = { spacing = 0.02 } }
zones.nonlocal.box = { min = 0.3, max = 0.6 }
temperature = { value = "120", reference = 20 }
conditions.left.displacement = { on = "left", x = 0 }
conditions.right.displacement = { on = "right", x = 0 }
output.probes.a = { at = 0.21 }
output.probes.b = { at = 0.45 }
output.stresses = ["von-mises"]
output.vtu = false
"#;
    let expected = -200.0 * 1.2e-5 * 100.0;
    for coupling in [
        "coupling=local",
        "coupling=splice",
        "coupling=truncated",
        "coupling=blending",
    ] {
        let set: &[&str] = match coupling {
            "coupling=local" => &[coupling, "zones={}"],
            "coupling=blending" => &[coupling, "zones.transition.around=0.1"],
            _ => &[coupling],
        };
        let done = run(bar, set);
        for stress in done.column("scene_probes.csv", "sxx") {
            assert!(
                (stress / expected - 1.0).abs() < 1e-9,
                "{coupling}: {stress}"
            );
        }
        let mises = done.column("scene_probes.csv", "von_mises");
        assert!((mises[0] / -expected - 1.0).abs() < 1e-9, "{mises:?}");
        assert!(
            (done.reaction("left")[0] / -expected - 1.0).abs() < 1e-9,
            "{coupling}"
        );
        assert!(
            (done.reaction("right")[0] / expected - 1.0).abs() < 1e-9,
            "{coupling}"
        );
    }
    // in load steps, and slowly in time
    let heats = "temperature.value=20+100*min(t,1)";
    let done = run(
        bar,
        &["coupling=splice", heats, "solve.quasi-static.steps=2"],
    );
    let reaction = done.column("scene_history.csv", "left_reaction_x");
    assert!(reaction[0].abs() < 1e-12, "{reaction:?}");
    assert!(
        (reaction[1] / (-0.5 * expected) - 1.0).abs() < 1e-7,
        "{reaction:?}"
    );
    assert!((reaction[2] / -expected - 1.0).abs() < 1e-7, "{reaction:?}");
    let done = run(
        bar,
        &["coupling=truncated", heats, "solve.explicit.duration=2"],
    );
    let reaction = done.column("scene_history.csv", "right_reaction_x");
    assert!(
        (reaction.last().unwrap() / expected - 1.0).abs() < 1e-6,
        "{reaction:?}"
    );
}

/// Two layers of different expansion, free at all sides, bend as Timoshenko's bimetal strip.
#[test]
fn a_bimetal_strip_bends() {
    let strip = r#"
kinematics = "plane-stress"
coupling = "local"
mesh.rectangle = { min = [0, -0.1], max = [4, 0.1], x = { cells = 200 }, y = { cells = 20 } }
materials.top.lps = { youngs-modulus = 200, poisson-ratio = 0, thermal-expansion = 2e-5, cells.box = { min = [0, 0], max = [4, 0.1] } }
materials.under.lps = { youngs-modulus = 200, poisson-ratio = 0, thermal-expansion = 1e-5 }
temperature.value = "10"
conditions.left.symmetry.on = "left"
conditions.corner.displacement = { inside.box = { min = [0, -0.001], max = [0.001, 0.001] }, y = 0 }
output.probes.tip = { at = [4, 0] }
output.vtu = false
"#;
    let done = run(strip, &[]);
    // equal layers of equal modulus: curvature 3/2 Δα ΔT / h of the whole height
    let curvature = 1.5 * 1e-5 * 10.0 / 0.2;
    let uy = done.column("scene_probes.csv", "uy")[0];
    let expected = -0.5 * curvature * 16.0;
    // 20 bilinear cells through the height
    assert!((uy / expected - 1.0).abs() < 0.02, "{uy} {expected}");
}

#[test]
fn plane_strain_is_held_along_its_normal() {
    let text = scene("plane-strain", LPS, 1.3e-5, [100.0, 0.0, 0.0]);
    let done = run(&text, &["coupling=local", "zones={}"]);
    let (off, stress) = errors(&done, 1.3e-5, [100.0, 0.0, 0.0]);
    assert!(off < 1e-9 && stress < 1e-9, "{off} {stress}");
    // −E α ΔT along the normal alone
    for mises in done.column("scene_through.csv", "von_mises") {
        assert!((mises - 0.2).abs() < 1e-9, "{mises}");
    }
    for least in done.column("scene_through.csv", "min_principal") {
        assert!((least + 0.2).abs() < 1e-9, "{least}");
    }
}

#[test]
fn what_has_no_thermal_strain_is_refused() {
    let text = scene("plane-stress", LPS, 1e-5, [1.0, 0.0, 0.0]);
    let refused = |set: &[&str], words: &str| super::refused(&text, set, &[words]);
    refused(
        &[
            "peridynamics.elements=cauchy-born",
            "peridynamics.bonds=exact",
            "coupling=splice",
        ],
        "cauchy-born",
    );
    refused(
        &[
            "coupling={truncated={cut-bonds=\"breaking\"}}",
            "materials.steel.lps.critical-stretch=0.1",
            "solve.quasi-static.steps=1",
        ],
        "cut-bonds",
    );
    refused(
        &["materials.steel={lps={youngs-modulus=1,poisson-ratio=0}}"],
        "has no thermal-expansion",
    );
    refused(&["temperature.value=t"], "depends on the time");
    refused(
        &[
            "materials.steel={pave={youngs-modulus=1,poisson-ratio=0.3,thermal-expansion=1,relaxing-share=0.5,relaxation-time=1}}",
            "kinematics=plane-strain",
            "solve.quasi-static.steps=1",
        ],
        "what is held across the plane relaxes",
    );
}

/// Two points' materials of different ν expand by (1 + ν) α each where plane strain holds their normal: an interface between them errs by its horizon, to first order.
#[test]
fn points_of_two_materials_expand_each_by_its_own() {
    let strip = r#"
kinematics = "plane-strain"
coupling = "splice"
temperature = { value = "40" }
mesh.rectangle = { min = [0, 0], max = [4, 1], x = { cells = 32 }, y = { cells = 8 } }
materials.a.lps = { youngs-modulus = 200, poisson-ratio = 0.2, thermal-expansion = 1e-3, cells.box = { min = [-1, -1], max = [2, 2] } }
materials.b.lps = { youngs-modulus = 200, poisson-ratio = 0.4, thermal-expansion = 1e-3 }
peridynamics = { horizon = 0.25, points.lattice = { spacing = 0.125, origin = [0.0625, 0.0625] } }
zones.nonlocal.box = { min = [1, 0.25], max = [3, 0.75] }
conditions.l.symmetry.on = "left"
conditions.b.symmetry.on = "bottom"
conditions.t.symmetry.on = "top"
output.probes.e = { at = [4, 0.5] }
output.vtu = false
"#;
    // per half (1 + ν)/(1 − ν) α ΔT over a length of 2
    let expected = 2.0 * 0.04 * (1.2 / 0.8 + 1.4 / 0.6);
    for slowly in [
        &[][..],
        &["temperature.value=40*t", "solve.quasi-static.steps=1"],
    ] {
        let done = run(strip, slowly);
        let u = match slowly.is_empty() {
            true => done.column("scene_probes.csv", "ux")[0],
            false => *done.column("scene_history.csv", "e_ux").last().unwrap(),
        };
        // 0.0023 here, half as much with half the horizon; one expansion for both gave 0.10
        assert!((u / expected - 1.0).abs() < 0.004, "{u} {expected}");
    }
    // elements of another expansion in a seam that does not count materials
    let seam = strip
        .replace("lps", "bond-based")
        .replace("poisson-ratio = 0.2, ", "");
    let seam = seam
        .replace("poisson-ratio = 0.4, ", "")
        .replacen("1e-3", "2e-3", 1);
    let mut scene = super::read(&seam, &["coupling=truncated"]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    scene.set_output_directory(folder.path().to_owned());
    let refused = scene
        .run(&bondline::progress::Silent)
        .unwrap_err()
        .to_string();
    assert!(refused.contains("expand differently"), "{refused}");
}
