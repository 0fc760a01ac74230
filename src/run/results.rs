//! A solution that a program keeps: fields and tables by name, the summary, files on request.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use super::{AnyScene, RunError, RunOptions};
use crate::observe::csv::Entry;
use crate::observe::summary::RunSummary;
use crate::observe::vtu::{Compression, Field, Snapshot, Values, write_vtu};
use crate::observe::{ObserveError, Observer};
use crate::progress::Progress;
use crate::scene::SceneError;
use crate::scene::build::SceneBuilder;

/// One solution: cells, points and fields, the same that a VTU file shows.
///
/// Nodes of elements, and corners of parts of elements that are cut, come first, then peridynamic points, or the corners of their cells with `output.points = "cells"`. Units are those of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame(Snapshot);

/// A name that a solution does not have.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the solution has no {kind} `{name}`; there are {known}")]
pub struct NoSuchField {
    /// Field, table or column.
    pub kind: &'static str,
    /// Name that was asked for.
    pub name: String,
    /// Names that exist.
    pub known: String,
}

impl NoSuchField {
    fn new<'a>(kind: &'static str, name: &str, known: impl Iterator<Item = &'a str>) -> Self {
        let known: Vec<String> = known.map(|k| format!("`{k}`")).collect();
        Self {
            kind,
            name: name.to_owned(),
            known: match known.is_empty() {
                true => "none".to_owned(),
                false => known.join(", "),
            },
        }
    }
}

/// A field of reals by its name.
fn reals<'a>(fields: &'a [Field], name: &str) -> Result<&'a [f64], NoSuchField> {
    let is_real = |f: &&Field| matches!(f.values, Values::Real(_));
    match fields.iter().find(|f| f.name == name).map(|f| &f.values) {
        Some(Values::Real(values)) => Ok(values),
        _ => {
            let known = fields.iter().filter(is_real).map(|f| f.name.as_str());
            Err(NoSuchField::new("field of reals", name, known))
        }
    }
}

impl Frame {
    /// Positions in the reference configuration, three coordinates each.
    pub fn points(&self) -> &[[f64; 3]] {
        &self.0.points
    }

    /// Time, or what t has reached in load steps; none of a static solution.
    pub fn time(&self) -> Option<f64> {
        self.0.time
    }

    /// A field over points: one number per point, or three of a vector.
    ///
    /// # Errors
    /// [`NoSuchField`], with the names that there are.
    pub fn field(&self, name: &str) -> Result<&[f64], NoSuchField> {
        reals(&self.0.point_fields, name)
    }

    /// A vector of each point.
    ///
    /// # Errors
    /// [`NoSuchField`], also for a field that has no vectors.
    pub fn vectors(&self, name: &str) -> Result<&[[f64; 3]], NoSuchField> {
        let fields = &self.0.point_fields;
        let is_vector = |f: &&Field| f.components == 3;
        let found = fields.iter().filter(is_vector).find(|f| f.name == name);
        match found.map(|f| &f.values) {
            Some(Values::Real(values)) => Ok(values.as_chunks().0),
            _ => {
                let known = fields.iter().filter(is_vector).map(|f| f.name.as_str());
                Err(NoSuchField::new("field of vectors", name, known))
            }
        }
    }

    /// The displacement of each point.
    ///
    /// # Errors
    /// As [`Frame::vectors`]; every run has displacements.
    pub fn displacement(&self) -> Result<&[[f64; 3]], NoSuchField> {
        self.vectors("displacement")
    }

    /// A field over cells, elements and parts of elements that are cut first, then a vertex, or the cell around it, for each peridynamic point: one number per cell, or nine of a tensor, by rows.
    ///
    /// # Errors
    /// As [`Frame::field`].
    pub fn cell_field(&self, name: &str) -> Result<&[f64], NoSuchField> {
        reals(&self.0.cell_fields, name)
    }

    /// Cells, points and all fields.
    pub fn snapshot(&self) -> &Snapshot {
        &self.0
    }

    /// Writes the frame as a VTU file.
    ///
    /// # Errors
    /// [`ObserveError`] if it cannot be written.
    pub fn write_vtu(&self, path: impl AsRef<Path>) -> Result<(), ObserveError> {
        write_vtu(path.as_ref(), &self.0, Compression::Zlib)
    }
}

/// A table of a run, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Its name: `history`, `probes`, that of a line.
    pub name: String,
    /// The names of its columns.
    pub columns: Vec<String>,
    /// Its rows, one entry per column.
    pub rows: Vec<Vec<Entry>>,
}

