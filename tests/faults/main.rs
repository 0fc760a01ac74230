//! Scenes that once gave a wrong answer without a word, by the binary: each gives the right one, is warned of with a number, or is refused.

mod a;
mod advice;
mod any_faces;
mod b;
mod cantilever;
mod dialects;
mod e;
mod f;
mod files;
mod fitted_weights;
mod g_growth;
mod h;
mod i;
mod indefinite;
mod j;
mod k;
mod linear_parts;
mod m;
mod n;
mod o;
mod proof_rows;
mod q;
mod r;
mod s;
mod short_waves;
mod t;
mod u;
mod wide_triangles;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder of its own for one test, with the files that its scene names; removed when dropped.
pub struct Case {
    folder: tempfile::TempDir,
    scene: PathBuf,
}

impl Case {
    /// Writes `text` as the scene.
    pub fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let scene = folder.path().join("scene.toml");
        std::fs::write(&scene, text).expect("the scene is written");
        Self { folder, scene }
    }

    /// Copies a file of `tests/faults/` beside the scene.
    pub fn with_file(self, name: &str) -> Self {
        let from = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
            .join("tests/faults")
            .join(name);
        std::fs::copy(from, self.folder.path().join(name)).expect("the file is copied");
        self
    }

    /// Runs `bondline COMMAND scene.toml ARGUMENTS` in the folder.
    pub fn command(&self, command: &str, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_bondline"))
            .arg(command)
            .arg(&self.scene)
            .args(arguments)
            .current_dir(self.folder.path())
            .output()
            .expect("the program starts")
    }

    /// The summary of `run --json`, or what it wrote to standard error if it failed.
    ///
    /// # Errors
    /// Standard error of a run that failed.
    pub fn run(&self, arguments: &[&str]) -> Result<serde_json::Value, String> {
        let mut all = vec!["--json"];
        all.extend(arguments);
        let output = self.command("run", &all);
        if output.status.success() {
            Ok(serde_json::from_slice(&output.stdout).expect("the summary is JSON"))
        } else {
            Err(String::from_utf8_lossy(&output.stderr).into_owned())
        }
    }

    /// Returns the path of a file of the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A file that the run wrote, by its name within the folder.
    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).expect("the file is there")
    }
}

/// A message without the frame and the line breaks that it has on standard error.
pub fn flat(text: &str) -> String {
    let words = text.split_whitespace().filter(|w| *w != "│" && *w != "×");
    words.collect::<Vec<_>>().join(" ")
}

/// The first number before a per cent sign.
pub fn percent(text: &str) -> f64 {
    let end = text.find(" %").expect("a percentage");
    let start = text[..end].rfind(' ').map_or(0, |at| at + 1);
    text[start..end].parse().expect("a number")
}

#[test]
fn a_uniform_bar_is_fine() {
    let case = Case::new(
        r#"
kinematics = "bar"
[mesh.line]
min = 0
max = 1
x = { cells = 10 }
[materials.m.bond-based]
youngs-modulus = 2
[coupling.local]
[conditions.l.displacement]
on = "left"
x = 0
[conditions.r.traction]
on = "right"
x = 3
"#,
    );
    let summary = case.run(&[]).expect("it runs");
    let force = summary["reactions"][0]["force"][0]
        .as_f64()
        .expect("a number");
    assert!((force + 3.0).abs() < 1e-12, "{force}");
}
