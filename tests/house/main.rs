//! The house: a module imports from the floors below it and from nothing else, files need each other in one direction, and neither files nor functions are too long.

mod functions;
mod imports;

use std::fs;
use std::path::{Path, PathBuf};

use imports::{Imports, ItemPath};

/// Modules of the library and, above them, the other crates, the lowest first.
const FLOORS: [&str; 27] = [
    "dimension",
    "tensor",
    "parallel",
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
    "model",
    "contact",
    "coupling",
    "scene",
    "run",
    "predict",
    "petsc",
    "umat",
    "terminal",
    "study",
    "verify",
    "cli",
    "python",
];

/// Crates that stand on the library.
const CRATES: [&str; 7] = [
    "petsc", "umat", "terminal", "study", "verify", "cli", "python",
];

/// Crates that may not take from each other.
const APART: [[&str; 2]; 2] = [["verify", "cli"], ["verify", "python"]];

/// The most lines that a file has.
const MOST_LINES: usize = 600;

/// The same in `src/coupling`, whose files a new coupling starts from.
const MOST_LINES_OF_A_COUPLING: usize = 400;

/// The most lines of a function without a reason above it, from `fn` to its closing brace.
const MOST_LINES_OF_A_FUNCTION: usize = 80;

/// The most functions that are longer, each with its reason.
const MOST_LONG_FUNCTIONS: usize = 20;

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

/// Sets of files that need each other.
const CIRCLES: [&[&str]; 0] = [];

/// Names that two public types of the library have, most of them what a scene says beside what is made of it; their number may only fall.
const SHARED_NAMES: [&str; 11] = [
    "Bound",
    "Carried",
    "Explicit",
    "Field",
    "Hardening",
    "Impactor",
    "Peridynamics",
    "Ratio",
    "Reach",
    "Region",
    "Table",
];

/// Returns the folder of the sources of a crate; of the library without a name.
fn folder(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    match name {
        "" => root.join("src"),
        name => root.join(format!("crates/bondline-{name}/src")),
    }
}

fn imports() -> Imports {
    let names = [""].into_iter().chain(CRATES);
    let crates = names.map(|name| {
        let src = folder(name);
        let mut files = Vec::new();
        sources(&src, &mut files);
        (src, name, files)
    });
    let crates: Vec<_> = crates.collect();
    let crates: Vec<_> = crates
        .iter()
        .map(|(src, name, files)| (src.as_path(), *name, files.clone()))
        .collect();
    Imports::read(&crates)
}

#[test]
fn every_crate_is_looked_at() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates");
    let there = fs::read_dir(root).expect("the crates");
    let mut there: Vec<String> = there
        .map(|e| {
            e.expect("an entry")
                .file_name()
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    there.sort();
    let mut known = CRATES.map(|name| format!("bondline-{name}"));
    known.sort();
    assert_eq!(there, known);
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
        if module == &["lib"] {
            continue;
        }
        let own = floor(module).unwrap_or_else(|| panic!("{module:?} has no floor"));
        let above = |m: &ItemPath| {
            let apart = m[0] != module[0]
                && APART.iter().any(|apart| {
                    let mut both = [&m[0], &module[0]].into_iter();
                    both.all(|n| apart.contains(&n.as_str()))
                });
            apart || floor(m).is_some_and(|other| other > own)
        };
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
    let imports = Imports::read(&[(src, "", files.to_vec())]);
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
fn paths_lead_from_crate_to_crate() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(&path, text).expect("a file");
        path
    };
    let library = vec![
        write("src/lib.rs", "pub mod a;\n"),
        write(
            "src/a.rs",
            "pub struct A;\nfn f() { bondline_study::b::g(); }\n",
        ),
    ];
    let study = vec![
        write("study/lib.rs", "pub mod b;\nmod c;\npub use c::C;\n"),
        write(
            "study/b.rs",
            "use bondline::a::A;\npub fn g() -> crate::c::C { todo!() }\n",
        ),
        write("study/c.rs", "pub struct C;\n"),
    ];
    let cli = vec![write(
        "cli/main.rs",
        "use bondline_study::C;\nfn main() { bondline::a::f(); }\n",
    )];
    let (src, of_study, of_cli) = (
        folder.path().join("src"),
        folder.path().join("study"),
        folder.path().join("cli"),
    );
    let imports = Imports::read(&[
        (&src, "", library),
        (&of_study, "study", study),
        (&of_cli, "cli", cli),
    ]);
    let of = |module: &[&str]| {
        let module: ItemPath = module.iter().map(|m| (*m).to_owned()).collect();
        let found = imports.of(&module).into_iter();
        found.map(|m| m.join("/")).collect::<Vec<_>>()
    };
    assert_eq!(of(&["a"]), ["study/b"]);
    assert_eq!(of(&["study", "b"]), ["a", "study/c"]);
    assert_eq!(of(&["cli"]), ["a", "study/c"]);
}

