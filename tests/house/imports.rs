//! Imports of each file of the crates from the others, re-exports followed to the file that defines what is taken.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A module or an item: the names on the way to it.
pub type ItemPath = Vec<String>;

/// The modules of a crate, and what each takes from others.
pub struct Imports {
    /// Text of each module, without comments and tests.
    code: BTreeMap<ItemPath, String>,
    /// Origin of each item that a module exports again.
    exports: BTreeMap<ItemPath, ItemPath>,
    /// Crates beside the library, by what stands before their modules.
    crates: BTreeSet<String>,
}

impl Imports {
    /// Reads the files of crates: folder of the sources, what stands before their modules (nothing for the library), files.
    pub fn read(crates: &[(&Path, &str, Vec<PathBuf>)]) -> Self {
        let mut code = BTreeMap::new();
        let all = crates
            .iter()
            .flat_map(|c| c.2.iter().map(move |f| (c.0, c.1, f)));
        for (src, name, file) in all {
            let inside = file
                .strip_prefix(src)
                .expect("below src")
                .with_extension("");
            let mut module: ItemPath = inside
                .iter()
                .map(|part| part.to_string_lossy().into_owned())
                .collect();
            module.pop_if(|last| last == "mod");
            if !name.is_empty() {
                module
                    .pop_if(|last| last == "lib" || last == "main" && !src.join("lib.rs").exists());
                module.insert(0, name.to_owned());
            }
            let text = fs::read_to_string(file).expect("a source file");
            code.insert(module, without_comments(&text));
        }
        let names = crates.iter().filter(|c| !c.1.is_empty());
        let mut imports = Self {
            code,
            exports: BTreeMap::new(),
            crates: names.map(|c| c.1.to_owned()).collect(),
        };
        let mut exports = BTreeMap::new();
        for (module, code) in &imports.code {
            for (is_export, path) in uses(code) {
                let (path, name) = match path.last().and_then(|l| l.split_once(" as ")) {
                    Some((of, name)) => {
                        let mut path = path.clone();
                        path.pop();
                        path.push(of.trim().to_owned());
                        (path, name.trim().to_owned())
                    }
                    None => (path.clone(), path.last().cloned().unwrap_or_default()),
                };
                if is_export && let Some(from) = imports.absolute(&path, module) {
                    exports.insert([module.clone(), vec![name]].concat(), from);
                }
            }
        }
        imports.exports = exports;
        imports
    }

    /// A path as it stands in a module, from the root of the crate; none if it leads out of it.
    fn absolute(&self, path: &[String], module: &[String]) -> Option<ItemPath> {
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => {
                let own = module.first().filter(|m| self.crates.contains(*m));
                let root: ItemPath = own.into_iter().cloned().collect();
                Some([&root, rest].concat())
            }
            "bondline" => Some(rest.to_vec()),
            other if other.starts_with("bondline_") => {
                let name = other["bondline_".len()..].to_owned();
                Some([&[name], rest].concat())
            }
            "self" => Some([module, rest].concat()),
            "super" => {
                let up = path.iter().take_while(|part| *part == "super").count();
                let base = module.get(..module.len().checked_sub(up)?)?;
                Some([base, &path[up..]].concat())
            }
            _ => {
                let child = [module, std::slice::from_ref(first)].concat();
                (self.code.contains_key(&child)).then(|| [module, path].concat())
            }
        }
    }

    /// The module that defines what a path leads to, and its name there.
    fn definition(&self, path: &[String], depth: usize) -> (ItemPath, Option<String>) {
        let modules = (0..=path.len())
            .rev()
            .find(|k| self.code.contains_key(&path[..*k]));
        let known = modules.unwrap_or(0);
        if let Some(from) = path
            .get(..known + 1)
            .and_then(|export| self.exports.get(export))
            && depth < 8
        {
            return self.definition(&[from, &path[known + 1..]].concat(), depth + 1);
        }
        (path[..known].to_vec(), path.get(known).cloned())
    }

    /// Returns the modules from which a module takes something.
    pub fn of(&self, module: &ItemPath) -> BTreeSet<ItemPath> {
        let code = &self.code[module];
        let mut found = BTreeSet::new();
        let used = uses(code).into_iter().filter(|(exports, _)| !exports);
        let written = used
            .map(|(_, path)| path)
            .chain(inline(&without_uses(code)));
        for mut path in written {
            if let Some(last) = path.last_mut()
                && let Some((of, _)) = last.split_once(" as ")
            {
                *last = of.trim().to_owned();
            }
            let Some(absolute) = self.absolute(&path, module) else {
                continue;
            };
            let (defines, item) = self.definition(&absolute, 0);
            if item.as_deref().is_some_and(|i| i != "self" && i != "*") {
                found.insert(defines);
                continue;
            }
            // the module itself: what is taken stands behind its name
            let name = defines.last().cloned().unwrap_or_default() + "::";
            for (at, _) in code.match_indices(&name) {
                let item = word(&code[at + name.len()..]);
                found.insert(self.definition(&[&defines[..], &[item]].concat(), 0).0);
            }
        }
        found.remove(module);
        found.remove(&ItemPath::new());
        found
    }

    /// Sets of modules that take from each other, directly or by way of others.
    pub fn circles(&self) -> Vec<Vec<String>> {
        let edges: BTreeMap<&ItemPath, BTreeSet<ItemPath>> =
            self.code.keys().map(|m| (m, self.of(m))).collect();
        let reached = |from: &ItemPath| {
            let mut seen: BTreeSet<&ItemPath> = BTreeSet::new();
            let mut open: Vec<&ItemPath> = edges[from].iter().collect();
            while let Some(next) = open.pop() {
                if seen.insert(next) {
                    open.extend(edges.get(next).into_iter().flatten());
                }
            }
            seen
        };
        let reached: BTreeMap<&ItemPath, BTreeSet<&ItemPath>> =
            edges.keys().map(|m| (*m, reached(m))).collect();
        let mut circles: Vec<Vec<String>> = Vec::new();
        for (module, from) in &reached {
            if from.contains(*module) {
                let mates = from.iter().filter(|m| reached[*m].contains(module));
                circles.push(mates.map(|m| m.join("/")).collect());
            }
        }
        circles.sort();
        circles.dedup();
        circles
    }

    /// All modules.
    pub fn modules(&self) -> impl Iterator<Item = &ItemPath> {
        self.code.keys()
    }
}

