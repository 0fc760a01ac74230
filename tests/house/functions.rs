//! Functions by their length, and the reasons of long ones.

use std::fs;
use std::path::{Path, PathBuf};

/// Beginning of a reason.
pub const REASON: &str = "// One function: ";

/// A function.
#[derive(Debug, PartialEq, Eq)]
pub struct Function {
    pub name: String,
    /// Of its `fn`.
    pub line: usize,
    /// From `fn` to the closing brace.
    pub lines: usize,
    /// Reason that it is one function, if that is said above it.
    pub reason: Option<String>,
}

/// The functions of a formatted file: each ends with a brace at the indentation of its `fn`.
pub fn functions(text: &str) -> Vec<Function> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let Some(name) = name(line.trim_start()) else {
            continue;
        };
        let indentation = &line[..line.len() - line.trim_start().len()];
        let body = lines[at..].iter().position(|l| {
            let own = l.strip_prefix(indentation);
            own == Some("}") || own.is_some_and(|own| !own.starts_with(' ') && own.ends_with(';'))
        });
        // without a body, or all on one line
        let Some(last) = body.filter(|last| !lines[at + last].ends_with(';')) else {
            continue;
        };
        let above = lines[..at].iter().rev().map(|l| l.trim());
        let reason = above
            .take_while(|l| !l.is_empty() && !l.ends_with(['{', '}', ';']))
            .find_map(|l| l.strip_prefix(REASON));
        found.push(Function {
            name: name.to_owned(),
            line: at + 1,
            lines: last + 1,
            reason: reason.map(str::to_owned),
        });
    }
    found
}

/// The name of the function that begins with a line, if one does.
fn name(line: &str) -> Option<&str> {
    let mut rest = line;
    if let Some(after) = rest.strip_prefix("pub") {
        rest = match after.strip_prefix('(') {
            Some(path) => path.split_once(')')?.1,
            None => after,
        }
        .strip_prefix(' ')?;
    }
    for word in ["const ", "async ", "unsafe ", "extern \"C\" "] {
        rest = rest.strip_prefix(word).unwrap_or(rest);
    }
    let rest = rest.strip_prefix("fn ")?;
    rest.split(|c: char| !(c.is_alphanumeric() || c == '_'))
        .next()
}

/// All `.rs` files below a folder.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    for entry in entries {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// The functions of sources, tests, examples and benches that have more lines than `most`, with their files.
pub fn longer_than(most: usize) -> Vec<(PathBuf, Function)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths = Vec::new();
    for folder in ["src", "crates", "tests", "examples", "benches"] {
        files(&root.join(folder), &mut paths);
    }
    paths.sort();
    assert!(paths.len() > 300, "{} files", paths.len());
    let mut found = Vec::new();
    for path in paths {
        let text = fs::read_to_string(&path).expect("a source file");
        let long = functions(&text).into_iter().filter(|f| f.lines > most);
        found.extend(long.map(|f| (path.clone(), f)));
    }
    found
}
