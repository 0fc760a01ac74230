//! Provenance of results, by the program: what files say of where they come from.

use super::{BREAKING, bondline, files, run, write};

#[test]
fn results_name_program_and_scene_and_one_file_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        "bar.toml",
        &BREAKING.replace("duration = 60", "duration = 6"),
    );
    let of = |output: &str, more: &[&str]| {
        run(
            folder.path(),
            &[&["bar.toml", "--output", output], more].concat(),
        );
        let text = std::fs::read_to_string(folder.path().join(output).join("bar.run.json"));
        serde_json::from_str::<serde_json::Value>(&text.unwrap()).unwrap()
    };
    let first = of("first", &["--threads", "2"]);
    let version = env!("CARGO_PKG_VERSION");
    assert_eq!(first["version"], version);
    assert_eq!(first["threads"], 2);
    assert_eq!(first["processes"], 1);
    let typed: Vec<&str> = first["command_line"].as_array().unwrap()[1..]
        .iter()
        .map(|word| word.as_str().unwrap())
        .collect();
    assert_eq!(
        typed,
        ["run", "bar.toml", "--output", "first", "--threads", "2"]
    );
    assert!(first["total_seconds"].as_f64().unwrap() > 0.0);
    assert!(!first["timings"].as_array().unwrap().is_empty());
    let listed = first["files"].as_array().unwrap().iter();
    for file in listed.map(|file| file.as_str().unwrap()) {
        assert!(folder.path().join(file).exists(), "{file}");
    }
    // the hash is that of what determines the results, and every VTU has it
    let hash = first["scene_hash"].as_str().unwrap();
    assert_eq!(hash.len(), 16);
    let comment = format!("<!-- bondline {version}, scene {hash} -->");
    for (name, bytes) in files(&folder.path().join("first")) {
        let text = String::from_utf8_lossy(&bytes);
        assert_eq!(text.contains(&comment), name.ends_with(".vtu"), "{name}");
    }
    let again = of("second", &[]);
    assert_eq!(again["scene_hash"], hash);
    super::same(&folder.path().join("first"), &folder.path().join("second"));
    let other = of("third", &["--set", "materials.plate.bond-based.density=2"]);
    assert_ne!(other["scene_hash"], hash);
    // the summary has them too
    let summary = run(folder.path(), &["bar.toml", "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(
        (&summary["version"], &summary["scene_hash"]),
        (&version.into(), &hash.into())
    );
}

#[test]
fn the_version_names_the_commit_that_provenance_names() {
    let folder = tempfile::tempdir().unwrap();
    let said = bondline(folder.path()).arg("--version").output().unwrap();
    let said = String::from_utf8(said.stdout).unwrap();
    write(
        folder.path(),
        "bar.toml",
        &BREAKING.replace("duration = 60", "duration = 1"),
    );
    run(folder.path(), &["bar.toml"]);
    let text = std::fs::read_to_string(folder.path().join("out/bar.run.json")).unwrap();
    let written: serde_json::Value = serde_json::from_str(&text).unwrap();
    let commit = written["commit"].as_str();
    let wanted = format!("bondline {}", env!("CARGO_PKG_VERSION"));
    assert_eq!(
        said.trim(),
        commit.map_or(wanted.clone(), |c| format!("{wanted} ({c})"))
    );
}

#[test]
fn a_resumption_that_is_refused_leaves_it_and_another_folder_is_no_reason() {
    let folder = tempfile::tempdir().unwrap();
    // without a table of outputs, which `--set` then makes
    let typed = BREAKING.replace("duration = 60", "duration = 3");
    let typed = typed.split("[output]").next().unwrap();
    write(folder.path(), "bar.toml", typed);
    run(
        folder.path(),
        &["bar.toml", "--checkpoint-every", "5", "--output", "o"],
    );
    let path = folder.path().join("o/bar.run.json");
    let before = std::fs::read(&path).unwrap();
    let resume = |set: &str| {
        let mut command = bondline(folder.path());
        command.args([
            "run",
            "bar.toml",
            "--resume",
            "--set",
            "output.directory=o",
            "--set",
            set,
        ]);
        command.output().unwrap()
    };
    assert!(
        !resume("materials.plate.bond-based.density=2")
            .status
            .success()
    );
    assert_eq!(std::fs::read(&path).unwrap(), before);
    let resumed = resume("solve.explicit.checkpoint-every=5");
    let said = String::from_utf8_lossy(&resumed.stderr);
    assert!(resumed.status.success(), "{said}");
    assert_ne!(std::fs::read(&path).unwrap(), before);
}
