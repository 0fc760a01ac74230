//! `bondline trade`: what speed costs, measured through the command line.

use std::path::Path;
use std::process::Output;

/// A plate with a crack, pulled; small enough for a dozen runs in a second or two.
const PLATE: &str = r#"
kinematics = "plane-stress"
coupling = "splice"
mesh.rectangle = { min = [0, 0], max = [1, 1], x = { cells = 20 }, y = { cells = 20 } }
cracks.edge.segment = { from = [-0.1, 0.51], to = [0.4, 0.51] }
[materials.plate.bond-based]
youngs-modulus = 1
[peridynamics]
horizon = 0.15
points.lattice = { spacing = 0.05, origin = [0, 0] }
[zones.nonlocal]
box = { min = [-1, 0.2], max = [0.8, 0.8] }
[conditions.bottom.displacement]
on = "bottom"
x = 0
y = 0
[conditions.top.displacement]
on = "top"
y = 0.01
"#;

fn bondline(folder: &Path, arguments: &[&str]) -> Output {
    assert_cmd::Command::cargo_bin("bondline")
        .unwrap()
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// A second call has nothing left to run; after half a line, as a killed study leaves it, one case is run again.
fn check_second_call(folder: &Path, study: &[&str], out: &Path, found: &serde_json::Value) {
    let cases = found["cases"].as_array().unwrap();
    let record = std::fs::read(out.join("cases.jsonl")).unwrap();
    let second = bondline(folder, study);
    assert!(second.status.success(), "{}", text(&second.stderr));
    let settings = |study: &serde_json::Value| -> Vec<String> {
        let cases = study["cases"].as_array().unwrap();
        cases.iter().map(|c| c["settings"].to_string()).collect()
    };
    let again = json(&out.join("trade.json"));
    assert_eq!(settings(&again), settings(found));
    assert_eq!(again["front"], found["front"]);
    // half a line, as a killed study leaves it, is done again
    std::fs::write(out.join("cases.jsonl"), &record[..record.len() - 7]).unwrap();
    assert!(bondline(folder, study).status.success());
    assert_eq!(
        json(&out.join("trade.json"))["cases"]
            .as_array()
            .unwrap()
            .len(),
        cases.len()
    );
}

/// The scene for the wanted error runs, with the bonds that the front says.
fn check_wanted_scene(folder: &Path, out: &Path, cases: &[serde_json::Value]) {
    let scene = out.join("plate-chosen.toml");
    let text_of_scene = std::fs::read_to_string(&scene).unwrap();
    assert!(text_of_scene.starts_with("# "), "{text_of_scene}");
    let run = bondline(
        folder,
        &[
            "run",
            scene.to_str().unwrap(),
            "--json",
            "--output",
            "again",
        ],
    );
    assert!(run.status.success(), "{}", text(&run.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    let bonds = summary["sizes"]["bonds"].as_f64().unwrap();
    let name = text_of_scene.lines().next().unwrap();
    let meets = |c: &&serde_json::Value| {
        let ran = &c["outcome"]["ran"];
        ran["errors"][0].as_f64().is_some_and(|e| e <= 0.05)
    };
    let cheapest = cases
        .iter()
        .filter(meets)
        .map(|c| c["outcome"]["ran"]["cost"]["bond_visits"].as_f64().unwrap())
        .fold(f64::INFINITY, f64::min);
    assert_eq!(bonds, cheapest, "{name}");
}

#[test]
fn a_study_finds_a_front_goes_on_and_writes_the_scene_for_a_wanted_error() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("plate.toml"), PLATE).unwrap();
    let study = [
        "trade",
        "plate.toml",
        "--knob",
        "coupling,m,padding",
        "--cost",
        "bond-visits",
        "--want",
        "displacement=5%",
    ];
    let first = bondline(folder.path(), &study);
    assert!(first.status.success(), "{}", text(&first.stderr));
    let out = folder.path().join("out/trade/plate");
    let found = json(&out.join("trade.json"));
    let cases = found["cases"].as_array().unwrap();
    assert!(cases.len() > 8, "{}", text(&first.stdout));
    // elements that see no crack are not offered
    assert!(cases.iter().all(|c| c["settings"][0] != "local"));
    // fewer bonds at m = 2, and a larger error, than at m = 6
    let of = |label: &str| {
        let case = cases
            .iter()
            .find(|c| c["settings"] == serde_json::json!([label]))
            .unwrap();
        let ran = &case["outcome"]["ran"];
        (
            ran["cost"]["bond_visits"].as_f64().unwrap(),
            ran["errors"][0].as_f64().unwrap(),
        )
    };
    let (coarse, fine) = (of("m = 2"), of("m = 6"));
    assert!(
        coarse.0 < fine.0 && coarse.1 > fine.1,
        "{coarse:?} {fine:?}"
    );
    // nothing on the front is beaten
    let front = found["front"].as_array().unwrap();
    assert!(!front.is_empty() && out.join("trade.svg").exists() && out.join("trade.png").exists());
    check_second_call(folder.path(), &study, &out, &found);
    check_wanted_scene(folder.path(), &out, cases);
    // another quantity is another study
    let other = bondline(
        folder.path(),
        &["trade", "plate.toml", "--want", "reaction=1%"],
    );
    assert!(!other.status.success());
    assert!(
        text(&other.stderr).contains("another scene"),
        "{}",
        text(&other.stderr)
    );
}

#[test]
fn what_cannot_be_studied_is_said() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("plate.toml"), PLATE).unwrap();
    let complaint = |arguments: &[&str]| {
        let all: Vec<&str> = ["trade", "plate.toml"]
            .iter()
            .chain(arguments)
            .copied()
            .collect();
        let output = bondline(folder.path(), &all);
        assert!(!output.status.success(), "{arguments:?}");
        text(&output.stderr)
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    };
    for (arguments, wanted) in [
        (&["--knob", "horizon"][..], "does not apply"),
        (&["--knob", "colour"], "possible values"),
        (&["--vary", "solver.tolerance=1e-4"], "no list"),
        (&["--want", "path.front=1%"], "no `path.front` to compare"),
        (&["--want", "probe:tip.u=1%"], "no `probe.tip.u` to compare"),
        (&["--want", "colour=1%"], "no quantity"),
        (&["--want", "probe.tip=1%"], "names no column"),
        (&["--want", "displacement=0"], "no error above zero"),
        (
            &["--reference", "half"],
            "full-pd, fe, finer, or a scene file",
        ),
        (&["--reference", "none.toml"], "none.toml"),
        (&["--budget", "10"], "a time"),
        (&["--set", "coupling=slice"], "did you mean `splice`"),
        (
            &[
                "--reference-set",
                "peridynamics.horizon=0.01",
                "--output",
                "x",
            ],
            "the reference does not run",
        ),
    ] {
        let found = complaint(arguments);
        assert!(found.contains(wanted), "{arguments:?}: {found}");
    }
}

