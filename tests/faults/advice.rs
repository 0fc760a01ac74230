//! Numbers and advice of warnings: they are those of the solution, and following one leads out of it.

use std::fmt::Write as _;

use crate::{Case, percent};

/// The warning with some words, if there is one.
fn told(text: &str, overrides: &[&str], words: &str) -> Option<String> {
    let summary = Case::new(text).run(overrides).expect("it runs");
    let list = summary["warnings"].as_array().into_iter().flatten();
    let mut texts = list.filter_map(|w| w["message"].as_str());
    texts.find(|w| w.contains(words)).map(str::to_owned)
}

/// An arm with a narrow blending within its length, 6 thick and 60 long: 1.4 % of the forces are out of balance, and its end sinks by 18.6 % too much.
const ARM: &str = r#"
kinematics = "plane-strain"
coupling = "blending"
mesh.rectangle = { min = [0, 0], max = [60, 6], x = { cells = 60 }, y = { cells = 6 } }
materials.m.bond-based = { youngs-modulus = 1 }
peridynamics = { horizon = 1.5, points.lattice = { spacing = 0.5, origin = [0.13, 0.21] } }
zones.nonlocal.box = { min = [29, 2], max = [32, 4] }
zones.transition.around = 1.6
conditions.held.displacement = { on = "left", x = 0, y = 0 }
conditions.down.traction = { on = "right", y = -1e-5 }
output = { vtu = false, name = "arm", probes.tip.at = [60, 3] }
"#;

#[test]
fn forces_out_of_balance_are_told_with_what_they_do_to_displacements() {
    let sinks = |coupling: &str| {
        let case = Case::new(ARM);
        let set = format!("coupling={coupling}");
        case.run(&["--set", &set]).expect("it runs");
        let table = case.read("out/arm_probes.csv");
        let row: Vec<&str> = table.lines().nth(1).expect("a row").split(',').collect();
        row[3].parse::<f64>().expect("a number")
    };
    let error = 100.0 * (sinks("blending") / sinks("local") - 1.0);
    let text = told(ARM, &[], "out of balance").expect("it is told");
    let said = text.split("elements alone").nth(1).expect("a difference");
    // the largest of all nodes, and of both axes
    assert!(
        (0.99..1.1).contains(&(percent(said) / error)),
        "{error}: {text}"
    );
    assert!(text.contains("couple by truncated"), "{text}");
    let followed = ["--set", "coupling=truncated"];
    assert_eq!(told(ARM, &followed, "out of balance"), None);
}

#[test]
fn kinds_of_warnings_are_left_out_or_denied() {
    let set = |key: &str, code: &str| format!("warnings.{key}=[\"{code}\"]");
    assert!(told(ARM, &[], "out of balance").is_some());
    let allowed = set("allow", "W32");
    assert_eq!(told(ARM, &["--set", &allowed], "out of balance"), None);
    // what only the solution shows is denied at the end, with its results written
    let case = Case::new(ARM);
    let output = case.command("run", &["--json", "--set", &set("deny", "W32")]);
    assert_eq!(output.status.code(), Some(1));
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a summary");
    let list = summary["warnings"].as_array().expect("warnings");
    let denied = list
        .iter()
        .find(|w| w["code"] == "W32")
        .expect("it is told");
    assert_eq!(denied["denied"], true);
    assert_eq!(denied["quantity"], "displacement");
    assert_eq!(denied["remedies"][0][0], "coupling=truncated");
    assert!(denied["effect"].as_f64().is_some_and(|part| part > 0.1));
    assert_eq!(case.read("out/arm_probes.csv").lines().count(), 2);
    // what the model shows is denied before
    let case = Case::new(ARM);
    let surfaces = ["--set", "coupling=nonlocal", "--set", &set("deny", "W13")];
    let said = case.run(&surfaces).expect_err("it is denied");
    assert!(said.contains("warnings.deny has W13"), "{said}");
    let output = case.command("run", &["--set", &set("deny", "W99")]);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("W99") && said.contains("W32"), "{said}");
}

