//! Names the commit that the program is built from, where it is built from a clone of its own repository.

use std::path::Path;
use std::process::Command;

/// Standard output of git, where it succeeds.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// The commit, `-modified` where sources were changed since.
fn commit() -> Option<String> {
    // a copy of the package may lie in the repository of something else
    git(&["ls-files", "--error-unmatch", "build.rs"])?;
    let commit = git(&["rev-parse", "--short=12", "HEAD"])?;
    let changed = git(&["diff", "HEAD", "--name-only", "--", SOURCES[0], SOURCES[1]])?;
    let modified = if changed.is_empty() { "" } else { "-modified" };
    Some(commit + modified)
}

/// What the program is made of.
const SOURCES: [&str; 2] = ["../../src", "../../crates"];

fn main() {
    let version = std::env::var("CARGO_PKG_VERSION").expect("by cargo");
    match commit() {
        Some(commit) => {
            println!("cargo:rustc-env=BONDLINE_COMMIT={commit}");
            println!("cargo:rustc-env=BONDLINE_VERSION={version} ({commit})");
        }
        None => println!("cargo:rustc-env=BONDLINE_VERSION={version}"),
    }
    let heads = ["HEAD", "logs/HEAD"].map(|file| git(&["rev-parse", "--git-path", file]));
    let watched = heads.into_iter().flatten();
    for path in watched.chain(SOURCES.map(str::to_owned)) {
        // one that is missing would have this run in each build
        if Path::new(&path).exists() {
            println!("cargo:rerun-if-changed={path}");
        }
    }
}
