//! The text of a deck: included files, keyword lines, data lines.

use std::path::{Path, PathBuf};

use crate::mesh::MeshError;
use crate::mesh::raw::{Encoding, Piece, Source, bytes_of};

/// Remedy for a wrong line.
pub(super) const REWRITE: &str = "correct the deck, or write it again";
/// The most files that a deck may include, one counted as often as it is named.
const MOST_INCLUDED: usize = 1000;
/// Keywords whose data lines may lie in a file of their own.
const WITH_INPUT: [&str; 6] = ["INCLUDE", "NODE", "ELEMENT", "NSET", "ELSET", "SURFACE"];

/// A keyword line with its parameters.
pub(super) struct Card<'a> {
    /// The keyword in capitals, without its asterisk and blanks.
    pub keyword: String,
    /// Names in capitals, and values as they stand; an empty value where there is none.
    parameters: Vec<(String, &'a str)>,
    /// Byte where it stands.
    pub at: usize,
    /// Byte where the line after it begins.
    pub next: usize,
}

impl<'a> Card<'a> {
    /// The value of a parameter.
    pub fn get(&self, name: &str) -> Option<&'a str> {
        let mut all = self.parameters.iter();
        all.find(|(key, _)| key == name).map(|(_, value)| *value)
    }

    /// The value of a parameter that has to be there.
    ///
    /// # Errors
    /// [`MeshError::Syntax`].
    pub fn required(&self, name: &str, source: &Source) -> Result<&'a str, MeshError> {
        match self.get(name) {
            Some(value) if !value.is_empty() => Ok(value),
            _ => Err(source.syntax(
                self.at,
                &format!("*{} without {name}", self.keyword),
                &format!("{name}=…"),
                REWRITE,
            )),
        }
    }

    /// The keyword line at byte `at`; a line that ends in a comma goes on in the next one.
    ///
    /// # Errors
    /// [`MeshError::Syntax`] if it is no text.
    pub fn read(source: &Source<'a>, at: usize) -> Result<Self, MeshError> {
        let mut card = Self {
            keyword: String::new(),
            parameters: Vec::new(),
            at,
            next: at,
        };
        let mut first = true;
        loop {
            let (line, next) = bytes_of_line(source.bytes, card.next);
            let line = text(source, card.next, line)?;
            card.next = next;
            if line.starts_with("**") && !first {
                continue;
            }
            for field in split_quoted(line) {
                if first {
                    let word = field.trim_start_matches('*').chars();
                    let word = word.filter(|c| !c.is_whitespace());
                    card.keyword = word.collect::<String>().to_ascii_uppercase();
                    first = false;
                    continue;
                }
                let (key, value) = field.split_once('=').unwrap_or((field, ""));
                let key = key.trim().to_ascii_uppercase();
                if !key.is_empty() {
                    card.parameters.push((key, value.trim()));
                }
            }
            if !line.ends_with(',') || next >= source.bytes.len() {
                return Ok(card);
            }
        }
    }
}

/// The fields of a line: parts between commas that stand outside of quotes.
fn split_quoted(line: &str) -> impl Iterator<Item = &str> {
    let mut quoted = false;
    line.split(move |c| {
        quoted ^= c == '"';
        c == ',' && !quoted
    })
}

/// The line from byte `at` on without blanks around it, and where the next one begins.
pub(super) fn bytes_of_line(bytes: &[u8], at: usize) -> (&[u8], usize) {
    let rest = &bytes[at..];
    let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
    (
        rest[..length].trim_ascii(),
        at + (length + 1).min(rest.len()),
    )
}

/// A line as text.
///
/// # Errors
/// [`MeshError::Syntax`] if it is none.
pub(super) fn text<'a>(source: &Source, at: usize, line: &'a [u8]) -> Result<&'a str, MeshError> {
    std::str::from_utf8(line)
        .map_err(|_| source.syntax(at, "", "text in ASCII or UTF-8", "correct the line"))
}

