//! The additions of `docs/extending.md`, applied as they stand there to a copy of the sources, built and run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The name of the program that is built.
const NAME: &str = "bondline-extended";

/// The packages of which the program is built, the library first.
const PACKAGES: [&str; 4] = [
    "bondline",
    "bondline-study",
    "bondline-terminal",
    "bondline-cli",
];

/// A fenced block of the page: language, file, text.
struct Block<'a> {
    language: &'a str,
    file: &'a str,
    text: String,
}

fn blocks(page: &str) -> Vec<Block<'_>> {
    let mut found = Vec::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        let Some((language, file)) = line
            .strip_prefix("```")
            .and_then(|header| header.split_once(' '))
        else {
            continue;
        };
        let text: String = lines
            .by_ref()
            .take_while(|l| *l != "```")
            .flat_map(|l| [l, "\n"])
            .collect();
        found.push(Block {
            language,
            file,
            text,
        });
    }
    found
}

/// Applies the hunks of a `diff` block; each is met exactly once.
fn patched(source: &str, hunks: &str, file: &str) -> String {
    let mut result = source.to_owned();
    for hunk in hunks.split("@@\n") {
        let (mut old, mut new) = (String::new(), String::new());
        for line in hunk.lines() {
            let text = line.get(1..).unwrap_or("");
            let kept = line.is_empty() || line.starts_with(' ');
            for (wanted, side) in [('-', &mut old), ('+', &mut new)] {
                if kept || line.starts_with(wanted) {
                    side.push_str(text);
                    side.push('\n');
                }
            }
        }
        assert_eq!(
            result.matches(&old).count(),
            1,
            "{file} does not hold once:\n{old}"
        );
        result = result.replace(&old, &new);
    }
    result
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let (path, name) = entry.map(|e| (e.path(), e.file_name())).unwrap();
        if path.is_dir() {
            copy(&path, &to.join(name));
        } else {
            fs::copy(&path, to.join(name)).unwrap();
        }
    }
}

/// Rows of a CSV file below its header.
fn rows(path: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).unwrap();
    text.lines()
        .skip(1)
        .map(|l| l.split(',').map(|n| n.parse().unwrap()).collect())
        .collect()
}

/// Copies what the program needs, without tests and suites.
fn copy_packages(root: &Path, copied: &Path) {
    for folder in ["src", "crates"] {
        copy(&root.join(folder), &copied.join(folder));
    }
    let manifest = fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let packages = manifest.find("[workspace.package]").unwrap();
    let (needed, tests) = manifest[packages..]
        .split_once("[dev-dependencies]")
        .unwrap();
    let profiles = &tests[tests.find("[profile.release]").unwrap()..];
    let members = PACKAGES.map(|p| format!("\"crates/{p}\""));
    let members = members[1..].join(", ");
    let manifest = format!("[workspace]\nmembers = [\".\", {members}]\n\n{needed}{profiles}");
    fs::write(copied.join("Cargo.toml"), manifest).unwrap();
    for package in &PACKAGES[1..] {
        let path = copied.join("crates").join(package).join("Cargo.toml");
        let manifest = fs::read_to_string(&path).unwrap();
        let needed = manifest.split("[dev-dependencies]").next().unwrap();
        // under another name, so that the program itself is not overwritten
        let renamed = needed.replace("= \"bondline\"", &format!("= \"{NAME}\""));
        fs::write(&path, renamed).unwrap();
    }
    fs::copy(root.join("Cargo.lock"), copied.join("Cargo.lock")).unwrap();
}

/// Applies the blocks of the page to the copy.
fn apply(page: &str, copied: &Path) {
    for block in blocks(page) {
        let path = copied.join(block.file);
        match block.language {
            "diff" => {
                let source = fs::read_to_string(&path).unwrap();
                fs::write(&path, patched(&source, &block.text, block.file)).unwrap();
            }
            "rust" | "toml" | "text" => {
                assert!(!path.exists(), "{} is not new", block.file);
                fs::write(&path, block.text).unwrap();
            }
            other => panic!("{other}: {}", block.file),
        }
    }
}

/// Builds the copy; returns the program.
fn build(copied: &Path) -> PathBuf {
    // the dependencies are those that are built already; the copy itself is not optimised, which is faster
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    let output = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()))
        .args([
            "build",
            "--release",
            "--offline",
            "--workspace",
            "--bin",
            NAME,
        ])
        .args(PACKAGES.map(|p| format!("--config=profile.release.package.{p}.opt-level=0")))
        .arg("--target-dir")
        .arg(target)
        .current_dir(copied)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(!said.contains("warning: unused"), "{said}");

    target.join("release").join(NAME)
}

#[test]
fn the_additions_of_the_page_build_and_run() {
    let root = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let page = fs::read_to_string(root.join("docs/extending.md")).unwrap();
    let copied = Path::new(env!("CARGO_TARGET_TMPDIR")).join("worked_additions");
    let _ = fs::remove_dir_all(&copied);
    copy_packages(&root, &copied);

    apply(&page, &copied);

    let program = build(&copied);
    let run = |scene: &str, overrides: &[&str]| {
        let mut command = Command::new(&program);
        command.arg("run").arg(scene).current_dir(&copied);
        for key in overrides {
            command.args(["--set", key]);
        }
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{scene}: {said}");
    };

    run("wide_splice.toml", &[]);
    let line = rows(&copied.join("out/wide_splice_axis.csv"));
    assert_eq!(line.len(), 21);
    for row in &line {
        assert!((row[1] - 1e-3 * row[0]).abs() < 1e-12, "{row:?}");
    }
    // the last column is the model: the zone is a tenth of the bar, and the seam lies a tenth further out on each side
    let points = line.iter().filter(|row| row[3] == 2.0).count();
    assert!(points >= 2, "{line:?}");

    let end = |overrides: &[&str]| {
        run("corrected.toml", overrides);
        rows(&copied.join("out/corrected_probes.csv"))[0][1]
    };
    let exact = 0.995e-3;
    let corrected = (end(&[]) - exact).abs();
    let plain = (end(&["materials.bar={bond-based={youngs-modulus=1}}"]) - exact).abs();
    assert!(corrected < 0.5 * plain, "{corrected:e} against {plain:e}");

    run("wedges.toml", &[]);
    let line = rows(&copied.join("out/wedges_inside.csv"));
    assert_eq!(line.len(), 5);
    for row in &line {
        assert!((row[3] - 1e-3 * row[0]).abs() < 1e-12, "{row:?}");
        assert!(row[4].abs() < 1e-12 && row[5].abs() < 1e-12, "{row:?}");
    }
}
