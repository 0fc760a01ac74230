//! Scenes that suites run by their text, with the rows that they would write.

use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use crate::meshes::scene::Folder;
use bondline::{
    observe::{Observer, csv::Entry, vtu::Snapshot},
    progress::Silent,
    run::{AnyScene, RunOptions},
    scene::Source,
};

/// The name of a table, and one of its rows by columns.
type Named = (String, Vec<(String, f64)>);

/// Rows of a run, by the name of their table.
#[derive(Debug, Default)]
struct Rows(Mutex<Vec<Named>>);

impl Observer for Rows {
    fn wants_files(&self) -> bool {
        false
    }

    fn row(&self, table: &str, columns: &[String], row: &[Entry]) {
        let number = |entry: &Entry| match entry {
            Entry::Real(x) => Some(*x),
            Entry::Integer(n) => Some(*n as f64),
            _ => None,
        };
        let named = columns.iter().zip(row);
        let named = named.filter_map(|(name, entry)| Some((name.clone(), number(entry)?)));
        let mut rows = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        rows.push((table.to_owned(), named.collect()));
    }

    fn snapshot(&self, _snapshot: Snapshot) {}
}

/// The rows of a scene, and what it took.
pub(crate) struct Seen {
    rows: Vec<Named>,
    /// Seconds of wall time.
    pub seconds: f64,
    /// Products with the stiffness, or passes over the bonds, of its solver.
    pub iterations: usize,
}

impl Seen {
    /// Columns of a table.
    pub fn columns<const N: usize>(&self, table: &str, names: [&str; N]) -> Vec<[f64; N]> {
        let rows = self.rows.iter().filter(|(of, _)| of == table);
        let value = |row: &[(String, f64)], name: &str| {
            let found = row.iter().find(|(of, _)| of == name);
            found.map_or(f64::NAN, |(_, x)| *x)
        };
        rows.map(|(_, row)| names.map(|name| value(row, name)))
            .collect()
    }
}

/// Runs a scene by its text; nothing is written.
///
/// # Errors
/// The message of the scene or its run.
pub(crate) fn run_scene(text: &str) -> Result<Seen, String> {
    run_scene_in(text, &[], Path::new(""))
}

/// Runs a scene with keys that are set otherwise, `key=value`, beside the files (name, text) that it names; nothing else is written.
///
/// # Errors
/// The message of the scene or its run.
pub(crate) fn run_scene_with(
    text: &str,
    overrides: &[String],
    files: &[(&str, &str)],
) -> Result<Seen, String> {
    let folder = Folder::with(files)?;
    run_scene_in(text, overrides, folder.path())
}

fn run_scene_in(text: &str, overrides: &[String], directory: &Path) -> Result<Seen, String> {
    let rows = Rows::default();
    let start = Instant::now();
    let mut source = Source::new("scene.toml", text.to_owned());
    for set in overrides {
        source
            .push_override(set)
            .map_err(|e| e.message().to_owned())?;
    }
    let scene = AnyScene::from_source(&source, directory, "scene").map_err(|e| e.to_string())?;
    let options = RunOptions {
        observer: Some(&rows),
        ..RunOptions::default()
    };
    let summary = scene
        .run_with(&options, &Silent)
        .map_err(|e| e.to_string())?;
    let rows = rows.0.into_inner();
    Ok(Seen {
        rows: rows.unwrap_or_else(PoisonError::into_inner),
        seconds: start.elapsed().as_secs_f64(),
        iterations: summary.iterations,
    })
}