/// A mesh file of `cells` by `cells` squares in a unit square, in Gmsh 2.2, with the groups `bottom`, `top` and `body`.
fn mesh(cells: usize) -> String {
    let at = |i: usize, j: usize| j * (cells + 1) + i + 1;
    let (mut nodes, mut elements, mut count) = (String::new(), String::new(), 0);
    for j in 0..=cells {
        for i in 0..=cells {
            let (x, y) = (i as f64 / cells as f64, j as f64 / cells as f64);
            nodes += &format!("{} {x} {y} 0\n", at(i, j));
        }
    }
    let mut push = |text: String| {
        count += 1;
        elements += &format!("{count} {text}\n");
    };
    for (group, j) in [(1, 0), (2, cells)] {
        for i in 0..cells {
            push(format!("1 2 {group} {group} {} {}", at(i, j), at(i + 1, j)));
        }
    }
    for j in 0..cells {
        for i in 0..cells {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            push(format!("3 2 3 3 {a} {b} {c} {d}"));
        }
    }
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"bottom\"\n1 2 \"top\"\n2 3 \"body\"\n$EndPhysicalNames\n\
         $Nodes\n{}\n{nodes}$EndNodes\n$Elements\n{count}\n{elements}$EndElements\n",
        (cells + 1) * (cells + 1)
    )
}

