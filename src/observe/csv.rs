//! Tables of numbers that grow row by row: values along a line, at probes, over steps.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
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

/// A table on disk: each row is there as soon as it is written, so that a run can be watched and nothing is lost when it
/// stops.
#[derive(Debug)]
pub struct CsvTable {
    path: PathBuf,
    out: BufWriter<File>,
    header: Vec<String>,
    rows: usize,
}

impl CsvTable {
    /// Makes the file (and its folder) and writes the header.
    ///
    /// # Errors
    /// [`ObserveError::Empty`] without columns, [`ObserveError::Folder`], [`ObserveError::Write`].
    pub fn create(path: &Path, header: &[&str]) -> Result<Self, ObserveError> {
        has_columns(path, header)?;
        create_parent(path)?;
        let file = regular_file::may_be_written(path)
            .and_then(|()| File::create(path))
            .map_err(|source| ObserveError::Write {
                path: path.to_path_buf(),
                source,
            })?;
        let mut table = Self {
            path: path.to_path_buf(),
            out: BufWriter::new(file),
            header: header.iter().map(|&h| h.to_owned()).collect(),
            rows: 0,
        };
        table.line(&first_line(header))?;
        Ok(table)
    }

    /// Goes on with a table of which the first `bytes` stand; what follows them is cut off.
    ///
    /// # Errors
    /// [`ObserveError::Write`], or [`ObserveError::Shortened`] if the file holds less.
    pub fn resume(path: &Path, header: &[&str], bytes: u64) -> Result<Self, ObserveError> {
        let fail = |source| ObserveError::Write {
            path: path.to_path_buf(),
            source,
        };
        let mut file = regular_file::open(path, File::options().write(true)).map_err(fail)?;
        let found = file.metadata().map_err(fail)?.len();
        if found < bytes {
            return Err(ObserveError::Shortened {
                path: path.to_path_buf(),
                expected: bytes,
                found,
            });
        }
        file.set_len(bytes).map_err(fail)?;
        file.seek(SeekFrom::End(0)).map_err(fail)?;
        Ok(Self {
            path: path.to_path_buf(),
            out: BufWriter::new(file),
            header: header.iter().map(|&h| h.to_owned()).collect(),
            rows: 0,
        })
    }

    /// Forces all rows to the disk; returns the length of the file.
    ///
    /// # Errors
    /// [`ObserveError::Write`].
    pub fn mark(&self) -> Result<u64, ObserveError> {
        let file = self.out.get_ref();
        file.sync_data()
            .and_then(|()| file.metadata())
            .map(|m| m.len())
            .map_err(|source| ObserveError::Write {
                path: self.path.clone(),
                source,
            })
    }

    /// Appends a row of numbers.
    ///
    /// # Errors
    /// As [`CsvTable::entries`].
    pub fn row(&mut self, values: &[f64]) -> Result<(), ObserveError> {
        let entries: Vec<Entry> = values.iter().map(|&v| v.into()).collect();
        self.entries(&entries)
    }

    /// Appends a row.
    ///
    /// # Errors
    /// [`ObserveError::RowLength`], [`ObserveError::NotFinite`] (the column is named) or [`ObserveError::Write`]; nothing
    /// of the row is then written, except on a full disk.
    pub fn entries(&mut self, entries: &[Entry]) -> Result<(), ObserveError> {
        let line = line_of(&self.path, &self.header, self.rows, entries)?;
        self.line(&line)?;
        self.rows += 1;
        Ok(())
    }

    /// Rows written since the table was made or resumed, the header not counted.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Path of the table.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn line(&mut self, text: &str) -> Result<(), ObserveError> {
        writeln!(self.out, "{text}")
            .and_then(|()| self.out.flush())
            .map_err(|source| ObserveError::Write {
                path: self.path.clone(),
                source,
            })
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
    has_columns(path, header)?;
    let columns: Vec<String> = header.iter().map(|&h| h.to_owned()).collect();
    let mut text = first_line(header);
    text.push('\n');
    for (number, row) in rows.enumerate() {
        let entries: Vec<Entry> = row.into_iter().map(Entry::Real).collect();
        text.push_str(&line_of(path, &columns, number, &entries)?);
        text.push('\n');
    }
    regular_file::may_be_written(path).map_err(|source| ObserveError::Write {
        path: path.to_path_buf(),
        source,
    })?;
    write_whole(path, |file| file.write_all(text.as_bytes()))
}

fn has_columns(path: &Path, header: &[&str]) -> Result<(), ObserveError> {
    if header.is_empty() {
        return Err(ObserveError::Empty {
            path: path.to_path_buf(),
            what: "the table has no columns",
        });
    }
    Ok(())
}

fn first_line(header: &[&str]) -> String {
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
        assert_eq!(table.rows(), values.len());
    }

    #[test]
    fn rows_that_do_not_fit_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("line.csv");
        let mut table = CsvTable::create(&path, &["x", "u"]).unwrap();
        let error = table.row(&[1.0]).unwrap_err().to_string();
        assert!(
            error.contains("1 entries where its header has 2"),
            "{error}"
        );
        let error = table.row(&[1.0, f64::NAN]).unwrap_err().to_string();
        assert!(error.contains("`u`") && error.contains("NaN"), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "x,u\n");
        assert!(CsvTable::create(&path, &[]).is_err());
        let error = CsvTable::create(folder.path(), &["x"])
            .unwrap_err()
            .to_string();
        assert!(error.contains("is a folder"), "{error}");
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
