//! The pages under `docs/` and the sources say the same: keys of the literature resolve, links and paths lead somewhere, scenes in the pages are valid.

use bondline::AnyScene;
use bondline::scene::{SceneSpec, Source};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// All files below `folder` whose names end in one of `endings`.
fn files(folder: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut stack = vec![folder.to_path_buf()];
    while let Some(folder) = stack.pop() {
        let Ok(entries) = fs::read_dir(&folder) else {
            continue;
        };
        for path in entries.map(|e| e.unwrap().path()) {
            if path.is_dir() {
                stack.push(path);
            } else if endings
                .iter()
                .any(|e| path.to_string_lossy().ends_with(&format!(".{e}")))
            {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

fn pages() -> Vec<PathBuf> {
    let mut pages = files(&root().join("docs"), &["md"]);
    pages.extend(["README.md", "CHANGELOG.md", "CONTRIBUTING.md"].map(|p| root().join(p)));
    pages
}

/// Keys such as `[SAND2015-7998]`: letters, four digits, and perhaps a hyphen with a number; also with escaped brackets.
fn keys(text: &str) -> BTreeSet<String> {
    let text = text.replace("\\[", "[").replace("\\]", "]");
    text.split('[')
        .skip(1)
        .filter_map(|rest| rest.split_once(']').map(|(inner, _)| inner))
        .filter(|inner| {
            let letters = inner.chars().take_while(char::is_ascii_alphabetic).count();
            let rest = &inner[letters..];
            let (year, number) = rest.split_once('-').unwrap_or((rest, "0"));
            letters > 1
                && inner.starts_with(|c: char| c.is_ascii_uppercase())
                && year.len() == 4
                && [year, number]
                    .iter()
                    .all(|n| n.chars().all(|c| c.is_ascii_digit()))
        })
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_key_of_the_literature_resolves() {
    let references = fs::read_to_string(root().join("docs/references.md")).unwrap();
    let known: BTreeSet<&str> = references
        .lines()
        .filter_map(|l| l.strip_prefix('[')?.split_once("]: ").map(|(key, _)| key))
        .collect();
    let mut sources = pages();
    for folder in ["src", "crates", "tests", "examples", "benches"] {
        sources.extend(files(&root().join(folder), &["rs", "toml"]));
    }
    let mut used = BTreeSet::new();
    for path in sources {
        for key in keys(&fs::read_to_string(&path).unwrap()) {
            assert!(
                known.contains(key.as_str()),
                "[{key}] in {} is not in docs/references.md",
                path.display()
            );
            used.insert(key);
        }
    }
    // the search finds what is known to be there
    assert!(
        used.contains("SAND2015-7998") && used.contains("Bobaru2009"),
        "{used:?}"
    );
}

/// Targets of `[text](target)` outside of fenced blocks.
fn links(text: &str) -> Vec<&str> {
    text.split("\n```")
        .step_by(2)
        .flat_map(|prose| prose.split("](").skip(1))
        .filter_map(|rest| rest.split_once(')').map(|(target, _)| target))
        .collect()
}

#[test]
fn links_between_pages_lead_somewhere() {
    let mut count = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for link in links(&text) {
            let target = link.split('#').next().unwrap_or_default();
            if target.is_empty() || target.contains("://") {
                continue;
            }
            let path = page.parent().unwrap().join(target);
            assert!(path.exists(), "{link} in {} leads nowhere", page.display());
            count += 1;
        }
    }
    assert!(count > 10, "only {count} links found");
}

/// Folders with which a path in the repository begins.
const FOLDERS: [&str; 7] = [
    "src", "crates", "tests", "examples", "benches", "docs", ".ci",
];

/// Text in backticks, outside of fenced blocks.
fn spans(text: &str) -> impl Iterator<Item = &str> {
    text.split("\n```")
        .step_by(2)
        .flat_map(|prose| prose.split('`').skip(1).step_by(2))
}

/// The path in the repository that a text in backticks is, up to a name in capitals, which stands for any.
fn repository_path(span: &str) -> Option<PathBuf> {
    let is_of_path = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
    let (folder, _) = span.split_once('/')?;
    if !FOLDERS.contains(&folder) || !span.chars().all(is_of_path) {
        return None;
    }
    let is_name = |name: &&str| name.is_empty() || !name.chars().all(|c| c.is_ascii_uppercase());
    Some(span.split('/').take_while(is_name).collect())
}

/// The comment of a module, without `//!`.
fn header(source: &str) -> String {
    let lines = source.lines().filter_map(|l| l.strip_prefix("//!"));
    lines
        .flat_map(|l| [l.strip_prefix(' ').unwrap_or(l), "\n"])
        .collect()
}

/// All sources, with the comments of their modules.
fn headers() -> Vec<(PathBuf, String)> {
    ["src", "crates", "tests", "examples", "benches"]
        .iter()
        .flat_map(|folder| files(&root().join(folder), &["rs"]))
        .map(|path| {
            let source = fs::read_to_string(&path).unwrap();
            (path, header(&source))
        })
        .collect()
}

#[test]
fn paths_in_backticks_are_in_the_repository() {
    // these two tell of what was: a file that they name may have gone since
    let past = ["docs/notes.md", "CHANGELOG.md"].map(|p| root().join(p));
    let mut texts = headers();
    for page in pages().into_iter().filter(|page| !past.contains(page)) {
        let text = fs::read_to_string(&page).unwrap();
        texts.push((page, text));
    }
    let mut count = 0;
    for (file, text) in &texts {
        for path in spans(text).filter_map(repository_path) {
            assert!(
                root().join(&path).exists(),
                "{} in {} is not there",
                path.display(),
                file.display()
            );
            count += 1;
        }
    }
    assert!(count > 100, "only {count} paths found");
}

/// Files and folders in the first column of the tables of a module's comment.
fn rows(header: &str) -> impl Iterator<Item = &str> {
    header
        .lines()
        .filter_map(|line| line.strip_prefix('|')?.split_once('|'))
        .flat_map(|(cell, _)| cell.split('`').skip(1).step_by(2))
        .filter(|name| name.ends_with(".rs") || name.ends_with('/'))
}

#[test]
fn tables_of_modules_name_files_beside_them() {
    let mut count = 0;
    for (file, header) in headers() {
        // a module `x.rs` has its parts in `x/`
        let own = file.with_extension("");
        let folders = [file.parent().unwrap(), own.as_path()];
        for name in rows(&header) {
            assert!(
                folders.iter().any(|folder| folder.join(name).exists()),
                "{name} in the table of {} is not there",
                file.display()
            );
            count += 1;
        }
    }
    assert!(count > 300, "only {count} rows found");
}

/// Fenced blocks of TOML.
fn toml_blocks(page: &str) -> Vec<&str> {
    page.split("\n```toml\n")
        .skip(1)
        .filter_map(|rest| rest.split_once("\n```").map(|(block, _)| block))
        .collect()
}

#[test]
fn scenes_in_the_reference_are_read() {
    let page = fs::read_to_string(root().join("docs/scene.md")).unwrap();
    let blocks = toml_blocks(&page);
    assert!(blocks.len() > 8, "{}", blocks.len());
    let whole: toml::Table = blocks[0].parse().unwrap();
    for block in blocks {
        // a part of a scene takes the place of that part of the whole one
        let mut scene = whole.clone();
        scene.extend(block.parse::<toml::Table>().unwrap());
        let source = Source::new("docs/scene.md", toml::to_string(&scene).unwrap());
        if let Err(error) = SceneSpec::parse(&source) {
            panic!("{error}\nin\n{block}");
        }
    }
    let source = Source::new("docs/scene.md", toml::to_string(&whole).unwrap());
    AnyScene::from_source(&source, &root(), "scene").unwrap();
}

/// Names of all keys and all words that a schema allows.
fn words(schema: &serde_json::Value, found: &mut BTreeSet<String>) {
    match schema {
        serde_json::Value::Object(map) => {
            for (key, value) in map {
                match (key.as_str(), value) {
                    ("properties", serde_json::Value::Object(properties)) => {
                        found.extend(properties.keys().cloned());
                    }
                    ("const", serde_json::Value::String(word)) => {
                        found.insert(word.clone());
                    }
                    ("enum", serde_json::Value::Array(listed)) => {
                        found.extend(listed.iter().filter_map(|w| w.as_str().map(str::to_owned)));
                    }
                    _ => {}
                }
                words(value, found);
            }
        }
        serde_json::Value::Array(list) => list.iter().for_each(|value| words(value, found)),
        _ => {}
    }
}

#[test]
fn the_reference_names_every_key_of_the_schema() {
    let page = fs::read_to_string(root().join("docs/scene.md")).unwrap();
    let mut known = BTreeSet::new();
    words(
        &serde_json::to_value(bondline::scene::schema()).unwrap(),
        &mut known,
    );
    assert!(
        known.contains("kinematics") && known.contains("plane-stress"),
        "{known:?}"
    );
    let is_named =
        |word: &str| page.contains(&format!("`{word}`")) || page.contains(&format!("`\"{word}\"`"));
    // of keys that are counted, `share-2` to `share-16`, the page names the first and the last
    let is_between = |word: &str| {
        let counted = word.rsplit_once('-');
        let number = counted.and_then(|(stem, n)| Some((stem, n.parse::<u32>().ok()?)));
        number.is_some_and(|(stem, n)| {
            let later = (n + 1..100).any(|n| is_named(&format!("{stem}-{n}")));
            later && is_named(&format!("{stem}-2"))
        })
    };
    // codes of warnings have a page of their own
    let is_code = |word: &str| word.parse::<bondline::observe::warning::Code>().is_ok();
    let missing: Vec<&String> = known
        .iter()
        .filter(|word| !is_code(word))
        .filter(|word| !is_named(word) && !is_between(word))
        .collect();
    assert!(missing.is_empty(), "not in docs/scene.md: {missing:?}");
}
