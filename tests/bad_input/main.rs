//! Wrong scenes and wrong meshes, through the binary: each is refused with exit status 1 and a message that names the place,
//! the value and the remedy, and nothing panics.

mod meshes;
mod process;

use std::path::Path;

use assert_cmd::Command;

const SCENE: &str = r#"kinematics = "plane-stress"

[mesh.rectangle]
min = [0, 0]
max = [1, 1]
x = { cells = 20 }
y = { cells = 20 }

[materials.plate.lps]
youngs-modulus = 1e9
poisson-ratio = 0.3

[peridynamics]
horizon = 0.15
points.lattice = { spacing = 0.05 }

[zones.nonlocal]
box = { min = [0.3, 0.3], max = [0.7, 0.7] }

[zones.transition]
around = 0.15

[coupling.splice]

[conditions.held.displacement]
on = "left"
x = 0
y = 0

[conditions.pulled.traction]
on = "right"
x = 1e6

[output]
directory = "out"
"#;

/// A square of 8 × 8 cells in Gmsh 2.2, with the groups `left`, `right` and `body`.
fn mesh() -> String {
    const N: usize = 8;
    let at = |i: usize, j: usize| j * (N + 1) + i + 1;
    let mut nodes = String::new();
    let mut elements = String::new();
    for j in 0..=N {
        for i in 0..=N {
            let (x, y) = (i as f64 / N as f64, j as f64 / N as f64);
            nodes += &format!("{} {x} {y} 0\n", at(i, j));
        }
    }
    let mut count = 0;
    let mut push = |text: String| {
        count += 1;
        elements += &format!("{count} {text}\n");
    };
    for (group, i) in [(1, 0), (2, N)] {
        for j in 0..N {
            push(format!("1 2 {group} {group} {} {}", at(i, j), at(i, j + 1)));
        }
    }
    for j in 0..N {
        for i in 0..N {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            push(format!("3 2 3 3 {a} {b} {c} {d}"));
        }
    }
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"left\"\n1 2 \"right\"\n2 3 \"body\"\n$EndPhysicalNames\n\
         $Nodes\n{}\n{nodes}$EndNodes\n$Elements\n{count}\n{elements}$EndElements\n",
        (N + 1) * (N + 1)
    )
}

/// Replaces each first of a pair, once; it must be there.
fn edit(mut text: String, edits: &[(&str, &str)]) -> String {
    for (from, to) in edits {
        assert!(text.contains(from), "{from} is not in\n{text}");
        text = text.replacen(from, to, 1);
    }
    text
}

/// Runs `bondline run scene.toml` in a folder of its own; returns the exit status and standard error on one line.
fn run(scene: &str, mesh: &str, overrides: &[&str]) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    std::fs::write(folder.path().join("m.msh"), mesh).unwrap();
    run_in(folder.path(), &["run", "scene.toml"], overrides)
}

fn run_in(folder: &Path, arguments: &[&str], overrides: &[&str]) -> (Option<i32>, String) {
    let mut binary = Command::cargo_bin("bondline").unwrap();
    binary
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .args(arguments);
    for set in overrides {
        binary.args(["--set", set]);
    }
    let output = binary.output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(!text.contains("panicked"), "{text}");
    // the report is wrapped: its lines are joined before they are compared
    let words: Vec<&str> = text.split_whitespace().filter(|w| *w != "│").collect();
    (output.status.code(), words.join(" "))
}

/// The run is refused with a message of all `parts`.
fn refused(scene: &str, mesh: &str, overrides: &[&str], parts: &[&str]) {
    let (status, message) = run(scene, mesh, overrides);
    assert_eq!(status, Some(1), "{message}");
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in\n{message}");
    }
}

fn wrong_scene(edits: &[(&str, &str)], overrides: &[&str], parts: &[&str]) {
    refused(&edit(SCENE.to_owned(), edits), &mesh(), overrides, parts);
}

/// The scene on the mesh file.
fn scene_of_mesh() -> String {
    edit(SCENE.to_owned(), ON_FILE)
}

