//! Names the commit that the program is built from, where it is built from a clone of its own repository.

use std::path::Path;
use std::process::Command;

/// Standard output of git, where it succeeds.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// The commit, `-modified` where tracked sources were changed since; none of a copy that lies in the repository of something else.
fn commit() -> Option<String> {
    let top = Path::new(&git(&["rev-parse", "--show-toplevel"])?).canonicalize();
    if top.ok()? != Path::new(ROOT).canonicalize().ok()? {
        return None;
    }
    let commit = git(&["rev-parse", "--short=12", "HEAD"])?;
    let sources = ["src", "crates", "Cargo.toml", "Cargo.lock"];
    let paths = sources.map(|path| format!("{ROOT}/{path}"));
    let mut arguments = vec!["diff", "HEAD", "--name-only", "--"];
    arguments.extend(paths.iter().map(String::as_str));
    let modified = if git(&arguments)?.is_empty() {
        ""
    } else {
        "-modified"
    };
    Some(commit + modified)
}

/// The folder of the workspace.
const ROOT: &str = "../..";

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
    let mut watched: Vec<String> = heads.into_iter().flatten().collect();
    watched.extend(["src", "Cargo.toml", "Cargo.lock"].map(|path| format!("{ROOT}/{path}")));
    let packages = std::fs::read_dir(format!("{ROOT}/crates"))
        .into_iter()
        .flatten();
    let packages = packages.flatten().map(|package| package.path());
    watched.extend(packages.map(|package| package.join("src").display().to_string()));
    for path in watched {
        // one that is missing would have this run in each build
        if Path::new(&path).exists() {
            println!("cargo:rerun-if-changed={path}");
        }
    }
}
