//! The rows of tables: those that are typed, and those of files.

use std::collections::BTreeMap;
use std::path::Path;

use super::error::SceneError;
use super::expression;
use super::spec::TableSpec;
use super::table::Table;
use super::value::{Coordinates, Text};
use crate::observe::checkpoint::Fingerprint;
use crate::regular_file;

/// The most rows of a table: 16 MB.
const MOST_ROWS: usize = 1_000_000;

/// Gives the tables of a scene what is typed of them; files are left to [`read_files`].
///
/// # Errors
/// A [`SceneError`] for a name that no expression can have, and for rows that are none.
pub(crate) fn take_in(
    specs: &mut BTreeMap<Text, TableSpec>,
    tables: &[Table],
) -> Result<(), SceneError> {
    for (name, spec) in specs {
        check_name(name)?;
        let place = format!("tables.{name}");
        spec.held = tables.iter().find(|t| t.name() == name.value).cloned();
        match (&spec.points, &spec.file) {
            (None, Some(_)) => {}
            (Some(points), None) => {
                let rows = typed_rows(&place, name, points)?;
                if let Some(table) = &spec.held {
                    table.fill(rows);
                }
            }
            (points, _) => {
                let (what, label) = match points {
                    Some(_) => ("both `points` and `file`", "two sources"),
                    None => ("neither `points` nor `file`", "no rows"),
                };
                return Err(SceneError::choice(format!("`{place}` has {what}"))
                    .label(name.span.clone(), label)
                    .help("keep one: points = [[0, 0], [1, 5]], or file = \"curve.csv\""));
            }
        }
    }
    Ok(())
}

/// Refuses a name that an expression reads as something else.
fn check_name(name: &Text) -> Result<(), SceneError> {
    let wrong = |what: String| {
        Err(SceneError::wrong_value(format!("the table `{name}` {what}"))
            .label(name.span.clone(), "not a name in an expression")
            .help("use a letter, then letters, digits and `_`, such as load_curve, and no name that expressions know"))
    };
    let mut letters = name.value.chars();
    let is_word = letters.next().is_some_and(char::is_alphabetic)
        && letters.all(|c| c.is_alphanumeric() || c == '_');
    if !is_word {
        return wrong("cannot be named in an expression".to_owned());
    }
    if expression::knows(&name.value) {
        return wrong("has the name of a variable or a function".to_owned());
    }
    Ok(())
}

/// The rows of `points`.
fn typed_rows(
    place: &str,
    name: &Text,
    points: &[Coordinates],
) -> Result<Vec<(f64, f64)>, SceneError> {
    let place = format!("{place}.points");
    let mut rows: Vec<(f64, f64)> = Vec::with_capacity(points.len());
    for (k, point) in points.iter().enumerate() {
        let refuse = |what: String, label: &str| {
            SceneError::wrong_value(format!("`{place}`, row {}: {what}", k + 1))
                .label(point.span.clone(), label)
                .help(ROWS)
        };
        let [s, value] = point.values[..] else {
            let count = point.values.len();
            return Err(refuse(format!("{count} numbers"), "two belong here"));
        };
        if let Some((last, _)) = rows.last().filter(|(last, _)| *last >= s) {
            return Err(refuse(
                format!("{s} does not exceed {last}"),
                "not larger than the one before",
            ));
        }
        rows.push((s, value));
    }
    if rows.len() < 2 {
        return Err(
            SceneError::wrong_value(format!("`{place}` has {} rows", rows.len()))
                .label(name.span.clone(), "at least two are needed")
                .help(ROWS),
        );
    }
    Ok(rows)
}

/// Requirement on the rows of a table.
const ROWS: &str = "rows are pairs of finite numbers, the first of which increases from row to row: [[0, 0], [1e-3, 5]]";

/// Reads the files of the tables, relative to `directory`; a checkpoint belongs to their rows.
///
/// # Errors
/// A [`SceneError`] with file and line.
pub(crate) fn read_files(
    specs: &BTreeMap<Text, TableSpec>,
    directory: &Path,
    fingerprint: &mut Fingerprint,
) -> Result<(), SceneError> {
    for (name, spec) in specs {
        let (Some(file), Some(table)) = (&spec.file, &spec.held) else {
            continue;
        };
        let path = directory.join(&file.value);
        let refuse = |what: String, help: &str| {
            SceneError::file(format!("`tables.{name}.file`: {}{what}", path.display()))
                .label(file.span.clone(), "this file")
                .help(help)
        };
        let text = regular_file::read_to_string(&path)
            .map_err(|error| refuse(format!(" cannot be read: {error}"), remedy(&error)))?;
        let rows = rows_of(&text).map_err(|(line, what)| {
            refuse(
                format!(", line {line}: {what}"),
                "a line holds two numbers, separated by a comma, a semicolon or blanks; the first increases from line to line; the first line may name the columns, and lines may begin with #",
            )
        })?;
        for (s, value) in &rows {
            fingerprint.add(&s.to_le_bytes());
            fingerprint.add(&value.to_le_bytes());
        }
        table.fill(rows);
    }
    Ok(())
}

