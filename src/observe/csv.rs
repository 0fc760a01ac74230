//! Tables of numbers that grow row by row: values along a line, at probes, over steps.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::ObserveError;
use super::atomic_file::{create_parent, write_whole};
use crate::regular_file;

/// One entry of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A real, written with the fewest digits that read back as the same number.
    Real(f64),
    /// An integer.
    Integer(i64),
    /// A word, quoted where it must be.
    Text(String),
}

impl From<f64> for Entry {
    fn from(value: f64) -> Self {
        Self::Real(value)
    }
}

impl From<i64> for Entry {
    fn from(value: i64) -> Self {
        Self::Integer(value)
    }
}

impl From<&str> for Entry {
    fn from(value: &str) -> Self {
        Self::Text(value.to_owned())
    }
}

/// A table that is made with its first row, or before. Each row is on disk as soon as it is known, so that a run can be watched and nothing is lost when it
/// stops; a run that goes on cuts off the rows after its checkpoint.
#[derive(Debug)]
pub struct CsvTable {
    path: PathBuf,
    header: Vec<String>,
    out: Option<BufWriter<File>>,
    rows: usize,
}

impl CsvTable {
    fn of(path: &Path, header: Vec<String>, out: Option<File>) -> Self {
        Self {
            path: path.to_path_buf(),
            header,
            out: out.map(BufWriter::new),
            rows: 0,
        }
    }

    /// Makes the file (and its folder) and writes the header.
    ///
    /// # Errors
    /// [`ObserveError::Empty`] without columns, [`ObserveError::Folder`], [`ObserveError::Write`].
    pub fn create(path: &Path, header: &[&str]) -> Result<Self, ObserveError> {
        let header = header.iter().map(|&h| h.to_owned()).collect();
        let mut table = Self::of(path, header, None);
        table.begin()?;
        Ok(table)
    }

    /// A table of which the first `bytes` stand; what follows them goes.
    ///
    /// # Errors
    /// [`ObserveError::Write`] if the file cannot be removed, opened or cut, [`ObserveError::Shortened`] if it holds less.
    pub fn resumed(path: &Path, header: Vec<String>, bytes: u64) -> Result<Self, ObserveError> {
        if bytes == 0 {
            return match std::fs::remove_file(path) {
                Err(e) if e.kind() != ErrorKind::NotFound => Err(ObserveError::write(path)(e)),
                _ => Ok(Self::of(path, header, None)),
            };
        }
        let fail = ObserveError::write(path);
        let mut file = regular_file::open(path, File::options().write(true)).map_err(&fail)?;
        let found = file.metadata().map_err(&fail)?.len();
        if found < bytes {
            return Err(ObserveError::Shortened {
                path: path.to_path_buf(),
                expected: bytes,
                found,
            });
        }
        file.set_len(bytes).map_err(&fail)?;
        file.seek(SeekFrom::End(0)).map_err(&fail)?;
        Ok(Self::of(path, header, Some(file)))
    }

    /// A table of these columns without a file, which takes no rows.
    pub fn unwritten(header: Vec<String>) -> Self {
        Self::of(Path::new(""), header, None)
    }

    /// Makes the table, if it is not there, so that it has its header also where no row follows.
    ///
    /// # Errors
    /// As [`CsvTable::create`].
    pub fn begin(&mut self) -> Result<(), ObserveError> {
        if self.is_begun() {
            return Ok(());
        }
        has_columns(&self.path, &self.header)?;
        create_parent(&self.path)?;
        let file = regular_file::may_be_written(&self.path)
            .and_then(|()| File::create(&self.path))
            .map_err(ObserveError::write(&self.path))?;
        self.out = Some(BufWriter::new(file));
        self.line(&first_line(&self.header))
    }

    /// Forces all rows to the disk; returns the length of the file, zero before it is begun.
    ///
    /// # Errors
    /// [`ObserveError::Write`].
    pub fn mark(&self) -> Result<u64, ObserveError> {
        let Some(file) = self.out.as_ref().map(BufWriter::get_ref) else {
            return Ok(0);
        };
        file.sync_data()
            .and_then(|()| file.metadata())
            .map(|m| m.len())
            .map_err(ObserveError::write(&self.path))
    }

    /// Appends a row.
    ///
    /// # Errors
    /// As [`CsvTable::create`], [`ObserveError::RowLength`], [`ObserveError::NotFinite`] (the column is named) or [`ObserveError::Write`]; nothing
    /// of the row is then written, except on a full disk.
    pub fn entries(&mut self, entries: &[Entry]) -> Result<(), ObserveError> {
        self.begin()?;
        let line = line_of(&self.path, &self.header, self.rows, entries)?;
        self.line(&line)?;
        self.rows += 1;
        Ok(())
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
        self.out.is_some()
    }

    fn line(&mut self, text: &str) -> Result<(), ObserveError> {
        let Some(out) = &mut self.out else {
            return Ok(());
        };
        writeln!(out, "{text}")
            .and_then(|()| out.flush())
            .map_err(ObserveError::write(&self.path))
    }
}

