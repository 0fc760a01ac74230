//! Environment of a run: files that are no files, threads, memory, and terminals that have gone.

use std::path::Path;
use std::process::{Command, Output};

use crate::{SCENE, edit, mesh, scene_of_mesh};

/// Runs `bondline run scene.toml` in a folder by a shell, with what stands before and behind.
fn by_shell(folder: &Path, before: &str, behind: &str) -> (Option<i32>, String) {
    let line = format!("{before} exec \"$0\" run scene.toml {behind}");
    let output: Output = Command::new("timeout")
        .args(["20", "sh", "-c", &line, env!("CARGO_BIN_EXE_bondline")])
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!said.contains("panicked"), "{said}");
    let words: Vec<&str> = said.split_whitespace().filter(|w| *w != "│").collect();
    (output.status.code(), words.join(" "))
}

fn folder_with(scene: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    std::fs::write(folder.path().join("m.msh"), mesh()).unwrap();
    folder
}

#[test]
#[cfg(target_os = "linux")]
fn full_terminals_change_no_exit_status() {
    let wrong = folder_with(&edit(
        SCENE.to_owned(),
        &[("spacing = 0.05", "spacing = -1")],
    ));
    for behind in ["2>/dev/full", "2>&-", ">&- 2>&-"] {
        let (status, said) = by_shell(wrong.path(), "", behind);
        assert_eq!(status, Some(1), "{behind}: {said}");
    }
    let right = folder_with(SCENE);
    let (status, said) = by_shell(right.path(), "", "2>/dev/full");
    assert_eq!(status, Some(0), "{said}");
    let (status, said) = by_shell(right.path(), "", ">/dev/full");
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("cannot write to standard output"), "{said}");
    let (status, _) = by_shell(right.path(), "", ">/dev/full 2>/dev/full");
    assert_eq!(status, Some(1));
}

#[test]
#[cfg(unix)]
fn a_pipe_gets_plain_text() {
    let wrong = edit(SCENE.to_owned(), &[("spacing = 0.05", "spacing = -1")]);
    for (scene, status) in [(SCENE, 0), (wrong.as_str(), 1)] {
        let folder = folder_with(scene);
        for (name, value) in [("TERM", "xterm-256color"), ("TERM", ""), ("CI", "1")] {
            let output = Command::new(env!("CARGO_BIN_EXE_bondline"))
                .args(["run", "scene.toml"])
                .current_dir(folder.path())
                .env_remove("NO_COLOR")
                .env_remove("TERM")
                .env(name, value)
                .output()
                .unwrap();
            assert_eq!(output.status.code(), Some(status), "{name}={value}");
            for stream in [output.stdout, output.stderr] {
                let said = String::from_utf8(stream).unwrap();
                let control = |c: char| c.is_control() && c != '\n';
                assert!(!said.contains(control), "{name}={value}: {said:?}");
            }
        }
    }
}

#[test]
#[cfg(unix)]
fn a_reader_that_leaves_is_no_failure() {
    let folder = folder_with(SCENE);
    // the schema is longer than a pipe holds; a summary is not, and its reader may leave before it is written
    for (command, reader) in [("schema", "head -1"), ("run scene.toml", "true")] {
        let line = format!("{{ \"$0\" {command}; echo $? >&2; }} | {reader}");
        let output = Command::new("sh")
            .args(["-c", &line, env!("CARGO_BIN_EXE_bondline")])
            .current_dir(folder.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(said, "0\n", "{command}");
    }
}

#[test]
fn more_threads_than_cores_can_use_are_asked_for_twice() {
    let folder = folder_with(SCENE);
    let (status, said) = by_shell(folder.path(), "", "--threads 100000");
    assert_eq!(status, Some(1), "{said}");
    for part in ["--threads asks for 100000", "cores", "--oversubscribe"] {
        assert!(said.contains(part), "{said}");
    }
    let (status, said) = by_shell(folder.path(), "RAYON_NUM_THREADS=100000", "");
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("RAYON_NUM_THREADS asks for 100000"), "{said}");
    let cores = std::thread::available_parallelism().unwrap().get();
    let more = format!("--threads {}", 4 * cores + 1);
    assert_eq!(by_shell(folder.path(), "", &more).0, Some(1));
    let twice = format!("{more} --oversubscribe");
    assert_eq!(by_shell(folder.path(), "", &twice).0, Some(0));
}

#[test]
#[cfg(unix)]
fn a_mesh_that_is_no_file_is_refused() {
    let folder = folder_with(&scene_of_mesh());
    let path = folder.path().join("m.msh");
    std::fs::remove_file(&path).unwrap();
    let made = Command::new("mkfifo").arg(&path).status().unwrap();
    assert!(made.success());
    let (status, said) = by_shell(folder.path(), "", "");
    assert_eq!(status, Some(1), "{said}");
    assert!(
        said.contains("m.msh: it is a named pipe, not a file"),
        "{said}"
    );
    std::fs::remove_file(&path).unwrap();
    std::os::unix::fs::symlink("/dev/zero", &path).unwrap();
    let (status, said) = by_shell(folder.path(), "", "");
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("it is a device"), "{said}");
}

