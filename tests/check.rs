//! Predictions of `check` against measurements of `run`, both by the binary: one process each, so that peaks are their own.

use assert_cmd::Command;
use serde_json::Value;

/// The JSON that a command of the binary prints for a scene.
fn json(command: &str, scene: &str, overrides: &[&str], folder: &std::path::Path) -> Value {
    let mut binary = Command::cargo_bin("bondline").unwrap();
    binary
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .args([command, scene, "--json"]);
    for set in overrides {
        binary.args(["--set", set]);
    }
    if command == "run" {
        binary.arg("--output").arg(folder);
    }
    let output = binary.assert().success().get_output().stdout.clone();
    serde_json::from_slice(&output).unwrap()
}

/// Bonds and non-zeros are exact, and memory is within a fifth.
fn compare(scene: &str, overrides: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let predicted = json("check", scene, overrides, folder.path());
    let measured = json("run", scene, overrides, folder.path());
    assert_eq!(
        predicted["sizes"], measured["sizes"],
        "{scene} {overrides:?}"
    );
    assert!(measured["sizes"]["sites"].as_u64().unwrap() > 0);
    let solver = |v: &Value| -> Vec<String> {
        let names = v["choices"].as_array().unwrap().iter();
        names
            .map(|c| c["choice"].as_str().unwrap().to_owned())
            .filter(|c| c.ends_with("factorisation") || c.ends_with("multigrid"))
            .collect()
    };
    assert_eq!(solver(&measured).len(), 1, "{measured}");
    assert_eq!(
        solver(&predicted),
        solver(&measured),
        "{scene} {overrides:?}"
    );
    let bytes = |v: &Value| v["peak_memory_bytes"].as_f64().unwrap();
    if cfg!(target_os = "linux") {
        let ratio = bytes(&predicted) / bytes(&measured);
        println!(
            "{scene} {overrides:?}: {:.1} MB predicted, {:.1} MB measured, ratio {ratio:.3}",
            bytes(&predicted) * 1e-6,
            bytes(&measured) * 1e-6
        );
        assert!(
            (0.8..=1.2).contains(&ratio),
            "{scene} {overrides:?}: {ratio}"
        );
    }
}

const SLIT_PLATE: &str = "examples/slit_plate.toml";

/// Cells of twice the length and three spacings to a horizon instead of six: a fraction of the bonds.
const COARSE: [&str; 4] = [
    "mesh.rectangle.x.cells=60",
    "mesh.rectangle.y.cells=60",
    "mesh.rectangle.cutouts.slit={min=[-0.1,\"-1/60\"],max=[0.1,\"1/60\"]}",
    "peridynamics.points.lattice.spacing=1/60",
];

/// The plate itself, by blending.
#[test]
fn slit_plate() {
    compare(SLIT_PLATE, &[]);
}

fn coarse_slit_plate_by(couplings: &[&str]) {
    for coupling in couplings {
        let coupling = format!("coupling={coupling}");
        let mut overrides = COARSE.to_vec();
        overrides.push(&coupling);
        compare(SLIT_PLATE, &overrides);
    }
}

#[test]
fn coarse_slit_plate_of_one_model_or_spliced() {
    coarse_slit_plate_by(&["local", "nonlocal", "splice"]);
}

#[test]
fn coarse_slit_plate_with_a_transition() {
    coarse_slit_plate_by(&["blending", "balanced", "partial-stress"]);
}

#[test]
fn slit_plate_iteratively() {
    compare(SLIT_PLATE, &["coupling=splice", "solver.method=krylov"]);
}

#[test]
fn bar() {
    compare("src/scene/templates/bar.toml", &[]);
}

#[test]
fn block_of_a_linear_peridynamic_solid() {
    let scene = "tests/fixtures/block.toml";
    for solver in ["auto", "direct"] {
        compare(scene, &[&format!("solver.method={solver}")]);
    }
}

#[test]
fn costs_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let warnings = |overrides: &[&str]| -> String {
        let found = json("check", SLIT_PLATE, overrides, folder.path());
        found["warnings"].to_string()
    };
    assert!(warnings(&["coupling.blending.beta=smooth"]).contains("less than 3"));
    assert!(!warnings(&[]).contains("less than"));
    assert!(
        warnings(&["coupling=splice", "peridynamics.horizon=\"1.5/120\""])
            .contains("1.50 spacings")
    );
    // the scene's transition zone is for blending
    let unused = warnings(&["coupling=splice"]);
    assert_eq!(unused.matches("\"code\"").count(), 1, "{unused}");
    assert!(unused.contains("W01"), "{unused}");
    assert!(
        unused.contains("`zones.transition` is not used"),
        "{unused}"
    );
}