/// Results of another mesh under the same name are not those of this one.
#[test]
fn another_mesh_in_the_same_file_is_another_study() {
    let folder = tempfile::tempdir().unwrap();
    let generated =
        "mesh.rectangle = { min = [0, 0], max = [1, 1], x = { cells = 20 }, y = { cells = 20 } }";
    assert!(PLATE.contains(generated));
    let scene = PLATE.replace(generated, "mesh.file = { path = \"m.msh\" }");
    std::fs::write(folder.path().join("plate.toml"), scene).unwrap();
    let study = |output: &str, vary: &str| {
        let arguments = [
            "trade",
            "plate.toml",
            "--vary",
            vary,
            "--want",
            "reaction=1%",
            "--reference-set",
            "coupling=nonlocal",
            "--output",
            output,
        ];
        bondline(folder.path(), &arguments)
    };
    let errors = |output: &str| -> Vec<f64> {
        let found = json(&folder.path().join(output).join("trade.json"));
        let cases = found["cases"].as_array().unwrap().clone();
        let error = |c: &serde_json::Value| c["outcome"]["ran"]["errors"][0].as_f64().unwrap();
        cases.iter().map(error).collect()
    };
    let vary = "mesh.file.path=[\"other.msh\"]";
    let write =
        |name: &str, cells: usize| std::fs::write(folder.path().join(name), mesh(cells)).unwrap();
    write("m.msh", 20);
    write("other.msh", 16);
    let first = study("kept", vary);
    assert!(first.status.success(), "{}", text(&first.stderr));
    let before = errors("kept");
    assert_eq!(before.len(), 2);
    // a mesh that one case reads alone: that case runs again
    write("other.msh", 24);
    assert!(study("kept", vary).status.success());
    assert!(study("fresh", vary).status.success());
    let after = errors("kept");
    assert_eq!(after, errors("fresh"));
    assert!(
        after[0] == before[0] && after[1] != before[1],
        "{before:?} {after:?}"
    );
    // the mesh of the scene: nothing of the study holds
    write("m.msh", 26);
    let second = study("kept", vary);
    assert!(!second.status.success());
    let said = text(&second.stderr)
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert!(said.contains("another scene, mesh, reference"), "{said}");
}

/// A plate on the mesh of a file that is pulled down by its weight; nothing breaks.
fn hanging_plate(folder: &Path) {
    let generated =
        "mesh.rectangle = { min = [0, 0], max = [1, 1], x = { cells = 20 }, y = { cells = 20 } }";
    let crack = "cracks.edge.segment = { from = [-0.1, 0.51], to = [0.4, 0.51] }\n";
    assert!(PLATE.contains(generated) && PLATE.contains(crack));
    let scene = PLATE
        .replace(generated, "mesh.file = { path = \"m.msh\" }")
        .replace(crack, "")
        .replace(
            "[-1, 0.2], max = [0.8, 0.8]",
            "[0.2, 0.2], max = [0.8, 0.8]",
        );
    let more = "[conditions.weight.body-force]\nx = '0.02*y'\n\
                [output]\nprobes.tip = { at = [0.9, 0.95] }\nlines.cut = { from = [0.1, 0.5], to = [0.9, 0.5], samples = 21 }\n";
    let title = "title = \"A plate that hangs\"\n";
    std::fs::write(folder.join("plate.toml"), title.to_owned() + &scene + more).unwrap();
    std::fs::write(folder.join("m.msh"), mesh(20)).unwrap();
}

/// The errors of a case of two quantities, if it ran.
fn errors(case: &serde_json::Value) -> Option<[f64; 2]> {
    let errors = case["outcome"]["ran"]["errors"].as_array()?;
    Some([0, 1].map(|k| errors[k].as_f64().unwrap()))
}