impl Table {
    /// A column of numbers.
    ///
    /// # Errors
    /// [`NoSuchField`], with the names that there are.
    pub fn column(&self, name: &str) -> Result<Vec<f64>, NoSuchField> {
        let Some(k) = self.columns.iter().position(|c| c == name) else {
            let known = self.columns.iter().map(String::as_str);
            return Err(NoSuchField::new("column", name, known));
        };
        let number = |entry: &Entry| match entry {
            Entry::Real(x) => *x,
            Entry::Integer(n) => *n as f64,
            // no table of a run holds words, but for empty ones of what is not known
            Entry::Text(_) => f64::NAN,
        };
        Ok(self.rows.iter().map(|row| number(&row[k])).collect())
    }
}

/// Results of a run: its solutions, tables and summary.
#[derive(Clone, Debug)]
pub struct Solution {
    /// All but the last.
    earlier: Vec<Frame>,
    last: Frame,
    tables: Vec<Table>,
    summary: RunSummary,
}

impl Solution {
    /// All solutions in order: of a run in time or load steps those that it shows meanwhile, of a static run the one.
    pub fn frames(&self) -> impl Iterator<Item = &Frame> {
        self.earlier.iter().chain([&self.last])
    }

    /// Sizes, choices, energies, forces, warnings.
    pub fn summary(&self) -> &RunSummary {
        &self.summary
    }

    /// A table by its name: `history` of runs in time and load steps, `probes` and the lines of static ones.
    ///
    /// # Errors
    /// [`NoSuchField`], with the names that there are.
    pub fn table(&self, name: &str) -> Result<&Table, NoSuchField> {
        let found = self.tables.iter().find(|t| t.name == name);
        let known = self.tables.iter().map(|t| t.name.as_str());
        found.ok_or_else(|| NoSuchField::new("table", name, known))
    }

    /// A column of the history.
    ///
    /// # Errors
    /// [`NoSuchField`], with the names that there are.
    pub fn history(&self, column: &str) -> Result<Vec<f64>, NoSuchField> {
        self.table("history")?.column(column)
    }
}

impl std::ops::Deref for Solution {
    type Target = Frame;

    /// The last solution.
    fn deref(&self) -> &Frame {
        &self.last
    }
}

/// Keeps what a run shows.
#[derive(Debug, Default)]
struct Kept {
    frames: Mutex<Vec<Frame>>,
    tables: Mutex<Vec<Table>>,
}

impl Observer for Kept {
    fn wants_files(&self) -> bool {
        false
    }

    fn row(&self, table: &str, columns: &[String], row: &[Entry]) {
        let mut tables = self.tables.lock().unwrap_or_else(PoisonError::into_inner);
        match tables.iter_mut().find(|known| known.name == table) {
            Some(known) => known.rows.push(row.to_vec()),
            None => tables.push(Table {
                name: table.to_owned(),
                columns: columns.to_vec(),
                rows: vec![row.to_vec()],
            }),
        }
    }

    fn snapshot(&self, snapshot: Snapshot) {
        let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        frames.push(Frame(snapshot));
    }
}

impl AnyScene {
    /// Runs the scene and keeps its results in memory; no file is written.
    ///
    /// # Errors
    /// [`RunError`], each with place and remedy.
    pub fn solve(self, progress: &dyn Progress) -> Result<Solution, RunError> {
        let kept = Kept::default();
        let options = RunOptions {
            observer: Some(&kept),
            ..RunOptions::default()
        };
        let summary = self.run_with(&options, progress)?;
        let (frames, tables) = (kept.frames.into_inner(), kept.tables.into_inner());
        let mut frames = frames.unwrap_or_else(PoisonError::into_inner);
        Ok(Solution {
            // every run shows its last solution
            last: frames.pop().unwrap_or(Frame(Snapshot::default())),
            earlier: frames,
            tables: tables.unwrap_or_else(PoisonError::into_inner),
            summary,
        })
    }
}

/// Error of a scene that a program made and that gave no solution.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The scene is wrong.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// It is right and could not be run.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl SceneBuilder {
    /// The validated scene, with the checks that a scene file has to pass.
    ///
    /// # Errors
    /// A [`SceneError`] with key, value and remedy.
    pub fn scene(&self) -> Result<AnyScene, SceneError> {
        AnyScene::from_source(&self.source(), self.folder(), self.name())
    }

    /// Validates and runs the scene, and keeps its results in memory.
    ///
    /// # Errors
    /// [`BuildError`].
    pub fn solve(&self, progress: &dyn Progress) -> Result<Solution, BuildError> {
        Ok(self.scene()?.solve(progress)?)
    }
}