/// A deck's text with the files that it includes, in the place where each is named.
///
/// # Errors
/// [`MeshError::Open`], and [`MeshError::Unsupported`] where files include each other or there are too many.
pub(in crate::mesh) fn load(path: &Path) -> Result<(Vec<u8>, Vec<Piece>), MeshError> {
    let mut whole = Whole {
        folder: path.parent().unwrap_or(Path::new("")).to_owned(),
        bytes: Vec::new(),
        pieces: Vec::new(),
        open: Vec::new(),
        included: 0,
    };
    whole.add(path)?;
    Ok((whole.bytes, whole.pieces))
}

/// Text that has been put together so far.
struct Whole {
    /// Names of files are relative to the folder of the deck.
    folder: PathBuf,
    bytes: Vec<u8>,
    pieces: Vec<Piece>,
    /// Files that are being read.
    open: Vec<PathBuf>,
    included: usize,
}

impl Whole {
    fn add(&mut self, path: &Path) -> Result<(), MeshError> {
        let mut bytes = bytes_of(path)?;
        if !bytes.contains(&b'\n') {
            // lines of some editors end in a carriage return alone
            bytes
                .iter_mut()
                .filter(|b| **b == b'\r')
                .for_each(|b| *b = b'\n');
        }
        let source = Source {
            path: path.into(),
            bytes: &bytes,
            encoding: Encoding::Text,
            pieces: &[],
        };
        self.open.push(path.into());
        self.begin(path, 1);
        let (mut at, mut copied, mut line) = (0, 0, 1);
        while at < bytes.len() {
            let (words, next) = bytes_of_line(&bytes, at);
            if !(words.starts_with(b"*") && may_include(words)) {
                at = next;
                continue;
            }
            let card = Card::read(&source, at)?;
            at = card.next;
            let name = card.get("INPUT").filter(|name| !name.is_empty());
            let Some(name) = name.filter(|_| WITH_INPUT.contains(&card.keyword.as_str())) else {
                continue;
            };
            let stretch = &bytes[copied..at];
            self.bytes.extend_from_slice(stretch);
            line += stretch.iter().filter(|&&b| b == b'\n').count();
            copied = at;
            let other = self.folder.join(name.trim_matches('"'));
            self.check(&source, &card, &other)?;
            self.end_line();
            self.add(&other)?;
            self.begin(path, line);
        }
        self.bytes.extend_from_slice(&bytes[copied..]);
        self.end_line();
        self.open.pop();
        Ok(())
    }

    fn begin(&mut self, path: &Path, line: usize) {
        self.pieces.push(Piece {
            start: self.bytes.len(),
            path: path.into(),
            line,
        });
    }

    /// Ends the last line, so that the next file begins with one.
    fn end_line(&mut self) {
        if self.bytes.last().is_some_and(|&b| b != b'\n') {
            self.bytes.push(b'\n');
        }
    }

    fn check(&mut self, source: &Source, card: &Card, other: &Path) -> Result<(), MeshError> {
        self.included += 1;
        let (what, remedy) = if self.open.iter().any(|path| path == other) {
            let what = format!("{} including itself", other.display());
            (what, "remove the circle of *INCLUDE")
        } else if self.included > MOST_INCLUDED {
            let what = format!("more than {MOST_INCLUDED} inclusions of files");
            (what, "write the deck into fewer files")
        } else {
            return Ok(());
        };
        Err(MeshError::Unsupported {
            path: source.path.clone(),
            place: source.place(card.at),
            what,
            remedy,
        })
    }
}

/// Returns true if a keyword line may name a file; spares reading the others.
fn may_include(line: &[u8]) -> bool {
    !line.starts_with(b"**")
        && (line.ends_with(b",") || line.windows(5).any(|w| w.eq_ignore_ascii_case(b"INPUT")))
}