#[test]
fn a_truncated_seam_across_a_temperature_is_not_told_to_be_truncated() {
    let scene = r#"
kinematics = "plane-stress"
coupling = "truncated"
mesh.rectangle = { min = [0, 0], max = [24, 10], x = { cells = 24 }, y = { cells = 10 } }
temperature = { value = "300 - 280*exp(-y/1.5)", reference = 300 }
materials.alumina.bond-based = { youngs-modulus = 370e3, thermal-expansion = 7.5e-6 }
peridynamics = { horizon = 0.9, points.lattice = { spacing = 0.3, origin = [0.1, 0.1] } }
zones.nonlocal.box = { min = [6, 2], max = [18, 6] }
conditions.top.symmetry.on = "top"
conditions.left.symmetry.on = "left"
output.vtu = false
"#;
    if let Some(text) = told(scene, &[], "out of balance") {
        assert!(!text.contains("couple by truncated"), "{text}");
        assert!(text.contains("couple by nonlocal"), "{text}");
    }
    let followed = ["--set", "coupling=nonlocal"];
    assert_eq!(told(scene, &followed, "out of balance"), None);
}

/// A ring of quadrilaterals about a bore of the radius 6, in the format 2.2 of Gmsh.
fn ring() -> String {
    let (around, across) = (24, 12);
    let mut text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 1 \"bore\"\n2 2 \"body\"\n$EndPhysicalNames\n".to_owned();
    let _ = writeln!(text, "$Nodes\n{}", around * (across + 1));
    for k in 0..=across {
        for a in 0..around {
            let (r, t) = (
                6.0 + 2.0 * f64::from(k),
                std::f64::consts::TAU * f64::from(a) / f64::from(around),
            );
            let _ = writeln!(
                text,
                "{} {} {} 0",
                k * around + a + 1,
                r * t.cos(),
                r * t.sin()
            );
        }
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", around * (across + 1));
    let node = |k: i32, a: i32| k * around + a % around + 1;
    for a in 0..around {
        let _ = writeln!(text, "{} 1 2 1 1 {} {}", a + 1, node(0, a + 1), node(0, a));
    }
    for k in 0..across {
        for a in 0..around {
            let [p, q, r, s] = [
                node(k, a),
                node(k + 1, a),
                node(k + 1, a + 1),
                node(k, a + 1),
            ];
            let _ = writeln!(text, "{} 3 2 2 1 {p} {q} {r} {s}", around * (k + 1) + a + 1);
        }
    }
    text + "$EndElements\n"
}

#[test]
fn a_bore_of_two_horizons_is_told_by_its_curved_surface() {
    let scene = r#"
kinematics = "plane-stress"
mesh.file.path = "ring.msh"
coupling = "truncated"
materials.m.bond-based.youngs-modulus = 7e4
peridynamics = { horizon = 3, points.lattice = { spacing = 1, origin = [0.5, 0.5] } }
zones.nonlocal.ball = { center = [0, 0], radius = 13 }
conditions.held.displacement = { inside.ball = { center = [30, 0], radius = 0.1 }, x = 0, y = 0 }
conditions.turned.displacement = { inside.ball = { center = [-30, 0], radius = 0.1 }, y = 0 }
conditions.p.pressure = { on = "bore", value = 40 }
output.vtu = false
"#;
    let run = |set: &str| {
        let case = Case::new(scene);
        std::fs::write(case.path("ring.msh"), ring()).expect("the mesh is written");
        case.run(&["--set", set]).expect("it runs")
    };
    let energy = |set: &str| run(set)["energy"].as_f64().expect("a number");
    let alone = energy("coupling=local");
    let softer = 100.0 * (energy("zones.skin=none") / alone - 1.0);
    let all = run("zones.skin=none")["warnings"].to_string();
    let at = all
        .find("a uniform stress comes out wrong by")
        .expect("it is told");
    let said = percent(&all[at..].replace(" % of it", " %")).abs();
    // of the stress of some points, and of the energy of the body
    assert!(
        (softer / 3.0..softer * 3.0).contains(&said),
        "{softer}: {all}"
    );
    // by default elements lie along the bore, since nothing fails
    let default = run("coupling=truncated");
    let off = default["energy"].as_f64().expect("a number") / alone - 1.0;
    assert!(off.abs() < 0.05 && softer > 20.0, "{off} {softer}");
    assert!(!default["warnings"].to_string().contains("comes out wrong"));
}
