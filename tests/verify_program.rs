//! `bondline verify` becomes the program of the suites beside it: arguments, streams, exit status and signals are those of that program.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::process::{Command, Output};

/// Runs a copy of the program from a folder in which `script` is the program of the suites, if there is one.
fn verify(folder: &Path, script: Option<&str>, arguments: &[&str]) -> Output {
    let program = folder.join("bondline");
    fs::copy(env!("CARGO_BIN_EXE_bondline"), &program).unwrap();
    if let Some(script) = script {
        let path = folder.join("bondline-verify");
        fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }
    let mut command = Command::new(program);
    command.arg("verify").args(arguments);
    loop {
        match command.output() {
            // another test forked while the copy was open for writing, and its child holds it until it executes
            Err(e) if e.kind() == std::io::ErrorKind::ExecutableFileBusy => {
                std::thread::sleep(std::time::Duration::from_millis(10));
            }
            output => return output.unwrap(),
        }
    }
}

#[test]
fn arguments_and_exit_status_pass_through() {
    let folder = tempfile::tempdir().unwrap();
    let script = "printf '<%s>' \"$@\"; echo told >&2; exit 7";
    let output = verify(
        folder.path(),
        Some(script),
        &["patch", "--quick", "--help", "-x", "a b"],
    );
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(said, "<patch><--quick><--help><-x><a b>");
    assert_eq!(String::from_utf8_lossy(&output.stderr), "told\n");
    assert_eq!(output.status.code(), Some(7));
}

#[test]
fn a_signal_is_not_hidden() {
    let folder = tempfile::tempdir().unwrap();
    let output = verify(folder.path(), Some("kill -TERM $$"), &["patch"]);
    assert_eq!(output.status.signal(), Some(15), "{:?}", output.status);
}

#[test]
fn where_there_is_none_its_build_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let output = verify(folder.path(), None, &["patch"]);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr);
    let said: Vec<&str> = said.split_whitespace().filter(|w| *w != "│").collect();
    let said = said.join(" ");
    assert!(said.contains("bondline-verify"), "{said}");
    let remedy = "cargo build --release --bin bondline-verify";
    assert!(said.contains(remedy), "{said}");
}