#[test]
#[cfg(target_os = "linux")]
fn memory_that_is_exhausted_ends_with_a_status_of_its_own() {
    let scene = edit(
        SCENE.to_owned(),
        &[
            ("x = { cells = 20 }", "x = { cells = 3000 }"),
            ("y = { cells = 20 }", "y = { cells = 3000 }"),
        ],
    );
    let folder = folder_with(&scene);
    let (status, said) = by_shell(folder.path(), "ulimit -v 300000;", "--threads 1");
    assert_eq!(status, Some(4), "{said}");
    for part in [
        "memory is exhausted",
        "more bytes are not there",
        "--memory",
    ] {
        assert!(said.contains(part), "{said}");
    }
    assert!(!said.contains("backtrace"), "{said}");
    // the limit of the program itself
    let (status, said) = by_shell(folder.path(), "", "--threads 1 --memory 300MB");
    assert!(matches!(status, Some(1 | 4)), "{said}");
    assert!(said.contains("memory"), "{said}");
    let (status, said) = by_shell(folder.path(), "", "--memory 300");
    assert_eq!(status, Some(2), "{said}");
}

#[test]
fn blocks_that_end_nowhere_are_refused_without_a_panic() {
    let scene = edit(scene_of_mesh(), &[("m.msh", "m.vtu")]);
    let folder = folder_with(&scene);
    let fixture = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .join("tests/fixtures/wrong_blocks.vtu");
    std::fs::copy(fixture, folder.path().join("m.vtu")).unwrap();
    let (status, said) = by_shell(folder.path(), "", "");
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("m.vtu: line 1: a header of"), "{said}");
}

/// A sum of so many terms is none of a scene's that anyone types by hand, but of one that a program writes.
#[test]
fn long_expressions_are_read_and_longer_ones_refused() {
    let with = |terms: usize| {
        let sum = vec!["1e6/2"; terms].join("+");
        edit(
            SCENE.to_owned(),
            &[("x = 1e6", &format!("x = \"({sum}) / {terms} * 2\""))],
        )
    };
    let (status, said) = by_shell(folder_with(&with(50_000)).path(), "", "--threads 1");
    assert_eq!(status, Some(0), "{said}");
    let (status, said) = by_shell(folder_with(&with(200_000)).path(), "", "");
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("bytes are longer than the"), "{said}");
}

#[test]
fn a_line_with_the_name_of_the_table_of_probes() {
    let lines = "output.lines.probes={from=[0,0.5],to=[1,0.5],samples=3}";
    crate::wrong_scene(
        &[],
        &["output.probes.middle.at=[0.5,0.5]", lines],
        &[
            "the line `output.lines.probes` has the name of the table of all probes",
            "give the line another name",
        ],
    );
    let (status, said) = crate::run(SCENE, &mesh(), &[lines]);
    assert_eq!(status, Some(0), "{said}");
}

/// A table is there whole or not at all: what a reader holds open, or a run that is killed leaves, is the old one.
#[test]
#[cfg(unix)]
fn tables_of_a_scene_at_rest_are_replaced_whole() {
    use std::os::unix::fs::MetadataExt as _;
    let folder = folder_with(SCENE);
    let overrides = [
        "output.lines.across={from=[0,0.5],to=[1,0.5],samples=3}",
        "output.probes.middle.at=[0.5,0.5]",
        "output.vtu=false",
    ];
    let tables = ["across", "probes"].map(|t| folder.path().join(format!("out/scene_{t}.csv")));
    let run = || {
        let (status, said) = crate::run_in(folder.path(), &["run", "scene.toml"], &overrides);
        assert_eq!(status, Some(0), "{said}");
        tables.each_ref().map(|t| {
            let text = std::fs::read_to_string(t).unwrap();
            (std::fs::metadata(t).unwrap().ino(), text)
        })
    };
    // both are held open, so that no number of a file is used again
    let first = run();
    let _open = tables.each_ref().map(|t| std::fs::File::open(t).unwrap());
    for (one, other) in first.iter().zip(run()) {
        assert_eq!(one.1, other.1);
        assert_ne!(one.0, other.0, "written into the file that lay there");
    }
}