/// The remedy for a file of rows that cannot be read.
pub(super) fn remedy(error: &std::io::Error) -> &'static str {
    regular_file::remedy(error, "the path is relative to the scene file")
}

/// The lines of a text by their numbers, from 1, without blanks around them; they may end in a carriage return alone.
fn trimmed(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    let lines = text.trim_start_matches('\u{feff}').split(end);
    (1..).zip(lines.map(str::trim))
}

/// The words of a line: between semicolons if it has any, else between commas, else between blanks.
fn words(line: &str) -> Vec<&str> {
    match [';', ','].into_iter().find(|&c| line.contains(c)) {
        Some(between) => line.split(between).map(str::trim).collect(),
        None => line.split_whitespace().collect(),
    }
}

/// The lines of a table by their numbers, from 1, and their words, between semicolons, commas or blanks; empty lines and those that begin with # are left out.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let rows = trimmed(text).filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    rows.map(|(number, line)| (number, words(line)))
}

/// The words of the last line with # before the first row, without the mark: numpy writes the names of columns so.
pub(super) fn commented_head(text: &str) -> Option<(usize, Vec<&str>)> {
    let before = trimmed(text).take_while(|(_, line)| line.is_empty() || line.starts_with('#'));
    let (number, line) = before.filter(|(_, line)| !line.is_empty()).last()?;
    Some((number, words(line.trim_start_matches('#').trim())))
}

/// The rows of a file, or the line at fault and what is wrong with it.
fn rows_of(text: &str) -> Result<Vec<(f64, f64)>, (usize, String)> {
    let mut rows: Vec<(f64, f64)> = Vec::new();
    let mut is_first = true;
    for (number, words) in lines(text) {
        let was_first = std::mem::replace(&mut is_first, false);
        if was_first && words.iter().all(|w| w.parse::<f64>().is_err()) {
            continue;
        }
        let [s, value] = words[..] else {
            return Err((number, format!("{} columns", words.len())));
        };
        let read = |word: &str| match word.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            Ok(_) => Err((number, format!("`{word}` is not finite"))),
            Err(_) => Err((number, format!("`{word}` is no number"))),
        };
        let (s, value) = (read(s)?, read(value)?);
        if let Some((last, _)) = rows.last().filter(|(last, _)| *last >= s) {
            return Err((number, format!("{s} does not exceed {last}")));
        }
        if rows.len() == MOST_ROWS {
            return Err((number, format!("more than {MOST_ROWS} rows")));
        }
        rows.push((s, value));
    }
    match rows.len() {
        0 | 1 => Err((
            text.lines().count(),
            format!("it ends after {} of at least 2 rows", rows.len()),
        )),
        _ => Ok(rows),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_as_they_are_written() {
        let rows = vec![(0.0, 1.0), (0.5, -2e3)];
        for text in [
            "0,1\n0.5,-2e3\n",
            "\u{feff}time, force\r\n0, 1\r\n\r\n0.5, -2e3\r\n",
            "# measured\nt;F\n0;1\n# a gap\n0.5;-2e3",
            "0\t1\n 0.5   -2000\n",
        ] {
            assert_eq!(rows_of(text).as_ref(), Ok(&rows), "{text:?}");
        }
        for (text, line, what) in [
            ("0,1\n1\n", 2, "1 columns"),
            ("0,1\n1,2,3\n", 2, "3 columns"),
            ("t,f\n0,1\nt,f\n", 3, "`t` is no number"),
            ("0,1\n\n0,2\n", 3, "0 does not exceed 0"),
            ("0,1\n1,inf\n", 2, "`inf` is not finite"),
            ("0,1\n", 1, "after 1 of at least 2"),
            ("", 0, "after 0 of at least 2"),
            ("0,5 1,5\n1,5 2,5\n", 1, "columns"),
        ] {
            let (at, said) = rows_of(text).unwrap_err();
            assert!(at == line && said.contains(what), "{text:?}: {at} {said}");
        }
    }
}
