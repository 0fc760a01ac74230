//! Scenes in time, by the binary: against closed forms, across kills and threads, and with every key wrong once.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use bondline::scene::{AnyScene, SceneError, SceneErrorKind, SceneSpec, Source};

/// A bar that breaks: peridynamics in the middle, struck at its left end.
const BREAKING: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [12, 6]
x = { cells = 24 }
y = { cells = 12 }
[materials.plate.bond-based]
youngs-modulus = 1
density = 1
critical-stretch = 0.002
[peridynamics]
horizon = 1.5
points.lattice = { spacing = 0.5 }
[zones]
damage-at-edge = "warn"
nonlocal = { box = { min = [3, 0], max = [9, 6] } }
[cracks.notch]
segment = { from = [5.9, 4], to = [5.9, 6] }
[coupling.splice]
[solve.explicit]
duration = 60
outputs = 6
history-interval = 1
[no-fail.base]
box = { min = [3, 0], max = [9, 1] }
[conditions.left.displacement]
on = "left"
x = "-0.004 * min(1, t / 8)"
[conditions.right.displacement]
on = "right"
x = "0.004 * min(1, t / 8)"
[output]
probes.middle = { at = [6, 2] }
tips.notch = { direction = [0, -1], threshold = 0.2 }
"#;

fn bondline(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bondline"));
    command.current_dir(folder);
    command
}

/// Runs a scene to its end; returns what it printed.
fn run(folder: &Path, arguments: &[&str]) -> String {
    let output = bondline(folder)
        .arg("run")
        .args(arguments)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

/// All files of a folder with their bytes; the checkpoint but one is where it was killed last, so it is left out.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| !p.to_string_lossy().ends_with(".previous"))
        .map(|p| {
            let name = p.file_name().unwrap().to_string_lossy().into_owned();
            (name, std::fs::read(&p).unwrap())
        })
        .collect()
}

fn same(a: &Path, b: &Path) {
    let (a, b) = (files(a), files(b));
    let names = |f: &BTreeMap<String, Vec<u8>>| f.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&a), names(&b));
    for (name, bytes) in &a {
        assert!(bytes == &b[name], "{name} differs");
    }
}

/// The rows of a CSV file by the names of its columns.
fn table(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header = lines
        .next()
        .unwrap()
        .split(',')
        .map(str::to_owned)
        .collect();
    let rows = lines.map(|l| l.split(',').map(|n| n.parse().unwrap()).collect());
    (header, rows.collect())
}

fn column(path: &Path, name: &str) -> Vec<f64> {
    let (header, rows) = table(path);
    let k = header.iter().position(|h| h == name);
    let k = k.unwrap_or_else(|| panic!("{name} is not in {header:?}"));
    rows.iter().map(|r| r[k]).collect()
}

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// Numbers between 0 and 1 (splitmix64), the same in every run.
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[test]
fn a_run_killed_twenty_times_leaves_the_bytes_of_one_never_stopped() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", BREAKING);
    let every = ["bar.toml", "--checkpoint-every", "7"];
    let begun = std::time::Instant::now();
    run(
        folder.path(),
        &[&every[..], &["--output", "whole", "--threads", "1"]].concat(),
    );
    let whole = begun.elapsed();
    let broken = column(&folder.path().join("whole/bar_history.csv"), "broken_bonds");
    assert!(*broken.last().unwrap() > 20.0, "{broken:?}");

    let mut seed = 7;
    let (mut kills, mut ends) = (0, 0);
    while kills < 20 {
        let mut child = bondline(folder.path())
            .arg("run")
            .args(every)
            .args(["--output", "killed", "--resume", "--threads", "2"])
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // anywhere, from before the first file to after the last
        std::thread::sleep(whole.mul_f64(0.6 * uniform(&mut seed)));
        match child.try_wait().unwrap() {
            None => {
                // SIGKILL: nothing is tidied up
                child.kill().unwrap();
                child.wait().unwrap();
                kills += 1;
            }
            Some(status) => {
                let mut said = String::new();
                std::io::Read::read_to_string(&mut child.stderr.unwrap(), &mut said).unwrap();
                assert!(status.success(), "{said}");
                // begin again, so that every kill meets a run
                ends += 1;
                assert!(ends < 40, "only {kills} kills");
                same(&folder.path().join("whole"), &folder.path().join("killed"));
                std::fs::remove_dir_all(folder.path().join("killed")).unwrap();
            }
        }
    }
    run(
        folder.path(),
        &[&every[..], &["--output", "killed", "--resume"]].concat(),
    );
    same(&folder.path().join("whole"), &folder.path().join("killed"));
    println!("{kills} kills, {ends} ends between them");
}