/// The study lists the cheapest of each coupling with both errors, found again from all cases.
fn assert_cheapest(found: &serde_json::Value, cases: &[serde_json::Value]) {
    let cost = |case: &serde_json::Value| case["outcome"]["ran"]["cost"]["bond_visits"].as_f64();
    let name = |case: &serde_json::Value| -> String {
        let settings = case["settings"].as_array().unwrap().iter();
        let settings: Vec<&str> = settings.map(|s| s.as_str().unwrap()).collect();
        match settings.is_empty() {
            true => "the scene".to_owned(),
            false => settings.join(", "),
        }
    };
    let listed = found["at_equal_error"].as_array().unwrap();
    let mut couplings: Vec<&str> = cases
        .iter()
        .filter(|c| errors(c).is_some())
        .map(|c| c["coupling"].as_str().unwrap())
        .collect();
    couplings.sort_unstable();
    couplings.dedup();
    assert_eq!(listed.len(), couplings.len());
    assert!(couplings.len() > 3, "{couplings:?}");
    let ratio = |case: &serde_json::Value| errors(case).map(|[a, b]| (a / 0.005).max(b / 0.01));
    for coupling in couplings {
        let own = || {
            cases
                .iter()
                .filter(|c| c["coupling"] == coupling && errors(c).is_some())
        };
        let met = own().filter(|c| ratio(c).unwrap() <= 1.0);
        let best = met.min_by(|a, b| cost(a).partial_cmp(&cost(b)).unwrap());
        let best = best.or_else(|| own().min_by(|a, b| ratio(a).partial_cmp(&ratio(b)).unwrap()));
        let best = best.unwrap();
        let is_listed = |l: &serde_json::Value| {
            let other = cases
                .iter()
                .find(|c| name(c) == l.as_str().unwrap())
                .unwrap();
            other["coupling"] == coupling && cost(other) == cost(best)
        };
        assert!(listed.iter().any(is_listed), "{coupling}: {listed:?}");
    }
}

#[test]
fn couplings_are_compared_at_equal_error_and_at_equal_cost() {
    let folder = tempfile::tempdir().unwrap();
    hanging_plate(folder.path());
    let study = [
        "trade",
        "plate.toml",
        "--knob",
        "coupling,m",
        "--cost",
        "bond-visits",
        "--want",
        "probe:tip.u=0.5%",
        "--want",
        "line.cut.ux=1%",
    ];
    let first = bondline(folder.path(), &study);
    assert!(first.status.success(), "{}", text(&first.stderr));
    let said = text(&first.stdout);
    let found = json(&folder.path().join("out/trade/plate/trade.json"));
    assert_eq!(
        found["quantities"],
        serde_json::json!(["probe.tip.u", "line.cut.ux"])
    );
    // nothing breaks: elements of second order are the reference, and those of the file its bound
    let reference = found["reference"].to_string();
    assert!(reference.contains("coupling=local"), "{reference}");
    assert!(reference.contains("mesh.file.order=second"), "{reference}");
    let cases = found["cases"].as_array().unwrap();
    let local = cases
        .iter()
        .find(|c| c["settings"] == serde_json::json!(["local"]));
    let bound = errors(local.unwrap()).unwrap();
    assert_eq!(found["reference_errors"], serde_json::json!(bound));
    assert!(bound.iter().all(|e| *e > 0.0 && *e < 0.005), "{bound:?}");
    // elements alone have no points
    let alone = cases.iter().filter(|c| c["coupling"] == "local");
    assert_eq!(alone.count(), 1, "{said}");
    assert_cheapest(&found, cases);
    assert!(said.contains("chosen: local"), "{said}");
    let chosen = folder.path().join("out/trade/plate/plate-chosen.toml");
    let chosen = std::fs::read_to_string(chosen).unwrap();
    assert!(
        chosen.starts_with("# local: the cheapest case found"),
        "{chosen}"
    );
}

#[test]
fn another_scene_is_a_reference() {
    let folder = tempfile::tempdir().unwrap();
    hanging_plate(folder.path());
    let plate = std::fs::read_to_string(folder.path().join("plate.toml")).unwrap();
    let fine = plate.replace("coupling = \"splice\"", "coupling = \"local\"");
    std::fs::write(folder.path().join("fine.toml"), fine).unwrap();
    let study = [
        "trade",
        "plate.toml",
        "--vary",
        "coupling=[\"local\"]",
        "--want",
        "probe.tip.u=1%",
        "--reference",
        "fine.toml",
    ];
    let output = bondline(folder.path(), &study);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found = json(&folder.path().join("out/trade/plate/trade.json"));
    let cases = found["cases"].as_array().unwrap();
    let error = |k: usize| cases[k]["outcome"]["ran"]["errors"][0].as_f64().unwrap();
    assert_eq!(
        cases[1]["settings"],
        serde_json::json!(["coupling = local"])
    );
    assert!(
        error(1) == 0.0 && error(0) > 0.0,
        "{}",
        text(&output.stdout)
    );
}