#[test]
fn no_file_is_longer_than_it_should_be() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    for folder in ["src", "crates", "examples"] {
        sources(&root.join(folder), &mut files);
    }
    let most = |path: &Path| match path.starts_with(root.join("src/coupling")) {
        true => MOST_LINES_OF_A_COUPLING,
        false => MOST_LINES,
    };
    let long: Vec<String> = files
        .iter()
        .map(|path| {
            let text = fs::read_to_string(path).expect("a source file");
            (path, text.lines().count())
        })
        .filter(|(path, lines)| *lines > most(path))
        .map(|(path, lines)| format!("{}: {lines}", path.display()))
        .collect();
    assert!(long.is_empty(), "{long:#?}");
}

#[test]
fn a_name_of_a_public_type_means_one_thing() {
    let mut files = Vec::new();
    sources(&folder(""), &mut files);
    let mut names = Vec::new();
    for path in files {
        let text = fs::read_to_string(path).expect("a source file");
        for line in text.lines() {
            let mut words = line.split_whitespace();
            if words.next() == Some("pub")
                && matches!(words.next(), Some("struct" | "enum" | "trait" | "type"))
                && let Some(name) = words.next()
            {
                let end = name.find(|c: char| !c.is_alphanumeric());
                names.push(name[..end.unwrap_or(name.len())].to_owned());
            }
        }
    }
    names.sort();
    let mut shared: Vec<&str> = names
        .windows(2)
        .filter(|pair| pair[0] == pair[1])
        .map(|pair| pair[0].as_str())
        .collect();
    shared.dedup();
    assert_eq!(shared, SHARED_NAMES);
}

#[test]
fn long_functions_are_few_and_say_why() {
    let long = functions::longer_than(MOST_LINES_OF_A_FUNCTION);
    let told = |(path, f): &(PathBuf, functions::Function)| {
        format!(
            "{}:{} {}, {} lines",
            path.display(),
            f.line,
            f.name,
            f.lines
        )
    };
    let unexplained = long.iter().filter(|(_, f)| f.reason.is_none());
    let unexplained: Vec<String> = unexplained.map(told).collect();
    assert!(
        unexplained.is_empty(),
        "over {MOST_LINES_OF_A_FUNCTION} lines without a line `{}...` above: {unexplained:#?}",
        functions::REASON
    );
    let long: Vec<String> = long.iter().map(told).collect();
    assert!(long.len() <= MOST_LONG_FUNCTIONS, "{long:#?}");
}

#[test]
fn functions_are_counted_from_fn_to_brace() {
    let text = "\
trait T {
    /// Without a body.
    fn declared(
        &self,
    ) -> usize;

    // One function: its steps share all they have.
    /// Documented.
    #[inline]
    pub(crate) const unsafe fn long<const D: usize>(
        a: usize,
    ) -> usize {
        let f = |x| {
            x + 1
        };
        f(a)
    }
}

fn short() {
}
";
    let found = functions::functions(text);
    let told: Vec<_> = found
        .iter()
        .map(|f| (f.name.as_str(), f.line, f.lines, f.reason.as_deref()))
        .collect();
    assert_eq!(
        told,
        [
            ("long", 10, 8, Some("its steps share all they have.")),
            ("short", 20, 2, None)
        ]
    );
}
