//! Tables that grow with a run: each row is there as soon as it is known, and a run that goes on cuts off the rows after
//! its checkpoint.

use std::path::{Path, PathBuf};

use super::ObserveError;
use super::csv::{CsvTable, Entry};

/// A table that is made with its first row, or before.
#[derive(Debug)]
pub struct History {
    path: PathBuf,
    header: Vec<String>,
    table: Option<CsvTable>,
}

impl History {
    /// A table of these columns at `path`; what lies there from another run goes.
    ///
    /// # Errors
    /// [`ObserveError::Write`] if an old file cannot be removed.
    pub fn new(path: &Path, header: Vec<String>) -> Result<Self, ObserveError> {
        Self::resumed(path, header, 0)
    }

    /// A table of which the first `bytes` stand; what follows them goes.
    ///
    /// # Errors
    /// [`ObserveError::Write`] if the file cannot be opened or cut, [`ObserveError::Shortened`] if it holds less.
    pub fn resumed(path: &Path, header: Vec<String>, bytes: u64) -> Result<Self, ObserveError> {
        let table = if bytes == 0 {
            match std::fs::remove_file(path) {
                Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                    return Err(ObserveError::Write {
                        path: path.to_path_buf(),
                        source,
                    });
                }
                _ => None,
            }
        } else {
            let columns: Vec<&str> = header.iter().map(String::as_str).collect();
            Some(CsvTable::resume(path, &columns, bytes)?)
        };
        Ok(Self {
            path: path.to_path_buf(),
            header,
            table,
        })
    }

    /// A table of these columns without a file, which takes no rows.
    pub fn unwritten(header: Vec<String>) -> Self {
        Self {
            path: PathBuf::new(),
            header,
            table: None,
        }
    }

    /// The columns.
    pub fn header(&self) -> &[String] {
        &self.header
    }

    /// Path of the table, once it is begun.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns true if the table exists.
    pub fn is_begun(&self) -> bool {
        self.table.is_some()
    }

    /// Makes the table, if it is not there, so that it has its header also where no row follows.
    ///
    /// # Errors
    /// As [`CsvTable::create`].
    pub fn begin(&mut self) -> Result<(), ObserveError> {
        self.begun().map(drop)
    }

    /// Appends a row.
    ///
    /// # Errors
    /// As [`CsvTable::entries`].
    pub fn row(&mut self, entries: &[Entry]) -> Result<(), ObserveError> {
        self.begun()?.entries(entries)
    }

    fn begun(&mut self) -> Result<&mut CsvTable, ObserveError> {
        Ok(match &mut self.table {
            Some(table) => table,
            none => {
                let columns: Vec<&str> = self.header.iter().map(String::as_str).collect();
                none.insert(CsvTable::create(&self.path, &columns)?)
            }
        })
    }

    /// Forces the rows to the disk and returns the length of the file, for a checkpoint.
    ///
    /// # Errors
    /// [`ObserveError::Write`].
    pub fn mark(&self) -> Result<u64, ObserveError> {
        self.table.as_ref().map_or(Ok(0), CsvTable::mark)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Vec<String> {
        vec!["step".to_owned(), "energy".to_owned()]
    }

    #[test]
    fn rows_after_the_mark_go_and_come_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run_history.csv");
        let row = |history: &mut History, k: i64| {
            history.row(&[k.into(), (0.1 * k as f64).into()]).unwrap();
        };
        let mut history = History::new(&path, header()).unwrap();
        assert!(!history.is_begun() && !path.exists());
        assert_eq!(history.mark().unwrap(), 0);
        (0..3).for_each(|k| row(&mut history, k));
        let mark = history.mark().unwrap();
        (3..6).for_each(|k| row(&mut history, k));
        let whole = std::fs::read(&path).unwrap();
        drop(history);
        // killed in the middle of a row
        std::fs::write(&path, &whole[..whole.len() - 4]).unwrap();
        let mut history = History::resumed(&path, header(), mark).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 4);
        (3..6).for_each(|k| row(&mut history, k));
        assert_eq!(std::fs::read(&path).unwrap(), whole);
        drop(history);
        let error = History::resumed(&path, header(), 10_000).unwrap_err();
        assert!(matches!(error, ObserveError::Shortened { .. }), "{error}");
        let history = History::resumed(&path, header(), 0).unwrap();
        assert!(!history.is_begun() && !path.exists());
    }
}