/// An `accuracy` fills in the mesh, and `zones.auto` then finds that nothing needs peridynamics: both are told, by `check` and by `run`.
#[test]
fn an_accuracy_beside_a_zone_that_is_placed() {
    let scene = "examples/choices/zone_block.toml";
    let overrides = ["accuracy=0.05", "zones=auto"];
    let folder = tempfile::tempdir().unwrap();
    let predicted = json("check", scene, &overrides, folder.path());
    let error = predicted["error"]["error"].as_f64().unwrap();
    assert!(error > 0.0 && error <= 0.05, "{error}");
    let measured = json("run", scene, &overrides, folder.path());
    for told in [&predicted, &measured] {
        let list = told["choices"].as_array().unwrap();
        for wanted in ["cells", "zones.auto: no peridynamics", "coupling local"] {
            let said = |c: &Value| c["choice"].as_str().unwrap().contains(wanted);
            assert!(list.iter().any(said), "{wanted}: {list:?}");
        }
    }
    assert_eq!(measured["sizes"]["points"].as_u64(), Some(0));
}

/// The error of a scene that leaves nothing open, against the closed form `u = sin(2πx)/4π²`: linear elements are exact at nodes here.
#[test]
fn the_error_of_a_typed_scene_is_predicted() {
    let folder = tempfile::tempdir().unwrap();
    let tau = 2.0 * std::f64::consts::PI;
    let exact = |x: f64| (tau * x).sin() / (tau * tau);
    for cells in [10, 40] {
        let (mut apart, mut size) = (0.0, 0.0);
        for k in 0..101 {
            let x = 0.013 + 0.974 * f64::from(k) / 100.0;
            let n = f64::from(cells);
            let (cell, t) = ((x * n).floor(), (x * n).fract());
            let u = exact(cell / n) * (1.0 - t) + exact((cell + 1.0) / n) * t;
            apart += (u - exact(x)).powi(2);
            size += exact(x).powi(2);
        }
        let error = f64::sqrt(apart / size);
        let mesh = format!("mesh.line.x.cells={cells}");
        let overrides = [mesh.as_str(), "coupling=local"];
        let found = json(
            "check",
            "examples/choices/bar_sine.toml",
            &overrides,
            folder.path(),
        );
        let predicted = found["error"]["error"].as_f64().unwrap();
        assert_eq!(found["error"]["against"], "elasticity");
        let ratio = predicted / error;
        assert!(
            (1.0 / 1.15..1.15).contains(&ratio),
            "{cells} cells: {predicted} of {error}"
        );
    }
}

/// Checks that `check` gives the reason and the remedy if no error is predicted.
#[test]
fn an_error_that_is_not_predicted_has_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let why = |scene: &str| {
        let found = json("check", scene, &[], folder.path());
        assert_eq!(found["error"], Value::Null);
        found["no_error"].as_str().unwrap().to_owned()
    };
    assert!(why("examples/slit_plate_gmsh.toml").contains("mesh from a file"));
    // coarser points would take the cracks other ways, and finer ones cost too much
    assert!(why("examples/branching.toml").contains("--pilots"));
}

/// Elements with a partial stress at free sides are warned of, by `check` and by `run`; a splice has none.
#[test]
fn cracks_beside_the_seam_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    // the zone reaches two horizons beyond the slit, whose place a crack takes; then one
    let crack = "cracks.slit.segment={from=[-0.1,0],to=[0.1,0]}";
    let near = [
        crack,
        "zones.nonlocal.box.min=[-0.15,-0.05]",
        "zones.nonlocal.box.max=[0.15,0.05]",
    ];
    for (coupling, overrides, expected) in [
        ("coupling=splice", &[crack][..], false),
        ("coupling=splice", &near[..], true),
        ("coupling=truncated", &near[..], false),
        ("coupling.partial-stress.form=meshfree", &near[..], true),
    ] {
        let mut overrides = overrides.to_vec();
        overrides.push(coupling);
        let found = json("check", SLIT_PLATE, &overrides, folder.path());
        let warnings = found["warnings"].to_string();
        assert_eq!(
            warnings.contains("a crack or void lies 1.00 horizons from the seam at (-1.5000e-1, "),
            expected,
            "{coupling}: {warnings}"
        );
    }
}

#[test]
fn one_sided_families_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let coarse = [
        "peridynamics.horizon=0.004",
        "mesh.box.x.cells=20",
        "mesh.box.y.cells=6",
        "mesh.box.z.cells=6",
    ];
    for (coupling, expected) in [
        ("coupling.partial-stress.form=elements", true),
        ("coupling=splice", false),
    ] {
        let mut overrides = coarse.to_vec();
        overrides.push(coupling);
        for command in ["check", "run"] {
            let found = json(
                command,
                "examples/coupled_bar_3d.toml",
                &overrides,
                folder.path(),
            );
            let warnings = found["warnings"].to_string();
            assert_eq!(
                warnings.contains("one-sided"),
                expected,
                "{command}: {warnings}"
            );
        }
    }
}

/// Seconds that are none are refused, not taken for very few.
#[test]
fn pilots_take_a_time_above_zero() {
    for seconds in ["nan", "-1", "0", "inf"] {
        let mut binary = Command::cargo_bin("bondline").unwrap();
        let pilots = format!("--pilots={seconds}");
        let refused = binary
            .args(["check", "examples/coupled_bar.toml", &pilots])
            .assert()
            .failure();
        let text = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
        assert!(text.contains("above zero"), "{seconds}: {text}");
    }
}