#[test]
#[cfg(unix)]
fn an_interrupt_leaves_a_checkpoint_and_readable_files() {
    let folder = tempfile::tempdir().unwrap();
    let scene = BREAKING.replace("duration = 60", "duration = 600");
    write(folder.path(), "bar.toml", &scene);
    let child = bondline(folder.path())
        .args(["run", "bar.toml"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let history = folder.path().join("out/bar_history.csv");
    for _ in 0..600 {
        if std::fs::read_to_string(&history).is_ok_and(|t| t.lines().count() > 5) {
            break;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("go on with --resume"), "{said}");
    assert!(folder.path().join("out/bar.checkpoint").exists());
    let (header, rows) = table(&history);
    assert!(rows.len() > 5 && rows.iter().all(|r| r.len() == header.len()));
    let pvd = std::fs::read_to_string(folder.path().join("out/bar.pvd")).unwrap();
    assert!(pvd.ends_with("</VTKFile>\n"), "{pvd}");
    // and goes on from there
    let last = rows.last().unwrap()[0] as u64;
    let said = run(folder.path(), &["bar.toml", "--resume", "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(summary["motion"]["ended"], "finished");
    let choices = summary["choices"].to_string();
    assert!(choices.contains("resumed after step"), "{choices}");
    assert!(column(&history, "step").last().unwrap() > &(last as f64));
    let steps = column(&history, "step");
    assert!(steps.windows(2).all(|w| w[0] < w[1]), "rows twice");
}

#[test]
fn damage_at_the_edge_stops_a_run_with_its_outputs_written() {
    let folder = tempfile::tempdir().unwrap();
    let scene = BREAKING.replace("\"warn\"", "\"stop\"");
    write(folder.path(), "bar.toml", &scene);
    let output = bondline(folder.path())
        .args(["run", "bar.toml"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("edge of the nonlocal zone at t ="), "{said}");
    let times = column(&folder.path().join("out/bar_history.csv"), "time");
    assert!(*times.last().unwrap() < 59.0);
    let pvd = std::fs::read_to_string(folder.path().join("out/bar.pvd")).unwrap();
    let last = format!("{:e}", times.last().unwrap());
    assert!(pvd.contains(&last), "{last} is not in {pvd}");
}

#[test]
fn checkpoints_of_another_scene_and_damaged_ones_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", BREAKING);
    run(
        folder.path(),
        &[
            "bar.toml",
            "--set",
            "solve.explicit.duration=6",
            "--checkpoint-every",
            "5",
        ],
    );
    let refused = |arguments: &[&str]| -> String {
        let output = bondline(folder.path())
            .args(["run", "bar.toml", "--resume"])
            .args(arguments)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        said.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let said = refused(&[]);
    assert!(said.contains("another scene or mesh"), "{said}");
    let same_scene = ["--set", "solve.explicit.duration=6"];
    // what changes no result does not matter
    run(
        folder.path(),
        &[
            &[
                "bar.toml",
                "--resume",
                "--set",
                "title=\"again\"",
                "--checkpoint-every",
                "9",
            ],
            &same_scene[..],
        ]
        .concat(),
    );
    let checkpoint = folder.path().join("out/bar.checkpoint");
    let whole = std::fs::read(&checkpoint).unwrap();
    std::fs::remove_file(folder.path().join("out/bar.checkpoint.previous")).unwrap();
    for (bytes, what) in [
        (whole[..whole.len() / 2].to_vec(), "is cut off"),
        (b"something else".to_vec(), "is no checkpoint of bondline"),
        ([&whole[..8], &[9], &whole[9..]].concat(), "has format 9"),
        (
            whole
                .iter()
                .enumerate()
                .map(|(i, b)| b ^ u8::from(i == 200))
                .collect(),
            "is damaged",
        ),
    ] {
        std::fs::write(&checkpoint, bytes).unwrap();
        let said = refused(&same_scene);
        assert!(said.contains(what), "{what}: {said}");
        assert!(said.contains("without --resume"), "{said}");
    }
    // without the history that it continues
    std::fs::write(&checkpoint, &whole).unwrap();
    std::fs::write(folder.path().join("out/bar_history.csv"), "step\n").unwrap();
    let said = refused(&same_scene);
    assert!(said.contains("its checkpoint knows of"), "{said}");
}

/// A bar of 40 linear elements held at its left end, from its first mode at rest.
const MODE: &str = r#"
kinematics = "bar"
coupling = "local"
[mesh.line]
min = 0
max = 1
x = { cells = 40 }
[materials.bar.lps]
youngs-modulus = 4
poisson-ratio = 0
density = 1
[solve.explicit]
duration = 5
outputs = 2
[initial.mode.displacement]
x = "0.01 * sin(pi * x / 2)"
[conditions.left.displacement]
on = "left"
x = 0
[output]
probes.end = { at = 1 }
"#;

#[test]
fn a_vibrating_bar_keeps_the_frequency_of_its_scheme() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", MODE);
    let said = run(folder.path(), &["bar.toml", "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
    let motion = &summary["motion"];
    let dt = motion["step"].as_f64().unwrap();
    // c = 2, h = 1/40: lumped masses give the limit h/c, of which 0.95 less a margin of some per cent is taken
    let share = dt / (1.0 / 80.0);
    assert!((0.90..=0.951).contains(&share), "{share}");
    // lumped masses: ω = 2c/h sin(πh/4L); velocity Verlet: sin(ω'Δt/2) = ωΔt/2
    let h = 1.0 / 40.0;
    let omega = 2.0 * 2.0 / h * (std::f64::consts::PI * h / 4.0).sin();
    let omega = 2.0 / dt * (0.5 * omega * dt).asin();
    let history = folder.path().join("out/bar_history.csv");
    let (times, ends) = (column(&history, "time"), column(&history, "end_ux"));
    assert!(times.len() > 300);
    let error = times
        .iter()
        .zip(&ends)
        .map(|(t, u)| (u - 0.01 * (omega * t).cos()).abs())
        .fold(0.0, f64::max);
    assert!(error < 1e-12, "{error}");
    let energy = column(&history, "discrete_energy");
    let drift = energy[2..]
        .iter()
        .map(|e| (e / energy[1] - 1.0).abs())
        .fold(0.0, f64::max);
    assert!(drift < 1e-12, "{drift}");
}

#[test]
fn a_prescribed_velocity_is_the_derivative_of_its_displacement() {
    let folder = tempfile::tempdir().unwrap();
    let free = MODE
        .replace(
            "[initial.mode.displacement]\nx = \"0.01 * sin(pi * x / 2)\"",
            "",
        )
        .replace("duration = 5", "duration = 1");
    let ends = |name: &str, condition: &str| {
        let scene = free.replace(
            "[conditions.left.displacement]\non = \"left\"\nx = 0",
            condition,
        );
        write(folder.path(), &format!("{name}.toml"), &scene);
        run(folder.path(), &[&format!("{name}.toml")]);
        column(
            &folder.path().join(format!("out/{name}_history.csv")),
            "end_ux",
        )
    };
    let moved = ends(
        "moved",
        "[conditions.left.displacement]\non = \"left\"\nx = \"0.01 * (1 - cos(3 * t))\"",
    );
    let driven = ends(
        "driven",
        "[conditions.left.velocity]\non = \"left\"\nx = \"0.03 * sin(3 * t)\"",
    );
    let steady = ends(
        "steady",
        "[conditions.left.velocity]\non = \"left\"\nx = 0.02",
    );
    assert_eq!(moved.len(), driven.len());
    for (a, b) in moved.iter().zip(&driven) {
        // Simpson's rule over steps of 0.012
        assert!((a - b).abs() < 1e-10, "{a} {b}");
    }
    // the end of a bar that is pushed at 0.02 moves at twice that once the wave has arrived, at t = 0.5
    let last = steady.last().unwrap();
    assert!((last - 0.02).abs() < 4e-4, "{last}");
}

#[test]
fn a_traction_that_varies_in_time_is_that_of_its_factors() {
    let folder = tempfile::tempdir().unwrap();
    // time alone, and time beside a coordinate that changes nothing: two ways through the driver
    let mut found = Vec::new();
    for (name, x) in [
        ("alone", "0.01 * sin(9 * t)"),
        ("both", "0.01 * sin(9 * t) * x"),
    ] {
        let scene = format!("{MODE}[conditions.pulled.traction]\non = \"right\"\nx = \"{x}\"\n");
        write(folder.path(), &format!("{name}.toml"), &scene);
        run(folder.path(), &[&format!("{name}.toml")]);
        found.push(column(
            &folder.path().join(format!("out/{name}_history.csv")),
            "end_ux",
        ));
        let work = column(
            &folder.path().join(format!("out/{name}_history.csv")),
            "external_work",
        );
        assert!(work.iter().any(|w| w.abs() > 1e-6));
    }
    for (a, b) in found[0].iter().zip(&found[1]) {
        assert!((a - b).abs() < 1e-15);
    }
}

fn wrong(scene: &str, from: &str, to: &str) -> SceneError {
    assert!(scene.contains(from), "{from}");
    let source = Source::new("bar.toml", scene.replacen(from, to, 1));
    if let Err(error) = SceneSpec::parse(&source) {
        return error;
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    AnyScene::from_source(&source, folder, "bar").expect_err("this scene is wrong")
}

#[test]
fn every_key_says_what_is_wrong_with_it() {
    use SceneErrorKind::{Choice, Conflict, Dimension, Missing, UnknownKey, WrongType, WrongValue};
    let cases: &[(&str, &str, &str, SceneErrorKind, &str, &str)] = &[
        (
            MODE,
            "duration = 5",
            "duration = -5",
            WrongValue,
            "`solve.explicit.duration` is -5",
            "larger than 0",
        ),
        (
            MODE,
            "duration = 5",
            "",
            Missing,
            "`solve.explicit` lacks `duration`",
            "add `duration",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\ndurations = 2",
            UnknownKey,
            "`durations`",
            "`duration`",
        ),
        (
            MODE,
            "[solve.explicit]",
            "[solve.explicite]",
            UnknownKey,
            "`explicite`",
            "`explicit`",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\nstep = 0",
            WrongValue,
            "`solve.explicit.step` is 0",
            "auto",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\nstep = \"automatic\"",
            WrongValue,
            "automatic",
            "expressions know",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\nstep = true",
            WrongType,
            "solve.explicit.step",
            "auto",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\nstep-fraction = 1.2",
            WrongValue,
            "step-fraction` is 1.2",
            "0.95",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\nbeyond-limit = \"ignore\"",
            UnknownKey,
            "`ignore`",
            "`refuse`",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\noutput-interval = 1",
            Conflict,
            "both `outputs` and `output-interval`",
            "keep one",
        ),
        (
            MODE,
            "outputs = 2",
            "outputs = 1000000",
            WrongValue,
            "VTU files",
            "limit",
        ),
        (
            MODE,
            "outputs = 2",
            "history-interval = 9",
            WrongValue,
            "history-interval` is 9",
            "fraction",
        ),
        (
            MODE,
            "outputs = 2",
            "checkpoint-every = 0",
            WrongValue,
            "`0` is no pace",
            "schema",
        ),
        (
            MODE,
            "outputs = 2",
            "checkpoint-every = \"3 days\"",
            WrongValue,
            "`3 days` is no pace",
            "schema",
        ),
        (
            MODE,
            "density = 1",
            "",
            Missing,
            "the material `bar` has no density",
            "density = ",
        ),
        (
            MODE,
            "sin(pi * x / 2)",
            "sin(t)",
            Conflict,
            "`initial.mode.displacement.x` depends on the time",
            "conditions",
        ),
        (MODE, "sin(pi * x / 2)", "ln(x)", WrongValue, "-inf", "if("),
        (
            MODE,
            "x = 0",
            "y = 0",
            Dimension,
            "`conditions.left.displacement.y`",
            "remove",
        ),
        (
            MODE,
            "[conditions.left.displacement]\non = \"left\"\nx = 0",
            "[conditions.left.velocity]\non = \"left\"\nx = \"x*t\"",
            Conflict,
            "time and on position",
            "integral",
        ),
        (
            MODE,
            "x = 0",
            "x = \"1 / (t - 5)\"",
            WrongValue,
            "t = 5",
            "if(",
        ),
        (
            MODE,
            "[output]",
            "[no-fail.a]\npoint = 0.5\n[output]",
            Conflict,
            "no bond of the material `bar` breaks",
            "fracture-energy",
        ),
        (
            BREAKING,
            "critical-stretch = 0.002",
            "critical-stretch = 0.002\nfracture-energy = 1",
            Choice,
            "at once",
            "keep one",
        ),
        (
            BREAKING,
            "critical-stretch = 0.002",
            "fracture-energy = 0",
            WrongValue,
            "fracture-energy` is 0",
            "larger than 0",
        ),
        (
            BREAKING,
            "critical-stretch = 0.002",
            "",
            Conflict,
            "no bond of the material `plate` breaks",
            "fracture-energy",
        ),
        (
            BREAKING,
            "direction = [0, -1]",
            "direction = [0, 0]",
            WrongValue,
            "`output.tips.notch.direction` is zero",
            "crack runs",
        ),
        (
            BREAKING,
            "threshold = 0.2",
            "threshold = 2",
            WrongValue,
            "threshold` is 2",
            "0.35",
        ),
        (BREAKING, "\"warn\"", "\"go\"", UnknownKey, "`go`", "`stop`"),
        (
            BREAKING,
            "[output]",
            "[contact]\nradius-factor = 1.5\n[output]",
            WrongValue,
            "radius-factor` is 1.5",
            "0.9",
        ),
        (
            BREAKING,
            "[output]",
            "[contact]\nstiffness-factor = 0\n[output]",
            WrongValue,
            "stiffness-factor` is 0",
            "larger",
        ),
        (
            BREAKING,
            "horizon = 1.5",
            "horizon = 1.5\nbonds = \"precise\"",
            UnknownKey,
            "`precise`",
            "`exact`",
        ),
        (
            BREAKING,
            "[conditions.right.displacement]",
            "[conditions.right.velocity]\non = \"left\"\nx = 0\n[conditions.rightmost.displacement]",
            Conflict,
            "`left` and `right`",
            "agree",
        ),
    ];
    for (scene, from, to, kind, message, help) in cases {
        let error = wrong(scene, from, to);
        assert_eq!(error.kind(), *kind, "{to}: {error}");
        assert!(error.message().contains(message), "{to}: {error}");
        let remedy = error.remedy().unwrap_or_default();
        assert!(remedy.contains(help), "{to}: {remedy}");
        let underlined = error.underlined();
        assert!(!underlined.is_empty(), "{to}: {error}");
    }
    // static scenes know neither velocities nor starts
    let still = MODE.replace("[solve.explicit]\nduration = 5\noutputs = 2", "");
    let error = wrong(&still, "density = 1", "density = 1");
    assert!(error.message().contains("does not move"), "{error}");
}

#[test]
fn a_step_beyond_the_limit_is_refused_or_shortened() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", MODE);
    // the limit of lumped masses is h/c = 1/80
    let step = format!("solve.explicit.step={}", 1.02 / 80.0);
    let output = bondline(folder.path())
        .args(["run", "bar.toml", "--set", &step])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains("larger than the stable step"), "{said}");
    assert!(
        !folder.path().join("out").exists(),
        "refused before it starts"
    );
    let said = run(
        folder.path(),
        &[
            "bar.toml",
            "--set",
            &step,
            "--set",
            "solve.explicit.beyond-limit=shorten",
            "--json",
        ],
    );
    let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert!(summary["motion"]["step"].as_f64().unwrap() < 1.0 / 80.0);
    assert!(summary["choices"].to_string().contains("is beyond it"));
}

#[test]
fn check_predicts_the_steps_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", BREAKING);
    let output = bondline(folder.path())
        .args(["check", "bar.toml", "--json"])
        .output()
        .unwrap();
    assert!(output.status.success());
    let predicted: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let said = run(folder.path(), &["bar.toml", "--json"]);
    let measured: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(predicted["sizes"], measured["sizes"]);
    let (p, m) = (&predicted["motion"], &measured["motion"]);
    assert_eq!(p["steps"], m["of_steps"]);
    assert_eq!(p["step"], m["step"]);
    assert!(p["certified_step"].as_f64() <= p["stable_step"].as_f64());
    assert!(p["seconds_per_step"].as_f64().unwrap() > 0.0);
    let bytes = |v: &serde_json::Value| v["peak_memory_bytes"].as_f64().unwrap();
    let ratio = bytes(&predicted) / bytes(&measured);
    assert!((0.7..=1.4).contains(&ratio), "{ratio}");
}

#[test]
fn a_static_scene_has_no_checkpoints() {
    let folder = tempfile::tempdir().unwrap();
    let still = MODE
        .replace("[solve.explicit]\nduration = 5\noutputs = 2", "")
        .replace(
            "[initial.mode.displacement]\nx = \"0.01 * sin(pi * x / 2)\"",
            "",
        );
    write(folder.path(), "bar.toml", &still);
    let output = bondline(folder.path())
        .args(["run", "bar.toml", "--resume"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("static scene"));
    run(folder.path(), &["bar.toml", "--set", "solve=static"]);
}

#[test]
fn load_steps_end_where_the_static_solve_does_by_either_method() {
    let folder = tempfile::tempdir().unwrap();
    // nothing breaks: the loads are a tenth of those of the scene in time
    let still = BREAKING
        .replace(
            "[solve.explicit]\nduration = 60\noutputs = 6\nhistory-interval = 1\n",
            "",
        )
        .replace(" * min(1, t / 8)", "")
        .replace("tips.notch = { direction = [0, -1], threshold = 0.2 }", "")
        .replace("damage-at-edge = \"warn\"\n", "")
        .replace("[no-fail.base]\nbox = { min = [3, 0], max = [9, 1] }\n", "")
        .replace("critical-stretch = 0.002\n", "")
        .replace("[coupling.splice]", "[coupling.truncated]")
        // a body in equilibrium has to be held
        .replace("x = \"-0.004", "y = 0\nx = \"-0.004");
    write(folder.path(), "still.toml", &still);
    run(folder.path(), &["still.toml"]);
    let expected = table(&folder.path().join("out/still_probes.csv")).1[0].clone();
    for method in ["implicit", "relaxation"] {
        let scene = still
            .replace("x = \"-0.004\"", "x = \"-0.004 * t\"")
            .replace("x = \"0.004\"", "x = \"0.004 * t\"");
        let scene = format!(
            "{scene}\n[solve.quasi-static]\nsteps = 4\nmethod = \"{method}\"\ntolerance = 1e-9\n"
        );
        write(folder.path(), "load.toml", &scene);
        let said = run(folder.path(), &["load.toml", "--json"]);
        let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
        let history = folder.path().join("out/load_history.csv");
        let ux = column(&history, "middle_ux");
        assert_eq!(ux.len(), 5);
        for (k, u) in ux.iter().enumerate() {
            let share = k as f64 / 4.0;
            assert!(
                (u - share * expected[2]).abs() < 1e-7 * 0.004,
                "{method}: {u} {expected:?}"
            );
        }
        // pure displacement, linear, a seam with an energy: the work of the supports is what is stored
        let m = &summary["motion"];
        let (work, stored) = (
            m["external_work"].as_f64().unwrap(),
            m["stored_energy"].as_f64().unwrap(),
        );
        assert!(
            (work / stored - 1.0).abs() < 1e-6,
            "{method}: {work} {stored}"
        );
    }
}

#[test]
fn load_steps_break_bonds_and_resume_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = BREAKING
        .replace(
            "[solve.explicit]\nduration = 60\noutputs = 6\nhistory-interval = 1\n",
            "[solve.quasi-static]\nsteps = 8\nmethod = \"implicit\"\n",
        )
        .replace("min(1, t / 8)", "t")
        .replace("0.004", "0.012")
        .replace("x = \"-0.012", "y = 0\nx = \"-0.012");
    write(folder.path(), "load.toml", &scene);
    let every = ["load.toml", "--checkpoint-every", "1"];
    run(
        folder.path(),
        &[&every[..], &["--output", "whole"]].concat(),
    );
    let broken = column(
        &folder.path().join("whole/load_history.csv"),
        "broken_bonds",
    );
    assert!(*broken.last().unwrap() > 0.0, "{broken:?}");
    assert!(broken.windows(2).all(|w| w[0] <= w[1]), "{broken:?}");
    // taken up again from the state after the last step but one
    run(
        folder.path(),
        &[&every[..], &["--output", "again"]].concat(),
    );
    std::fs::remove_file(folder.path().join("again/load.checkpoint")).unwrap();
    run(
        folder.path(),
        &[
            &every[..],
            &["--output", "again", "--resume", "--threads", "1"],
        ]
        .concat(),
    );
    same(&folder.path().join("whole"), &folder.path().join("again"));
}
