//! Skins on free surfaces and layers between horizons, through the command line.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn fixture(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
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
fn two_lattices_with_a_layer_stretch_as_one() {
    // plane strain: E' = E/(1 − ν²), ν' = ν/(1 − ν)
    let stretch = STRESS * (1.0 - 0.3 * 0.3) / MODULUS;
    let of_one_horizon = [
        "zones.bodies.fine.horizon=0.3",
        "zones.bodies.fine.spacing=0.05",
    ];
    for overrides in [&[][..], &of_one_horizon] {
        let rows = line("layer.toml", "axis", overrides);
        for row in &rows {
            let exact = [stretch * row[0], -0.3 / 0.7 * stretch * row[1]];
            for a in 0..2 {
                let error = (row[2 + a] - exact[a]).abs() / (2.0 * stretch);
                assert!(error < 1e-9, "{overrides:?} {a} {row:?}");
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
}

#[test]
fn bodies_that_cannot_be_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (overrides, wanted) in [
        (&["peridynamics.horizon-change=dual"][..], "truncated"),
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

/// A square of `n` by `n` cells with inner nodes moved by up to 2 % of a cell, in Gmsh 2.2 with the groups `left`, `right` and `body`. Nodes and cells come
/// in an order that depends on `seed`; with the seed 0 row by row.
fn moved_cells(n: usize, seed: u64) -> String {
    let mut state = 3u64;
    let random = |state: &mut u64| {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    };
    let (side, h) = (n + 1, 1.0 / n as f64);
    let mut places = Vec::new();
    for k in 0..side * side {
        let place = [k % side, k / side].map(|i| {
            let by = 0.04 * h * (random(&mut state) - 0.5);
            i as f64 * h + if i == 0 || i == n { 0.0 } else { by }
        });
        places.push(place);
    }
    let order = |count: usize| -> Vec<usize> {
        let mut list: Vec<usize> = (0..count).collect();
        let mut state = seed;
        for k in (1..count).rev().filter(|_| seed > 0) {
            list.swap(k, (random(&mut state) * (k + 1) as f64) as usize);
        }
        list
    };
    let (nodes, cells) = (order(side * side), order(n * n));
    let mut number = vec![0; side * side];
    nodes
        .iter()
        .enumerate()
        .for_each(|(k, &v)| number[v] = k + 1);
    let at = |i: usize, j: usize| number[j * side + i];
    let listed: Vec<String> = nodes
        .iter()
        .enumerate()
        .map(|(k, &v)| format!("{} {} {} 0", k + 1, places[v][0], places[v][1]))
        .collect();
    let mut elements = Vec::new();
    for (group, i) in [(1, 0), (2, n)] {
        elements
            .extend((0..n).map(|j| format!("1 2 {group} {group} {} {}", at(i, j), at(i, j + 1))));
    }
    for c in cells {
        let (i, j) = (c % n, c / n);
        let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        elements.push(format!(
            "3 2 3 3 {}",
            corners.map(|n| n.to_string()).join(" ")
        ));
    }
    let numbered: Vec<String> = elements
        .iter()
        .enumerate()
        .map(|(k, e)| format!("{} {e}", k + 1))
        .collect();
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"left\"\n1 2 \"right\"\n2 3 \"body\"\n$EndPhysicalNames\n\
         $Nodes\n{}\n{}\n$EndNodes\n$Elements\n{}\n{}\n$EndElements\n",
        listed.len(),
        listed.join("\n"),
        numbered.len(),
        numbered.join("\n")
    )
}

/// Points that lie on no lattice have families of many kinds, of which several are the largest: the numbers of nodes and cells may not choose among them.
#[test]
fn the_order_of_nodes_and_cells_changes_no_result() {
    let scene = r#"
        kinematics = "plane-strain"
        mesh.file.path = "m.msh"
        peridynamics = { horizon = 0.15, points = "cells", weights = "plain" }
        zones.nonlocal.box = { min = [0.29, 0.29], max = [0.71, 0.71] }
        coupling = "balanced"
        conditions.held.displacement = { on = "left", x = 0, y = 0 }
        conditions.pulled.traction = { on = "right", x = 1e-3, y = 1e-3 }
        output = { vtu = false, lines.l = { from = [0.013, 0.412], to = [0.987, 0.613], samples = 51 } }
    "#;
    let folder = tempfile::tempdir().unwrap();
    let rows = |law: &str, seed: u64| -> Vec<f64> {
        let law =
            format!("materials.plate.{law} = {{ youngs-modulus = 1, poisson-ratio = 0.3 }}\n");
        std::fs::write(folder.path().join("s.toml"), law + scene).unwrap();
        std::fs::write(folder.path().join("m.msh"), moved_cells(20, seed)).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_bondline"));
        let output = command
            .current_dir(folder.path())
            .args(["run", "s.toml"])
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let text = std::fs::read_to_string(folder.path().join("out/s_l.csv")).unwrap();
        let displacement = |l: &str| -> Vec<f64> {
            l.split(',')
                .skip(2)
                .take(2)
                .map(|v| v.parse().unwrap())
                .collect()
        };
        text.lines().skip(1).flat_map(displacement).collect()
    };
    for law in ["lps", "correspondence"] {
        let straight = rows(law, 0);
        let largest = straight.iter().fold(0.0f64, |m, u| m.max(u.abs()));
        for seed in [1, 2] {
            let other = rows(law, seed);
            let apart = straight.iter().zip(&other).map(|(a, b)| (a - b).abs());
            let apart = apart.fold(0.0, f64::max) / largest;
            assert!(apart < 1e-11, "{law} {seed}: {apart:e}");
        }
    }
}

/// A mesh whose curved surface cuts the lattice: points of the last layer stand for parts of cells, and so do families that reach them. That is the surface, not the lattice.
#[test]
fn what_a_surface_does_to_the_lattice_is_told_of_the_surface() {
    let folder = tempfile::tempdir().unwrap();
    let mesh =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("meshes/quarter_ring.msh");
    let scene = format!(
        r#"
kinematics = "plane-stress"
[mesh.file]
path = {mesh:?}
[materials.body.bond-based]
youngs-modulus = 1
[peridynamics]
horizon = 0.15
points.lattice = {{ spacing = 0.05, origin = [0.013, 0.031] }}
[zones]
nonlocal = {{ ball = {{ center = [1.06, 1.06], radius = 0.6 }} }}
skin = "none"
[coupling.truncated]
[conditions.held.displacement]
on = "left"
x = 0
y = 0
"#
    );
    std::fs::write(folder.path().join("ring.toml"), scene).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_bondline"))
        .args(["check", "ring.toml"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("at free surfaces"), "{said}");
    assert!(!said.contains("among"), "{said}");
    assert!(!said.contains("leave peridynamics"), "{said}");
}

#[test]
fn mpirun_starts_no_copies_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let run = |count: &str| {
        Command::new(env!("CARGO_BIN_EXE_bondline"))
            .args(["run", "examples/coupled_bar.toml", "--output"])
            .arg(folder.path())
            .env("OMPI_COMM_WORLD_SIZE", count)
            .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
            .output()
            .expect("the program starts")
    };
    let refused = run("2");
    let told = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{told}");
    assert!(told.contains("mpirun has started 2 processes"), "{told}");
    assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none());
    assert!(run("1").status.success());
}