/// The error that a command ends with, and the seconds that it took.
fn refused(command: &str, overrides: &[&str], folder: &std::path::Path) -> (String, f64) {
    let mut binary = Command::cargo_bin("bondline").unwrap();
    binary
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .args([command, SLIT_PLATE]);
    for set in overrides {
        binary.args(["--set", set]);
    }
    if command == "run" {
        binary.arg("--output").arg(folder);
    }
    let begun = std::time::Instant::now();
    let output = binary.assert().failure().code(1).get_output().clone();
    let seconds = begun.elapsed().as_secs_f64();
    let words: Vec<String> = String::from_utf8_lossy(&output.stderr)
        .split_whitespace()
        .filter(|word| *word != "│")
        .map(str::to_owned)
        .collect();
    (words.join(" "), seconds)
}

/// A spacing that is a hundred times too small would ask for terabytes. Before volumes were counted it ended, after minutes, in an allocation that failed.
#[test]
fn what_does_not_fit_is_refused_before_anything_is_laid_out() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["check", "run"] {
        let set = ["peridynamics.points.lattice.spacing=1/12000"];
        let (error, seconds) = refused(command, &set, folder.path());
        for part in ["of memory", "bonds", "points", "spacing of", "--memory"] {
            assert!(error.contains(part), "{part}: {error}");
        }
        assert!(seconds < 2.0, "{seconds} s");
    }
}

/// Returns the share of each process in a plate of 20 × 10 points.
fn shares(law: &str, solve: &str, count: usize) -> Vec<[u64; 4]> {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "kinematics = \"plane-stress\"\ncoupling = \"nonlocal\"\n[mesh.rectangle]\nmin = [0, 0]\nmax = [20, 10]\nx = {{ cells = 20 }}\ny = {{ cells = 10 }}\n[materials.m.{law}\nyoungs-modulus = 1\ndensity = 1\n[peridynamics]\nhorizon = 3\npoints.lattice = {{ spacing = 1, origin = [0.5, 0.5] }}\n[conditions.left.displacement]\ninside.box = {{ min = [0, 0], max = [3, 10] }}\nx = 0\ny = 0\n{solve}"
    );
    let path = folder.path().join("plate.toml");
    std::fs::write(&path, text).unwrap();
    let mut binary = Command::cargo_bin("bondline").unwrap();
    binary.arg("check").arg(&path).arg("--json");
    binary.args(["--processes", &count.to_string()]);
    let output = binary.assert().success().get_output().stdout.clone();
    let found: Value = serde_json::from_slice(&output).unwrap();
    let all = found["processes"].as_array().unwrap().iter();
    let number = |share: &Value, key: &str| share[key].as_u64().unwrap();
    for share in found["processes"].as_array().unwrap() {
        assert!(share["memory_bytes"].as_u64() > share["stiffness_bytes"].as_u64());
    }
    let keys = ["sites", "ghosts", "stiffness_bytes", "received_bytes"];
    all.map(|share| keys.map(|key| number(share, key)))
        .collect()
}

#[test]
fn processes_are_told_their_sites_and_ghosts() {
    let moves = "[solve.explicit]\nduration = 1\n";
    let [one] = shares("bond-based]", "", 1)[..] else {
        panic!("one process");
    };
    assert_eq!([one[0], one[1], one[3]], [200, 0, 0]);
    // halves of the plate: bonds reach three columns of ten points; those of an LPS have no weight at the horizon and reach two, rows with dilatations twice as far
    let lps = "lps]\npoisson-ratio = 0.3";
    for (law, ghosts) in [("bond-based]", 30), (lps, 40)] {
        for [sites, found, bytes, received] in shares(law, "", 2) {
            assert_eq!(
                [sites, found, received],
                [100, ghosts, ghosts * 16],
                "{law}"
            );
            assert!(bytes > 0);
        }
        // the forces of ghosts, which lie within the families, of an LPS within two of them, whatever the weights at the horizon
        let moved = if law == lps { 60 } else { 30 };
        for share in shares(law, moves, 2) {
            assert_eq!(share, [100, moved, 0, moved * 16], "{law}");
        }
    }
    // families that are spread are not known before: their points count the same, where those at the edges have fewer bonds
    let sites = |solve: &str| -> Vec<u64> {
        let shares = shares("bond-based]", solve, 5).into_iter();
        shares.map(|share| share[0]).collect()
    };
    assert_eq!([sites(moves), sites("")], [[40; 5]; 2]);
    // numbers made of stresses take those of all points
    assert_ne!(sites("[output]\nstresses = [\"von-mises\"]\n"), [40; 5]);
    // more processes than sites
    let many = shares("bond-based]", "", 300);
    assert_eq!(many.iter().map(|share| share[0]).sum::<u64>(), 200);
}