/// The code of a file without its comments and its module of tests.
fn without_comments(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests {").next();
    let lines = code.unwrap_or_default().lines();
    let lines: Vec<&str> = lines
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect();
    lines.join("\n")
}

fn word(text: &str) -> String {
    text.chars()
        .take_while(|c| c.is_alphanumeric() || *c == '_')
        .collect()
}

/// The paths of all `use` statements, one for each name, and whether they are exported again.
fn uses(code: &str) -> Vec<(bool, ItemPath)> {
    let mut list = Vec::new();
    let mut rest = code;
    while let Some(at) = rest.find("use ") {
        let line = rest[..at].rsplit('\n').next().unwrap_or_default().trim();
        let is_statement = line.is_empty() || (line.starts_with("pub") && line.len() < 30);
        let Some(end) = rest[at..].find(';') else {
            break;
        };
        if is_statement {
            let mut paths = Vec::new();
            expand(&[], &rest[at + 4..at + end], &mut paths);
            list.extend(paths.into_iter().map(|p| (line.starts_with("pub"), p)));
            rest = &rest[at + end..];
        } else {
            rest = &rest[at + 4..];
        }
    }
    list
}

/// The paths of a tree of names, `a::{b, c::{d, e}}`.
fn expand(prefix: &[String], tree: &str, paths: &mut Vec<ItemPath>) {
    let (mut depth, mut begin) = (0, 0);
    let mut parts = Vec::new();
    for (i, c) in tree.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&tree[begin..i]);
                begin = i + 1;
            }
            _ => {}
        }
    }
    parts.push(&tree[begin..]);
    for part in parts.iter().map(|p| p.trim()).filter(|p| !p.is_empty()) {
        let names = |text: &str| -> ItemPath {
            let names = text.split("::").map(|n| n.trim().to_owned());
            names.filter(|n| !n.is_empty()).collect()
        };
        match part.split_once('{') {
            Some((before, inside)) => {
                let inside = inside.trim_end().trim_end_matches('}');
                // what was trimmed may belong to a tree further in
                let missing = inside.matches('{').count() - inside.matches('}').count();
                let inside = inside.to_owned() + &"}".repeat(missing);
                expand(&[prefix, &names(before)].concat(), &inside, paths);
            }
            None => paths.push([prefix, &names(part)].concat()),
        }
    }
}

/// The code without its `use` statements.
fn without_uses(code: &str) -> String {
    let of = |text: &'_ str| {
        let begins = [
            "\nuse ",
            "\npub use ",
            "\npub(crate) use ",
            "\npub(super) use ",
        ];
        begins.iter().filter_map(|b| text.find(b)).min()
    };
    let statements = code.split_inclusive(';');
    let kept = statements.map(|text| &text[..of(text).unwrap_or(text.len())]);
    kept.collect()
}

/// Paths that begin with `crate`, `super` or one of the crates outside of `use` statements.
fn inline(code: &str) -> Vec<ItemPath> {
    let mut list = Vec::new();
    let starts = [
        "crate::",
        "super::",
        "bondline::",
        "bondline_study::",
        "bondline_terminal::",
        "bondline_verify::",
    ];
    for start in starts {
        for (at, _) in code.match_indices(start) {
            let before = code[..at].chars().next_back();
            if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':' || c == '$') {
                continue;
            }
            let text: String = code[at..]
                .chars()
                .take_while(|c| c.is_alphanumeric() || *c == '_' || *c == ':')
                .collect();
            let names = text.split("::").map(str::to_owned);
            list.push(names.filter(|n| !n.is_empty()).collect());
        }
    }
    list
}