const ON_FILE: &[(&str, &str)] = &[
    (
        "[mesh.rectangle]\nmin = [0, 0]\nmax = [1, 1]\nx = { cells = 20 }\ny = { cells = 20 }\n\n",
        "[mesh.file]\npath = \"m.msh\"\n\n",
    ),
    ("spacing = 0.05", "spacing = 0.125"),
    ("horizon = 0.15", "horizon = 0.375"),
    ("around = 0.15", "around = 0.2"),
];

#[test]
fn a_cutout_does_not_join_a_side() {
    let cutout = "mesh.rectangle.cutouts.top={min=[0.1,0.1],max=[0.2,0.2]}";
    let parts = ["mesh.rectangle.cutouts.top", "the name of a side", "hole"];
    wrong_scene(&[], &[cutout], &parts);
}

#[test]
fn a_traction_acts_on_faces_of_cells() {
    // of the first group, one facet leads across the cells
    let crossed = mesh().replace("1 1 2 1 1 1 10\n", "1 1 2 1 1 1 11\n");
    assert_ne!(crossed, mesh());
    let pulled = [
        (
            "on = \"left\"\nx = 0\ny = 0",
            "on = \"right\"\nx = 0\ny = 0",
        ),
        ("on = \"right\"\nx = 1e6", "on = \"left\"\nx = -1e6"),
    ];
    let scene = edit(scene_of_mesh(), &pulled);
    let parts = [
        "conditions.pulled.traction.on",
        "around (0.062500, 0.062500)",
        "no facet of any cell",
    ];
    refused(&scene, &crossed, &[], &parts);
}

#[test]
fn the_scene_and_the_mesh_are_right() {
    for scene in [SCENE.to_owned(), scene_of_mesh()] {
        let (status, message) = run(&scene, &mesh(), &[]);
        assert_eq!(status, Some(0), "{message}");
    }
}

#[test]
fn a_scene_that_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let (status, message) = run_in(folder.path(), &["run", "none.toml"], &[]);
    assert_eq!(status, Some(1));
    assert!(
        message.contains("cannot read the scene none.toml") && message.contains("bondline new"),
        "{message}"
    );
}

#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_is_full() {
    let full = std::fs::OpenOptions::new()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_bondline"))
        .arg("schema")
        .stdout(full)
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        message.contains("cannot write to standard output") && !message.contains("panicked"),
        "{message}"
    );
}

#[test]
fn misspelt_key() {
    wrong_scene(
        &[("youngs-modulus", "youngs-moduls")],
        &[],
        &[
            "scene.toml:10:1",
            "`youngs-moduls` is not known",
            "did you mean `youngs-modulus`?",
        ],
    );
}

#[test]
fn wrong_sign() {
    wrong_scene(
        &[("1e9", "-1e9")],
        &[],
        &[
            "scene.toml:10:18",
            "`materials.plate.lps.youngs-modulus` is -1000000000",
            "make it larger than 0",
        ],
    );
}

#[test]
fn wrong_unit_ratio() {
    wrong_scene(
        &[("0.3\n", "30\n")],
        &[],
        &[
            "`materials.plate.lps.poisson-ratio` is 30",
            "must lie between -1 and 0.5",
            "use 0.2 to 0.35",
        ],
    );
}

