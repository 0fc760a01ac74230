//! Skins on free surfaces and layers between horizons, through the command line.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures")
        .join(name)
}

fn bondline(scene: &str, folder: &Path, overrides: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bondline"));
    command.arg("run").arg(fixture(scene));
    command.arg("--output").arg(folder);
    for o in overrides {
        command.args(["--set", o]);
    }
    command.output().unwrap()
}

/// The rows of a line of a scene that runs.
fn line(scene: &str, name: &str, overrides: &[&str]) -> Vec<Vec<f64>> {
    let folder = tempfile::tempdir().unwrap();
    let output = bondline(scene, folder.path(), overrides);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{overrides:?}: {said}");
    let stem = scene.trim_end_matches(".toml");
    let text = std::fs::read_to_string(folder.path().join(format!("{stem}_{name}.csv"))).unwrap();
    text.lines()
        .skip(1)
        .map(|l| l.split(',').map(|v| v.parse().unwrap()).collect())
        .collect()
}

const STRESS: f64 = 200e6;
const MODULUS: f64 = 200e9;

#[test]
fn a_bar_in_a_skin_stretches_as_typed() {
    // LPS with m = 3, of which bonds leave the body through the skin; bond-based has a Poisson ratio of 1/4
    let pairwise = "materials.body={bond-based={youngs-modulus=200e9}}";
    for (overrides, ratio) in [(vec![], 0.3), (vec![pairwise], 0.25)] {
        for row in line("skin.toml", "axis", &overrides) {
            let [x, y, z] = [row[0], row[1], row[2]];
            let stretch = STRESS / MODULUS;
            let exact = [stretch * x, -ratio * stretch * y, -ratio * stretch * z];
            for (a, exact) in exact.iter().enumerate() {
                let error = (row[3 + a] - exact).abs() / (1.2 * stretch);
                assert!(error < 1e-9, "{overrides:?} {a} {row:?}");
            }
        }
    }
}

#[test]
fn without_a_skin_it_does_not() {
    let rows = line("skin.toml", "axis", &["coupling=nonlocal"]);
    let stretch = STRESS / MODULUS;
    let worst = rows
        .iter()
        .map(|r| (r[3] - stretch * r[0]).abs() / (1.2 * stretch))
        .fold(0.0, f64::max);
    assert!(worst > 5e-3, "{worst}");
}

#[test]
fn two_horizons_with_a_layer_stretch_as_one() {
    // plane strain: E' = E/(1 − ν²), ν' = ν/(1 − ν)
    let stretch = STRESS * (1.0 - 0.3 * 0.3) / MODULUS;
    let rows = line("layer.toml", "axis", &[]);
    for row in &rows {
        let exact = [stretch * row[0], -0.3 / 0.7 * stretch * row[1]];
        for a in 0..2 {
            let error = (row[2 + a] - exact[a]).abs() / (2.0 * stretch);
            assert!(error < 1e-9, "{a} {row:?}");
        }
    }
    // points on both sides, elements between 0.9 and 1.0 and at the ends
    assert!(rows.iter().any(|r| r[0] < 0.85 && r[7] == 2.0));
    assert!(rows.iter().any(|r| r[0] > 1.05 && r[7] == 2.0));
    assert!(
        rows.iter()
            .any(|r| (r[0] - 0.95).abs() < 1e-9 && r[7] == 0.0)
    );
}

#[test]
fn bodies_that_cannot_be_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (overrides, wanted) in [
        (&["coupling=splice"][..], "truncated"),
        (
            &["zones.bodies.fine.spacing=0.2"][..],
            "zones.bodies.fine.horizon",
        ),
        (
            &["zones.bodies.fine.inside={box={min=[5,5],max=[6,6]}}"][..],
            "is empty",
        ),
        (&["peridynamics.horizon=\"0.3+0.01*x\""][..], "one horizon"),
        (
            &["zones.bodies.fine.inside={everywhere=true}"][..],
            "take every cell",
        ),
    ] {
        let output = bondline("layer.toml", folder.path(), overrides);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{overrides:?}");
        assert!(said.contains(wanted), "{overrides:?}: {said}");
    }
}
