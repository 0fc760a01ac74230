//! The additions of `docs/extending.md`, applied as they stand there to a copy of the sources, built and run.
//!
//! It compiles the library once more, and `cargo test` leaves it out: `cargo test --release --test worked_additions`, as `.ci/run` does.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The name of the program that is built.
const NAME: &str = "bondline-extended";

/// Runs a scene, as `bondline run SCENE --set KEY=VALUE` does: with the library alone, which is all that the page changes.
const PROGRAM: &str = r#"//! Runs a scene with overrides.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().ok_or("a scene")?;
    let overrides: Vec<String> = arguments.collect();
    let scene = bondline::AnyScene::load(std::path::Path::new(&scene), &overrides)?;
    scene.run(&bondline::Silent)?;
    Ok(())
}
"#;

/// The packages of the copied workspace. The program needs the library alone; the others see to it that dependencies have the features with which they are built already.
const PACKAGES: [&str; 4] = [
    "bondline",
    "bondline-study",
    "bondline-terminal",
    "bondline-cli",
];

/// The files of the copy by their paths within it.
type Files = BTreeMap<PathBuf, String>;

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

/// All files below a folder, by their paths from `root` on.
fn read(root: &Path, folder: &Path, files: &mut Files) {
    for entry in fs::read_dir(root.join(folder)).unwrap() {
        let entry = entry.unwrap();
        let path = folder.join(entry.file_name());
        if entry.path().is_dir() {
            read(root, &path, files);
        } else {
            let text = fs::read_to_string(entry.path()).unwrap();
            files.insert(path, text);
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

/// The columns of a CSV file by their names.
fn table(path: &Path) -> BTreeMap<String, Vec<f64>> {
    let text = fs::read_to_string(path).unwrap();
    let header = text.lines().next().unwrap().split(',').map(str::to_owned);
    let rows = rows(path);
    let column = |(k, name): (usize, String)| (name, rows.iter().map(|row| row[k]).collect());
    header.enumerate().map(column).collect()
}

/// Returns the files that the program needs, without tests and suites, and the page of keys, which additions change too.
fn packages(root: &Path) -> Files {
    let mut files = Files::new();
    read(root, Path::new("src"), &mut files);
    let manifest = fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let packages = manifest.find("[workspace.package]").unwrap();
    let (needed, tests) = manifest[packages..]
        .split_once("[dev-dependencies]")
        .unwrap();
    let profiles = &tests[tests.find("[profile.release]").unwrap()..];
    let members = PACKAGES.map(|p| format!("\"crates/{p}\""));
    let members = members[1..].join(", ");
    let manifest = format!("[workspace]\nmembers = [\".\", {members}]\n\n{needed}{profiles}");
    files.insert("Cargo.toml".into(), manifest);
    // optional dependencies, which have to lie where they are named
    for package in ["crates/bondline-petsc", "crates/bondline-umat"] {
        read(root, Path::new(package), &mut files);
    }
    for package in &PACKAGES[1..] {
        let folder = Path::new("crates").join(package);
        read(root, &folder, &mut files);
        let manifest = files.get_mut(&folder.join("Cargo.toml")).unwrap();
        let needed = manifest.split("[dev-dependencies]").next().unwrap();
        *manifest = needed.to_owned();
    }
    let lock = fs::read_to_string(root.join("Cargo.lock")).unwrap();
    files.insert("Cargo.lock".into(), lock);
    // the reference, and the page that the library holds
    for page in ["docs/scene.md", "docs/manual/warnings.md"] {
        let text = fs::read_to_string(root.join(page)).unwrap();
        files.insert(page.into(), text);
    }
    let program = Path::new("src/bin").join(NAME).with_extension("rs");
    files.insert(program, PROGRAM.to_owned());
    files
}

/// Applies the blocks of the page to the copy.
fn apply(page: &str, files: &mut Files) {
    for block in blocks(page) {
        let path = PathBuf::from(block.file);
        match block.language {
            "diff" => {
                let source = files.get_mut(&path).expect(block.file);
                *source = patched(source, &block.text, block.file);
            }
            "rust" | "toml" | "text" => {
                let before = files.insert(path, block.text);
                assert!(before.is_none(), "{} is not new", block.file);
            }
            other => panic!("{other}: {}", block.file),
        }
    }
}

/// Makes a folder hold these files and no other; one that holds its text already is left alone, so that cargo builds nothing twice.
fn write(files: &Files, folder: &Path) {
    let mut found = Files::new();
    fs::create_dir_all(folder).unwrap();
    read(folder, Path::new(""), &mut found);
    for path in found.keys().filter(|path| !files.contains_key(*path)) {
        fs::remove_file(folder.join(path)).unwrap();
    }
    for (path, text) in files.iter().filter(|(p, t)| found.get(*p) != Some(t)) {
        let path = folder.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
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
    // what the last run wrote
    let _ = fs::remove_dir_all(copied.join("out"));
    let mut files = packages(&root);
    apply(&page, &mut files);
    write(&files, &copied);

    let program = build(&copied);
    let run = |scene: &str, overrides: &[&str]| {
        let mut command = Command::new(&program);
        command.arg(scene).args(overrides).current_dir(&copied);
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

    run("hydrostatic.toml", &[]);
    let history = table(&copied.join("out/hydrostatic_history.csv"));
    let thrust = *history["base_reaction_x"].last().unwrap();
    assert!(
        (thrust + 0.5 * 10.0 * 0.75f64.powi(2)).abs() < 1e-9,
        "{thrust}"
    );

    run("mean_stress.toml", &[]);
    let line = table(&copied.join("out/mean_stress_middle.csv"));
    let mean = &line["mean_stress"];
    assert!(mean.iter().all(|m| (m - 10.0).abs() < 1e-7), "{mean:?}");

    run("bond_energy.toml", &[]);
    let history = table(&copied.join("out/bond_energy_history.csv"));
    let broken = history["time"].iter().zip(&history["broken_bonds"]);
    let first = broken.clone().find(|(_, broken)| **broken > 0.0);
    let time = *first.expect("no bond broke").0;
    assert!((time - 2.0).abs() < 0.06, "{time}");

    run("dashpot.toml", &[]);
    let history = table(&copied.join("out/dashpot_history.csv"));
    let [first, last] = ["stored_energy", "dissipated_energy"].map(|name| &history[name]);
    let (begun, left) = (first[0], first.last().unwrap());
    let taken = last.last().unwrap();
    assert!(*left < 1e-3 * begun, "{left} of {begun}");
    assert!((taken / begun - 1.0).abs() < 0.01, "{taken} of {begun}");

    run("wedges.toml", &[]);
    let line = rows(&copied.join("out/wedges_inside.csv"));
    assert_eq!(line.len(), 5);
    for row in &line {
        assert!((row[3] - 1e-3 * row[0]).abs() < 1e-12, "{row:?}");
        assert!(row[4].abs() < 1e-12 && row[5].abs() < 1e-12, "{row:?}");
    }
}
