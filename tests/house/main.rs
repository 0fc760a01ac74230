//! The house: a module imports from the floors below it and from nothing else, files need each other in one direction, and none is too long.

mod imports;

use std::fs;
use std::path::{Path, PathBuf};

use imports::{Imports, ItemPath};

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

/// Sets of files that need each other, each within one folder; their number may only fall.
const CIRCLES: [&[&str]; 3] = [
    &[
        "coupling/fit",
        "coupling/lattices",
        "coupling/model",
        "coupling/place",
        "coupling/recovery",
        "coupling/tributary",
    ],
    &[
        "coupling/truncated/feet",
        "coupling/truncated/fit",
        "coupling/truncated/squares",
    ],
    &["scene/choice", "scene/error", "scene/source"],
];

fn imports() -> Imports {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&src, &mut files);
    Imports::read(&src, &files)
}

#[test]
fn no_module_imports_from_a_floor_above() {
    let imports = imports();
    assert!(imports.modules().count() > 200);
    let floor = |module: &ItemPath| {
        let top = &module[0];
        FLOORS.iter().position(|f| f == top)
    };
    let mut climbing = Vec::new();
    for module in imports.modules() {
        if module == &["main"] || module == &["lib"] {
            continue;
        }
        let own = floor(module).unwrap_or_else(|| panic!("{module:?} has no floor"));
        let above = |m: &ItemPath| floor(m).is_some_and(|other| other > own);
        for other in imports.of(module).into_iter().filter(above) {
            climbing.push(format!(
                "{} takes from {}",
                module.join("/"),
                other.join("/")
            ));
        }
    }
    assert!(climbing.is_empty(), "{climbing:#?}");
}

#[test]
fn files_take_from_each_other_in_one_direction() {
    assert_eq!(imports().circles(), CIRCLES);
}

#[test]
fn a_circle_is_found_through_names_that_are_exported_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let src = folder.path();
    let write = |name: &str, text: &str| {
        let path = src.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(&path, text).expect("a file");
        path
    };
    let files = [
        write("a/mod.rs", "mod b;\nmod c;\npub use b::{B, deep::{D}};\n"),
        write(
            "a/b.rs",
            "use crate::{\n    e::{E, f},\n    a::C as Other, // use crate::d;\n};\n",
        ),
        write("a/c.rs", "pub struct C;\nfn f() -> super::B { todo!() }\n"),
        write(
            "d.rs",
            "use crate::a::B;\n#[cfg(test)]\nmod tests {\n    use crate::e::E;\n}\n",
        ),
        write("e.rs", "pub struct E;\n"),
        write("lib.rs", "pub use a::c::C;\n"),
    ];
    // what `a` exports of `c` it exports by way of `a::c`
    fs::write(
        &files[0],
        "mod b;\nmod c;\npub use b::B;\npub use self::c::C;\n",
    )
    .expect("a file");
    let imports = Imports::read(src, &files);
    assert_eq!(imports.circles(), [["a/b", "a/c"]]);
    let of = |module: &[&str]| {
        let module: ItemPath = module.iter().map(|m| (*m).to_owned()).collect();
        let found = imports.of(&module).into_iter();
        found.map(|m| m.join("/")).collect::<Vec<_>>()
    };
    assert_eq!(of(&["a", "b"]), ["a/c", "e"]);
    assert_eq!(of(&["d"]), ["a/b"]);
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
