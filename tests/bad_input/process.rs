//! What surrounds a run: files that are no files, threads, memory, and terminals that have gone.

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
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/wrong_blocks.vtu");
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
