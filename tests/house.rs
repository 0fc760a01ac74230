//! The floors of the source: a module imports from those below it and from nothing else, so that no two of them import each other.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules of `src`, the lowest first.
const FLOORS: [&str; 18] = [
    "tensor",
    "progress",
    "regular_file",
    "system",
    "shape",
    "material",
    "assembly",
    "mesh",
    "solve",
    "fem",
    "peridynamics",
    "observe",
    "coupling",
    "scene",
    "run",
    "study",
    "verify",
    "command",
];

/// The most lines that a file has.
const MOST_LINES: usize = 600;

/// All `.rs` files below a folder, without those of tests.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).expect("the folder is there");
    for entry in entries {
        let path = entry.expect("an entry").path();
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if path.is_dir() {
            sources(&path, found);
        } else if name.ends_with(".rs") && !name.contains("tests") {
            found.push(path);
        }
    }
}

/// The modules at the top of the crate that a text names, without its comments and its tests.
fn named(text: &str) -> Vec<String> {
    let (code, _) = text.split_once("#[cfg(test)]").unwrap_or((text, ""));
    let code: Vec<&str> = code
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect();
    let code = code.join("\n");
    let word = |s: &str| -> String {
        s.trim_start()
            .chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect()
    };
    let mut names = Vec::new();
    for (_, behind) in code
        .match_indices("crate::")
        .map(|(i, m)| (i, &code[i + m.len()..]))
    {
        let Some(list) = behind.strip_prefix('{') else {
            names.push(word(behind));
            continue;
        };
        // names at the first level of `use crate::{a, b::{c, d}}`
        let (mut depth, mut begins) = (1, true);
        for (i, c) in list.char_indices() {
            if depth == 1 && begins && !c.is_whitespace() {
                names.push(word(&list[i..]));
                begins = false;
            }
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 1 => begins = true,
                _ => {}
            }
            if depth == 0 {
                break;
            }
        }
    }
    names.retain(|name| !name.is_empty());
    names
}

#[test]
fn no_module_imports_from_a_floor_above() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&src, &mut files);
    assert!(files.len() > 200, "{}", files.len());
    let floor = |name: &str| FLOORS.iter().position(|f| *f == name);
    let mut climbing = Vec::new();
    for path in &files {
        let inside = path.strip_prefix(&src).expect("below src");
        let top = inside.components().next().expect("a name");
        let top = Path::new(top.as_os_str()).with_extension("");
        let top = top.to_string_lossy();
        if top == "main" || top == "lib" {
            continue;
        }
        let own = floor(&top).unwrap_or_else(|| panic!("{top} has no floor"));
        let text = fs::read_to_string(path).expect("a source file");
        for name in named(&text) {
            // what the crate itself exports is of no floor
            if floor(&name).is_some_and(|other| other > own) {
                climbing.push(format!("{} imports {name}", inside.display()));
            }
        }
    }
    assert!(climbing.is_empty(), "{climbing:#?}");
}

#[test]
fn names_are_found_in_lists_and_paths() {
    let text = "use crate::{\n    mesh::{Mesh, read},\n    tensor::Vector,\n};\nuse crate::fem;\nfn f() { crate::solve::x(); } // crate::scene\n#[cfg(test)]\nuse crate::verify;";
    let mut found = named(text);
    found.sort();
    assert_eq!(found, ["fem", "mesh", "solve", "tensor"]);
}

#[test]
fn no_file_is_longer_than_it_should_be() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    for folder in ["src", "examples"] {
        sources(&root.join(folder), &mut files);
    }
    let long: Vec<String> = files
        .iter()
        .map(|path| {
            let text = fs::read_to_string(path).expect("a source file");
            (path, text.lines().count())
        })
        .filter(|(_, lines)| *lines > MOST_LINES)
        .map(|(path, lines)| format!("{}: {lines}", path.display()))
        .collect();
    assert!(long.is_empty(), "{long:#?}");
}