/// Checks that `--output` and the warnings of parts that touch nothing are those of the scene even if the first coupling does not hold.
#[test]
fn the_coupling_that_is_taken_in_the_end_writes_where_it_is_told() {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("tests/fixtures");
    let scene = format!(
        "kinematics = 'plane-strain'
mesh.file.path = '{}'
materials.stuff.lps = {{ youngs-modulus = 1, poisson-ratio = 0.1 }}
peridynamics.horizon = 0.2
zones.nonlocal.box = {{ min = [0.8, 0.3], max = [1.33, 0.61] }}
zones.rim = 'mesh'
voids.hole.inside.ball = {{ center = [9, 9], radius = 0.1 }}
conditions.held.displacement = {{ on = 'fixed', x = 0, y = 0 }}
conditions.weight.body-force.x = 1e-3
output.probes.middle.at = [1, 0.5]",
        fixtures.join("plate_41_ascii.msh").display()
    );
    let folder = folder_with(&scene);
    let output = Command::new(env!("CARGO_BIN_EXE_bondline"))
        .args(["run", "scene.toml", "--output", "elsewhere"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let said = [output.stdout, output.stderr].map(|s| String::from_utf8(s).unwrap());
    let said = said.concat();
    for part in [
        "was tried and does not hold",
        "the void `hole` holds no point",
    ] {
        assert!(said.contains(part), "{said}");
    }
    for file in ["scene.vtu", "scene_probes.csv"] {
        assert!(
            folder.path().join("elsewhere").join(file).exists(),
            "{said}"
        );
    }
    assert!(!folder.path().join("out").exists(), "{said}");
}

/// Standard output and error of a run that ends right, on one line.
fn said_by(scene: &str) -> String {
    let folder = folder_with(scene);
    let output = Command::new(env!("CARGO_BIN_EXE_bondline"))
        .args(["run", "scene.toml", "--threads", "1"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let said = [output.stdout, output.stderr].map(|s| String::from_utf8(s).unwrap());
    let said = said.concat();
    assert!(output.status.success(), "{said}");
    said.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A splice a third of a horizon beside a loaded face: the reaction is 7 % too large, the displacements 8 %. It was silent once.
#[test]
fn loads_and_reactions_that_do_not_balance_are_told() {
    let scene = |coupling: &str| {
        format!(
            "kinematics = 'plane-strain'
coupling = '{coupling}'
mesh.rectangle = {{ min = [0, 0], max = [0.75, 0.9], x = {{ cells = 15 }}, y = {{ cells = 18 }} }}
materials.stuff.lps = {{ youngs-modulus = 2e11, poisson-ratio = 0.25 }}
peridynamics.horizon = 0.1508
zones.nonlocal.box = {{ min = [0.25, 0.3], max = [0.68, 0.63] }}
conditions.held.displacement = {{ on = 'left', x = 0, y = 0 }}
conditions.pulled.traction = {{ on = 'right', x = 2e7 }}
output.vtu = false"
        )
    };
    // at rest, and under a load that grows and is taken off again
    let steps = "\nsolve.quasi-static = { duration = 2, steps = 4 }";
    let loaded =
        |coupling: &str| scene(coupling).replace("x = 2e7", "x = '2e7 * min(t, 2 - t)'") + steps;
    for said in [said_by(&scene("splice")), said_by(&loaded("splice"))] {
        for part in [
            "loads and reactions are out of balance by 3.3",
            "couple by truncated",
        ] {
            assert!(said.contains(part), "{said}");
        }
    }
    for said in [said_by(&scene("truncated")), said_by(&loaded("truncated"))] {
        assert!(!said.contains("warning"), "{said}");
    }
}

/// A block of 4 by 4 by 6 spacings with a horizon of 3, all of it peridynamic: five times as soft as the solid that is typed, since all bonds end at surfaces. The
/// proof once said "stress +0.0 %", of a patch in which nothing moved.
#[test]
fn a_body_thinner_than_its_families_is_told() {
    let said = said_by(
        "kinematics = 'solid'
coupling = 'nonlocal'
mesh.box = { min = [0, 0, 0], max = [0.1, 0.1, 0.15], x = { cells = 4 }, y = { cells = 4 }, z = { cells = 6 } }
materials.stuff.bond-based.youngs-modulus = 7.2e10
peridynamics.horizon = 0.075
conditions.held.displacement = { on = 'left', x = 0, y = 0, z = 0 }
conditions.pressed.traction = { on = 'top', y = -7.2e6 }
output.vtu = false",
    );
    for part in ["cannot be predicted", "thinner than two horizons", "skin"] {
        assert!(said.contains(part), "{said}");
    }
}

/// A modulus typed in GPa beside lengths in metres, and one in Pa beside lengths in millimetres.
#[test]
fn constants_in_mixed_units_are_told() {
    let scene = |modulus: &str, energy: &str| {
        format!(
            "kinematics = 'plane-stress'
coupling = 'nonlocal'
mesh.rectangle = {{ min = [0, 0], max = [0.01, 0.01], x = {{ cells = 10 }}, y = {{ cells = 10 }} }}
materials.glass.bond-based = {{ youngs-modulus = {modulus}, fracture-energy = {energy}, softening = 1, density = 2440 }}
peridynamics.horizon = 0.003
solve.explicit = {{ duration = 1e-9, outputs = 1 }}
output.vtu = false"
        )
    };
    for (modulus, energy) in [("72", "9"), ("72e9", "1e-6")] {
        let said = said_by(&scene(modulus, energy));
        assert!(said.contains("bonds break at a stretch of"), "{said}");
        assert!(said.contains("check the units"), "{said}");
    }
    let said = said_by(&scene("72e9", "9"));
    assert!(!said.contains("check the units"), "{said}");
}
