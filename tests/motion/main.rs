//! Scenes in time, by the binary: against closed forms, across kills and threads, and with every key wrong once.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

mod cauchy_born;
mod contact;
mod continuum_damage;
mod driven;
mod ductile;
mod faults;
mod follow;
mod growth;
mod hyperelastic;
mod impact;
mod indefinite;
mod keys;
mod laws;
mod load_steps;
mod neighbours;
mod parts;
mod plasticity;
mod position_aware;
mod position_aware_seams;
mod provenance;
mod restarts;
mod scalar_damage;
mod softening;
mod softening_bonds;
mod sub_steps;
mod truncated_families;
mod viscoelastic;

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
sections.cut = { point = [6, 3], normal = [1, 0] }
tips.notch = { direction = [0, -1], threshold = 0.2 }
lines.through = { from = [1, 2], to = [11, 2], samples = 7 }
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

/// All files of a folder with their bytes; the checkpoint but one is where it was killed last, and provenance has times: both are left out.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| {
            ![".previous", ".run.json"]
                .iter()
                .any(|end| p.to_string_lossy().ends_with(end))
        })
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

/// Runs a scene, `bar.toml`, at once and from its last checkpoint but one, with the same bytes; the folder of the first run.
fn resumes_with_the_same_bytes(typed: &str) -> tempfile::TempDir {
    let (whole, parts) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    for folder in [whole.path(), parts.path()] {
        write(folder, "bar.toml", typed);
        run(folder, &["bar.toml"]);
    }
    let files = std::fs::read_dir(parts.path().join("out")).unwrap();
    let mut files = files.map(|e| e.unwrap().path());
    let previous = files.find(|p| p.to_string_lossy().ends_with(".previous"));
    let previous = previous.expect("two checkpoints");
    std::fs::rename(&previous, previous.with_extension("")).unwrap();
    let said = run(parts.path(), &["bar.toml", "--resume"]);
    assert!(said.contains("resumed after step"), "{said}");
    same(&whole.path().join("out"), &parts.path().join("out"));
    whole
}

/// Numbers between 0 and 1 (splitmix64), the same in every run.
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
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