#[test]
fn missing_set() {
    wrong_scene(
        &[(r#"on = "left""#, r#"on = "lft""#)],
        &[],
        &["the mesh has no set `lft`", "did you mean `left`?"],
    );
}

#[test]
fn empty_zone() {
    wrong_scene(
        &[("max = [0.7, 0.7]", "max = [0.31, 0.31]")],
        &[],
        &["`zones.nonlocal` is empty", "move or enlarge it"],
    );
}

#[test]
fn overlapping_zones() {
    wrong_scene(
        &[(
            "around = 0.15",
            "box = { min = [0.5, 0.1], max = [0.9, 0.9] }",
        )],
        &[],
        &[
            "overlaps 32 of the 64 cells",
            "let it enclose the nonlocal zone",
        ],
    );
}

#[test]
fn horizon_below_h() {
    wrong_scene(
        &[("horizon = 0.15", "horizon = 0.02")],
        &[],
        &[
            "`peridynamics.horizon` is 0.02",
            "below the spacing 0.05",
            "three to six spacings",
        ],
    );
}

#[test]
fn horizon_is_h() {
    wrong_scene(
        &[("horizon = 0.15", "horizon = 0.05")],
        &[],
        &["weights is 0", "the horizon over the spacing"],
    );
}

#[test]
fn expression_in_t() {
    wrong_scene(
        &[("x = 1e6", r#"x = "1e6*t""#)],
        &[],
        &[
            "`conditions.pulled.traction.x`",
            "in a static scene",
            "use x, y, z",
        ],
    );
}

#[test]
fn division_by_zero() {
    wrong_scene(
        &[("x = 0\n", "x = \"1/x\"\n")],
        &[],
        &[
            "`conditions.held.displacement.x` is inf at [0.0, 0.0]",
            "if(condition, a, b)",
        ],
    );
}

#[test]
fn no_support() {
    wrong_scene(
        &[(
            "[conditions.held.displacement]\non = \"left\"\nx = 0\ny = 0\n",
            "",
        )],
        &[],
        &["nothing holds the body", "add one"],
    );
}

#[test]
fn held_in_x_only() {
    wrong_scene(
        &[("x = 0\ny = 0\n", "x = 0\n")],
        &[],
        &[
            "the system is singular",
            "sites are free to move",
            "site 0 [0.0",
            "translation along y",
            "prescribe displacements",
        ],
    );
}

#[test]
fn output_is_a_file() {
    wrong_scene(
        &[(r#""out""#, r#""m.msh""#)],
        &[],
        &[
            "cannot create the folder m.msh",
            "choose another output folder",
        ],
    );
}

#[test]
fn output_read_only() {
    wrong_scene(
        &[(r#""out""#, r#""/proc/nothing""#)],
        &[],
        &[
            "cannot create the folder /proc/nothing",
            "choose another output folder",
        ],
    );
}

#[test]
fn crack_outside() {
    wrong_scene(
        &[],
        &["cracks.c.segment={from=[2,2],to=[3,3]}"],
        &[
            "`cracks.c` lies outside the mesh",
            "reaches from [0.0, 0.0] to [1.0, 1.0]",
        ],
    );
}

#[test]
fn crack_in_local() {
    wrong_scene(
        &[],
        &["cracks.c.segment={from=[0.1,0.5],to=[0.5,0.5]}"],
        &[
            "`cracks.c` passes through the local zone at [0.1, 0.5]",
            "enlarge [zones.nonlocal]",
        ],
    );
}

#[test]
fn traction_on_nothing() {
    wrong_scene(
        &[(r#"on = "right""#, r#"on = "rigth""#)],
        &[],
        &["no set `rigth`", "did you mean `right`?"],
    );
}

#[test]
fn traction_inside() {
    wrong_scene(
        &[(
            "on = \"right\"\nx = 1e6",
            "on = \"right\"\nx = \"if(x<0, 1, sqrt(-1))\"",
        )],
        &[],
        &[
            "`conditions.pulled.traction.x` is NaN at [1.0, 0.0]",
            "restrict the",
        ],
    );
}

#[test]
fn void_everywhere() {
    wrong_scene(
        &[],
        &["voids.v.inside.box={min=[-1,-1],max=[2,2]}"],
        &[
            "`voids.v.inside` covers cell 0 at [0.025, 0.025]",
            "enlarge [zones.nonlocal] around the void",
        ],
    );
}

#[test]
fn void_everywhere_nonlocal() {
    wrong_scene(
        &[],
        &[
            "voids.v.inside.box={min=[-1,-1],max=[2,2]}",
            "coupling=nonlocal",
        ],
        &["holds no peridynamic point", "shrink the voids"],
    );
}

#[test]
fn mesh_missing() {
    wrong_scene(
        &[(
            "[mesh.rectangle]\nmin = [0, 0]\nmax = [1, 1]\nx = { cells = 20 }\ny = { cells = 20 }\n\n",
            "[mesh.file]\npath = \"none.msh\"\n\n",
        )],
        &[],
        &["`mesh.file.path`", "none.msh", "check that the file exists"],
    );
    // the scene itself lies in the folder
    wrong_scene(
        &[(
            "[mesh.rectangle]\nmin = [0, 0]\nmax = [1, 1]\nx = { cells = 20 }\ny = { cells = 20 }\n\n",
            "[mesh.file]\npath = \"scenes.toml\"\n\n",
        )],
        &[],
        &["`mesh.file.path`", "did you mean `scene.toml`?"],
    );
}

#[test]
fn mesh_unknown_extension() {
    wrong_scene(
        &[(
            "[mesh.rectangle]\nmin = [0, 0]\nmax = [1, 1]\nx = { cells = 20 }\ny = { cells = 20 }\n\n",
            "[mesh.file]\npath = \"scene.toml\"\n\n",
        )],
        &[],
        &["no reader for this file extension", "use .msh"],
    );
}

#[test]
fn wrong_dimension() {
    wrong_scene(
        &[(r#""plane-stress""#, r#""solid""#)],
        &[],
        &["`mesh.rectangle` is of dimension 2", "use [mesh.box]"],
    );
}

#[test]
fn thin_zone() {
    wrong_scene(
        &[
            ("spacing = 0.05", "spacing = 0.3"),
            ("horizon = 0.15", "horizon = 0.9"),
            (
                "min = [0.3, 0.3], max = [0.7, 0.7]",
                "min = [0.4, 0.4], max = [0.5, 0.5]",
            ),
        ],
        &[],
        &[
            "holds no peridynamic point",
            "spacing 0.3",
            "refine the lattice",
        ],
    );
}

#[test]
fn thin_zone_families() {
    wrong_scene(
        &[(
            "min = [0.3, 0.3], max = [0.7, 0.7]",
            "min = [0.45, 0.3], max = [0.5, 0.7]",
        )],
        &[],
        &[
            "holds no peridynamic point",
            "spacing 0.05",
            "enlarge the zone",
        ],
    );
}

#[test]
fn ps_without_transition() {
    wrong_scene(
        &[
            ("[zones.transition]\naround = 0.15\n", ""),
            ("[coupling.splice]", "[coupling.partial-stress]"),
        ],
        &[],
        &[
            "`partial-stress` needs a transition zone",
            "add [zones.transition]",
        ],
    );
}

#[test]
fn blending_varying() {
    wrong_scene(
        &[
            ("horizon = 0.15", r#"horizon = "0.15+0.01*x""#),
            ("[coupling.splice]", "[coupling.blending]"),
        ],
        &[],
        &[
            "a horizon that varies is not offered",
            "use splice or partial-stress",
        ],
    );
}

#[test]
fn two_methods() {
    wrong_scene(
        &[(
            "[coupling.splice]",
            "[coupling]\nsplice = {}\nblending = {}",
        )],
        &[],
        &["holds `splice`, `blending` at once", "keep exactly one of"],
    );
}

#[test]
fn no_toml() {
    wrong_scene(
        &[("[coupling.splice]", "[coupling.splice")],
        &[],
        &["scene.toml:23:17", "this is not TOML", "a line reads"],
    );
}

#[test]
fn misspelt_override() {
    wrong_scene(
        &[],
        &["peridynamics.horizn=3"],
        &[
            "--set:1:14",
            "`horizn` is not known",
            "did you mean `horizon`?",
        ],
    );
}

#[test]
fn two_conditions_conflict() {
    wrong_scene(
        &[(
            "[output]",
            "[conditions.other.displacement]\non = \"left\"\nx = 1\n\n[output]",
        )],
        &[],
        &[
            "`held` and `other` prescribe the x displacements 0 and 1",
            "let both agree",
        ],
    );
}

#[test]
fn probe_outside() {
    wrong_scene(
        &[],
        &["output.probes.p.at=[5,5]"],
        &[
            "`output.probes.p.at` = [5.0, 5.0] lies outside the mesh",
            "the mesh reaches from",
        ],
    );
}