/// Writes a table whose rows are all known, whole or not at all: a reader, or a run that is killed, never finds half of it.
///
/// # Errors
/// As [`CsvTable::create`] and [`CsvTable::entries`]; the file that lay at `path` before is then still there.
pub fn write_table(
    path: &Path,
    header: &[&str],
    rows: impl Iterator<Item = Vec<f64>>,
) -> Result<(), ObserveError> {
    let header: Vec<String> = header.iter().map(|&h| h.to_owned()).collect();
    has_columns(path, &header)?;
    let mut text = first_line(&header);
    text.push('\n');
    for (number, row) in rows.enumerate() {
        let entries: Vec<Entry> = row.into_iter().map(Entry::Real).collect();
        text.push_str(&line_of(path, &header, number, &entries)?);
        text.push('\n');
    }
    regular_file::may_be_written(path).map_err(ObserveError::write(path))?;
    write_whole(path, |file| file.write_all(text.as_bytes()))
}

fn has_columns(path: &Path, header: &[String]) -> Result<(), ObserveError> {
    if header.is_empty() {
        return Err(ObserveError::Empty {
            path: path.to_path_buf(),
            what: "the table has no columns",
        });
    }
    Ok(())
}

fn first_line(header: &[String]) -> String {
    let names: Vec<String> = header.iter().map(|h| quoted(h)).collect();
    names.join(",")
}

/// Row `number` of a table, without the end of the line.
fn line_of(
    path: &Path,
    header: &[String],
    number: usize,
    entries: &[Entry],
) -> Result<String, ObserveError> {
    if entries.len() != header.len() {
        return Err(ObserveError::RowLength {
            path: path.to_path_buf(),
            expected: header.len(),
            found: entries.len(),
        });
    }
    let mut words = Vec::with_capacity(entries.len());
    for (entry, column) in entries.iter().zip(header) {
        words.push(match entry {
            Entry::Real(v) if !v.is_finite() => {
                return Err(ObserveError::NotFinite {
                    path: path.to_path_buf(),
                    field: column.clone(),
                    entry: number,
                    value: *v,
                });
            }
            Entry::Real(v) => format!("{v:e}"),
            Entry::Integer(v) => v.to_string(),
            Entry::Text(v) => quoted(v),
        });
    }
    Ok(words.join(","))
}

/// RFC 4180: quotes around an entry with a comma, a quote or a line break; quotes inside doubled.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back_exactly_while_the_table_is_open() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/line.csv");
        let mut table = CsvTable::create(&path, &["x", "u, \"outer\"", "model"]).unwrap();
        let values = [
            0.1 + 0.2,
            -1.0 / 3.0e-301,
            f64::MIN_POSITIVE / 8.0,
            0.0,
            1e23,
        ];
        for (i, &v) in values.iter().enumerate() {
            table
                .entries(&[v.into(), (i as i64).into(), "local".into()])
                .unwrap();
        }
        let text = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "x,\"u, \"\"outer\"\"\",model");
        assert_eq!(lines.len(), values.len() + 1);
        for (i, (line, v)) in lines[1..].iter().zip(values).enumerate() {
            let words: Vec<&str> = line.split(',').collect();
            assert_eq!(words[0].parse::<f64>().unwrap().to_bits(), v.to_bits());
            assert_eq!(words[1..], [&i.to_string(), "local"]);
        }
    }

    #[test]
    fn rows_that_do_not_fit_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("line.csv");
        let mut table = CsvTable::create(&path, &["x", "u"]).unwrap();
        let error = table.entries(&[1.0.into()]).unwrap_err().to_string();
        assert!(
            error.contains("1 entries where its header has 2"),
            "{error}"
        );
        let error = table
            .entries(&[1.0.into(), f64::NAN.into()])
            .unwrap_err()
            .to_string();
        assert!(error.contains("`u`") && error.contains("NaN"), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "x,u\n");
        assert!(CsvTable::create(&path, &[]).is_err());
        let error = CsvTable::create(folder.path(), &["x"])
            .unwrap_err()
            .to_string();
        assert!(error.contains("is a folder"), "{error}");
    }

    fn header() -> Vec<String> {
        vec!["step".to_owned(), "energy".to_owned()]
    }

    #[test]
    fn rows_after_the_mark_go_and_come_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run_history.csv");
        let row = |history: &mut CsvTable, k: i64| {
            history
                .entries(&[k.into(), (0.1 * k as f64).into()])
                .unwrap();
        };
        let mut history = CsvTable::resumed(&path, header(), 0).unwrap();
        assert!(!history.is_begun() && !path.exists());
        assert_eq!(history.mark().unwrap(), 0);
        (0..3).for_each(|k| row(&mut history, k));
        let mark = history.mark().unwrap();
        (3..6).for_each(|k| row(&mut history, k));
        let whole = std::fs::read(&path).unwrap();
        drop(history);
        // killed in the middle of a row
        std::fs::write(&path, &whole[..whole.len() - 4]).unwrap();
        let mut history = CsvTable::resumed(&path, header(), mark).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 4);
        (3..6).for_each(|k| row(&mut history, k));
        assert_eq!(std::fs::read(&path).unwrap(), whole);
        drop(history);
        let error = CsvTable::resumed(&path, header(), 10_000).unwrap_err();
        assert!(matches!(error, ObserveError::Shortened { .. }), "{error}");
        let history = CsvTable::resumed(&path, header(), 0).unwrap();
        assert!(!history.is_begun() && !path.exists());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_is_named() {
        let error = CsvTable::create(Path::new("/dev/full"), &["x"])
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("/dev/full") && error.contains("is a device"),
            "{error}"
        );
    }
}
