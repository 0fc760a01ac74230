//! User materials with the calling convention of Abaqus' UMAT: routines in C, and in Fortran where there is a compiler, against our own laws and closed forms.
//!
//! A C compiler `cc` has to be there. With BONDLINE_FORTRAN=required so has `gfortran`; otherwise what a routine in Fortran shows is left out where there is none, and said.

mod law;
mod scenes;

use std::path::{Path, PathBuf};
use std::process::Command;

/// A file of this test's folder, or of `umat`.
fn source(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let own = root.join("tests/umat").join(name);
    if own.exists() {
        own
    } else {
        root.join("umat").join(name)
    }
}

/// Compiles a routine with the utilities into `folder`, as docs/umat.md says; none if there is no such compiler.
fn compile(folder: &Path, name: &str, compiler: &str) -> Option<PathBuf> {
    let built = |compiler: &str, arguments: &[&str], sources: &[PathBuf]| {
        let mut command = Command::new(compiler);
        command.args(arguments).args(sources).current_dir(folder);
        let output = command.output().ok()?;
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{command:?}: {said}");
        Some(())
    };
    let include = format!("-I{}", source("ABA_PARAM.INC").parent()?.display());
    let utilities = [source("abaqus_utilities.c")];
    let c = built("cc", &["-c", "-fPIC", "-O1"], &utilities);
    c.expect("a C compiler `cc` has to be there");
    let library = format!("lib{}.so", name.replace('.', "_"));
    let objects = [source(name), folder.join("abaqus_utilities.o")];
    let arguments = ["-shared", "-fPIC", "-O1", &include, "-o", &library];
    built(compiler, &arguments, &objects)?;
    Some(folder.join(library))
}

/// A library in C.
fn in_c(folder: &Path, name: &str) -> PathBuf {
    compile(folder, name, "cc").expect("a C compiler `cc` has to be there")
}

/// The J2 routine in every language that there is a compiler for.
fn j2(folder: &Path) -> Vec<PathBuf> {
    let fortran = compile(folder, "j2.f", "gfortran");
    if fortran.is_none() {
        let is_required = std::env::var("BONDLINE_FORTRAN").is_ok_and(|v| v == "required");
        assert!(!is_required, "gfortran has to be there");
        eprintln!("no gfortran: the routine in Fortran is left out");
    }
    [Some(in_c(folder, "j2.c")), fortran]
        .into_iter()
        .flatten()
        .collect()
}
