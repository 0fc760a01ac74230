//! The text of a scene with its overrides, and positions in it.
//!
//! The file and every `--set` stand one after another on one axis of byte positions, so that an error in an override is
//! underlined in the override and one in the file in the file.

use std::path::Path;
use std::sync::Arc;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{Excerpt, SceneError};
use super::function::Function;
use super::tagged_table;
use crate::mesh::MeshParts;
use crate::observe::checkpoint::Fingerprint;
use crate::regular_file;

pub use super::error::Span;

impl SceneError {
    /// Attaches the text that the labels point into.
    pub fn shown_in(self, source: &Source) -> Self {
        let spans: Vec<Span> = self.labels().iter().map(|(s, _)| s.clone()).collect();
        let (name, text, local, line) = source.locate(&spans);
        let labels = local
            .into_iter()
            .zip(self.labels())
            .filter_map(|(span, (_, words))| span.map(|s| (s, words.clone())))
            .collect();
        let place = source.place_of(&spans);
        let line = match (&place, spans.is_empty()) {
            (None, false) => line,
            _ => 0,
        };
        self.shown(Excerpt {
            name: place.unwrap_or(name),
            text,
            labels,
            line,
        })
    }
}

/// The text of a scene file and of the overrides typed after it.
#[derive(Clone, Debug)]
pub struct Source {
    pieces: Vec<Piece>,
    mesh: Option<Arc<MeshParts>>,
    functions: Vec<Function>,
    /// True if a program made the scene: places are its keys, for nobody has typed the lines.
    is_built: bool,
}

#[derive(Clone, Debug)]
struct Piece {
    start: usize,
    name: String,
    text: String,
    /// Text that is parsed; empty for the file, which is parsed as it is.
    toml: String,
}

impl Source {
    /// A scene's text, named `name` (its path) in messages.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            pieces: vec![Piece {
                start: 0,
                name: name.into(),
                text: text.into(),
                toml: String::new(),
            }],
            mesh: None,
            functions: Vec::new(),
            is_built: false,
        }
    }

    /// A scene that a program made, from a table in which words stand for `functions`; messages give its keys as places instead of lines.
    pub fn built(name: impl Into<String>, table: &toml::Table, functions: Vec<Function>) -> Self {
        Self {
            functions,
            is_built: true,
            ..Self::new(name, table.to_string())
        }
    }

    /// The scene with functions of a program, for which [`Function::word`] stands in its text and its overrides.
    pub fn with_functions(mut self, functions: Vec<Function>) -> Self {
        self.functions = functions;
        self
    }

    /// The functions of the program that words of the scene stand for.
    pub(crate) fn functions(&self) -> &[Function] {
        &self.functions
    }

    /// Returns the name and the keys by which messages call a place of a scene that a program made; none for a scene that was typed.
    pub(crate) fn place_of(&self, spans: &[Span]) -> Option<String> {
        if !self.is_built {
            return None;
        }
        // the text as it is: what is wrong may be how its parts merge
        let table = DeTable::parse(&self.pieces[0].text).ok()?;
        let found = spans
            .iter()
            .find_map(|s| find(table.get_ref(), s, &mut Vec::new()));
        Some(match found {
            Some(place) if !place.path.is_empty() => {
                format!("{}, {}", self.name(), place.path.join("."))
            }
            _ => self.name().to_owned(),
        })
    }

    /// The scene with a mesh in memory, instead of a `mesh` of its own.
    pub fn with_mesh(mut self, mesh: Arc<MeshParts>) -> Self {
        self.mesh = Some(mesh);
        self
    }

    /// The mesh in memory, if there is one.
    pub fn mesh(&self) -> Option<&Arc<MeshParts>> {
        self.mesh.as_ref()
    }

    /// Appends an override `key=value`, as typed after `--set`. A value that is no TOML is taken as text.
    ///
    /// # Errors
    /// [`SceneErrorKind::Syntax`](crate::scene::SceneErrorKind::Syntax) if there is no `=`.
    pub fn push_override(&mut self, text: &str) -> Result<(), SceneError> {
        let start = self.pieces.last().map_or(0, |p| p.start + p.text.len() + 1);
        let mut text = text.to_owned();
        let equals = text.find('=');
        if let Some(equals) = equals
            && DeTable::parse(&text).is_err()
        {
            let value = toml::Value::String(text[equals + 1..].trim().to_owned());
            text = format!("{}={value}", &text[..equals]);
        }
        let piece = Piece {
            start,
            name: "--set".to_owned(),
            // blanks in front move all spans to where the override stands on the common axis
            toml: " ".repeat(start) + &text,
            text,
        };
        let span = piece.start..piece.start + piece.text.len();
        let message = format!("the override `{}` has no `=`", piece.text);
        self.pieces.push(piece);
        match equals {
            Some(_) => Ok(()),
            None => Err(SceneError::syntax(message)
                .label(span, "no value")
                .help("write --set key=value, for example --set coupling=splice")
                .shown_in(self)),
        }
    }

    /// The name of the scene file.
    pub fn name(&self) -> &str {
        &self.pieces[0].name
    }

    /// Name and text of the piece in which the first of `spans` lies, all spans relative to it (none for those in other pieces), and the line of the first.
    pub(crate) fn locate(&self, spans: &[Span]) -> (String, String, Vec<Option<Span>>, usize) {
        let first = spans.first().map_or(0, |s| s.start);
        let piece = self
            .pieces
            .iter()
            .rev()
            .find(|p| p.start <= first)
            .unwrap_or(&self.pieces[0]);
        let end = piece.start + piece.text.len();
        let local = spans
            .iter()
            .map(|s| {
                (s.start >= piece.start && s.start <= end)
                    .then(|| s.start - piece.start..s.end.min(end).max(s.start) - piece.start)
            })
            .collect();
        let line = piece.text[..(first - piece.start).min(piece.text.len())]
            .bytes()
            .filter(|b| *b == b'\n')
            .count()
            + 1;
        (piece.name.clone(), piece.text.clone(), local, line)
    }

    /// The tables of the scene with all overrides applied, every key and value with its span.
    ///
    /// # Errors
    /// [`SceneErrorKind::Syntax`](crate::scene::SceneErrorKind::Syntax) where the text is no TOML, [`SceneErrorKind::Choice`](crate::scene::SceneErrorKind::Choice) where a table that must hold exactly one
    /// key holds none or several.
    pub(crate) fn merged(&self) -> Result<Spanned<DeTable<'_>>, SceneError> {
        let mut root = self.parse(&self.pieces[0])?;
        for piece in &self.pieces[1..] {
            tagged_table::merge(
                root.get_mut(),
                self.parse(piece)?.into_inner(),
                keys(&piece.text),
                &mut Vec::new(),
            );
        }
        if let Some(mesh) = &self.mesh {
            stand_in(root.get_mut(), &mesh.name).map_err(|e| e.shown_in(self))?;
        }
        tagged_table::normalise(root.get_mut(), &mut Vec::new()).map_err(|e| e.shown_in(self))?;
        Ok(root)
    }

    /// A number for all that determines the results of the scene: not how it is typed, where files go, or how often a
    /// checkpoint is written.
    ///
    /// # Errors
    /// [`SceneErrorKind::Syntax`](crate::scene::SceneErrorKind::Syntax) where the text is no TOML, [`SceneErrorKind::Choice`](crate::scene::SceneErrorKind::Choice) where a table holds none or several of keys of which it must hold one.
    pub(crate) fn fingerprint(&self) -> Result<Fingerprint, SceneError> {
        let mut print = Fingerprint::default();
        print.add(env!("CARGO_PKG_VERSION").as_bytes());
        add_table(self.merged()?.get_ref(), &mut Vec::new(), &mut print);
        Ok(print)
    }

    /// The scene with all overrides applied, without places.
    ///
    /// # Errors
    /// [`SceneErrorKind::Syntax`](crate::scene::SceneErrorKind::Syntax) where the text is no TOML, [`SceneErrorKind::Choice`](crate::scene::SceneErrorKind::Choice) where a table holds none or several of keys of which it must hold one.
    pub fn table(&self) -> Result<toml::Table, SceneError> {
        Ok(plain_table(self.merged()?.get_ref()))
    }

    /// The keys of the table at `path` in the order in which they are typed, overrides last; none where there is no such table.
    pub fn typed_keys(&self, path: &[&str]) -> Vec<String> {
        let Ok(root) = self.merged() else {
            return Vec::new();
        };
        let mut table = root.get_ref();
        for key in path {
            match table.get(*key).map(Spanned::get_ref) {
                Some(DeValue::Table(inner)) => table = inner,
                _ => return Vec::new(),
            }
        }
        let mut keys: Vec<_> = table.iter().map(|(key, _)| key).collect();
        keys.sort_by_key(|key| key.span().start);
        keys.iter().map(|key| key.get_ref().to_string()).collect()
    }

    /// The scene as one TOML text with all overrides applied; a mesh file and libraries of routines are looked for from `folder`, wherever the text will lie.
    ///
    /// # Errors
    /// [`SceneErrorKind::Syntax`](crate::scene::SceneErrorKind::Syntax), [`SceneErrorKind::Choice`](crate::scene::SceneErrorKind::Choice) where the scene is none.
    pub fn text(&self, folder: &std::path::Path) -> Result<String, SceneError> {
        let mut table = self.table()?;
        for keys in [&["mesh", "file"][..], &["peridynamics", "points", "file"]] {
            let (first, rest) = (table.get_mut(keys[0]), &keys[1..]);
            let file = rest
                .iter()
                .try_fold(first, |at, key| Some(at?.get_mut(key)))
                .flatten();
            let path = file.and_then(|f| f.get_mut("path"));
            if let Some(toml::Value::String(path)) = path {
                *path = folder.join(&*path).display().to_string();
            }
        }
        let materials = table.get_mut("materials").and_then(|m| m.as_table_mut());
        for (_, material) in materials.into_iter().flatten() {
            let library = material.get_mut("umat").and_then(|m| m.get_mut("library"));
            if let Some(toml::Value::String(library)) = library {
                *library = folder.join(&*library).display().to_string();
            }
        }
        Ok(table.to_string())
    }

    fn parse<'a>(&self, piece: &'a Piece) -> Result<Spanned<DeTable<'a>>, SceneError> {
        let text = if piece.start == 0 {
            &piece.text
        } else {
            &piece.toml
        };
        DeTable::parse(text).map_err(|error| {
            SceneError::syntax(format!("this is not TOML: {}", error.message()))
                .label(error.span().unwrap_or(piece.start..piece.start), "here")
                .help("a line reads `key = value` or `[table]`; text needs quotes")
                .shown_in(self)
        })
    }
}

/// Writes `mesh.file.path = name` for a mesh in memory.
fn stand_in(root: &mut DeTable<'_>, name: &str) -> Result<(), SceneError> {
    if let Some((key, _)) = root.get_key_value("mesh") {
        return Err(
            SceneError::conflict("the scene has a `mesh` of its own and one in memory")
                .label(key.span(), "one too many")
                .help("leave out one of the two"),
        );
    }
    let entry = |key: &'static str, value| {
        let key = Spanned::new(0..0, key.into());
        (key, Spanned::new(0..0, value))
    };
    let mut value = DeValue::String(name.to_owned().into());
    for key in ["path", "file"] {
        value = DeValue::Table([entry(key, value)].into_iter().collect());
    }
    root.extend([entry("mesh", value)]);
    Ok(())
}

/// Returns the number of keys before the `=` of an override, `a."b.c".d=1` has three.
fn keys(text: &str) -> usize {
    let path = format!("{}=0", &text[..text.find('=').unwrap_or(text.len())]);
    let Ok(parsed) = DeTable::parse(&path) else {
        return usize::MAX;
    };
    let mut count = 0;
    let mut table = Some(parsed.get_ref());
    while let Some((_, value)) = table.and_then(|t| t.iter().next()) {
        count += 1;
        table = value.get_ref().as_table();
    }
    count
}

fn plain_table(table: &DeTable<'_>) -> toml::Table {
    table
        .iter()
        .map(|(k, v)| (k.get_ref().to_string(), plain(v.get_ref())))
        .collect()
}

/// A value without its place.
fn plain(value: &DeValue<'_>) -> toml::Value {
    match value {
        DeValue::Table(table) => toml::Value::Table(plain_table(table)),
        DeValue::Array(items) => {
            toml::Value::Array(items.iter().map(|i| plain(i.get_ref())).collect())
        }
        DeValue::String(text) => toml::Value::String(text.to_string()),
        DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix())
            .map_or_else(|_| toml::Value::String(i.to_string()), toml::Value::Integer),
        DeValue::Float(f) => f
            .as_str()
            .parse()
            .map_or_else(|_| toml::Value::String(f.to_string()), toml::Value::Float),
        DeValue::Boolean(b) => toml::Value::Boolean(*b),
        DeValue::Datetime(d) => toml::Value::Datetime(*d),
    }
}

/// Key or value at a span: its path, and whether the span is that of the key.
pub(super) struct Place {
    pub path: Vec<String>,
    pub is_key: bool,
}

/// The deepest key or value at `span`.
pub(super) fn find(table: &DeTable<'_>, span: &Span, path: &mut Vec<String>) -> Option<Place> {
    let mut found = None;
    for (key, value) in table.iter() {
        path.push(key.get_ref().to_string());
        if key.span() == *span {
            found = Some(Place {
                path: path.clone(),
                is_key: true,
            });
        }
        if value.span() == *span && found.is_none() {
            found = Some(Place {
                path: path.clone(),
                is_key: false,
            });
        }
        if let Some(deeper) = find_in_value(value, span, path) {
            found = Some(deeper);
        }
        path.pop();
        if found.is_some() {
            break;
        }
    }
    found
}

fn find_in_value(
    value: &Spanned<DeValue<'_>>,
    span: &Span,
    path: &mut Vec<String>,
) -> Option<Place> {
    match value.get_ref() {
        DeValue::Table(inner) => find(inner, span, path),
        DeValue::Array(items) => items.iter().enumerate().find_map(|(i, item)| {
            path.push((i + 1).to_string());
            let here = (item.span() == *span).then(|| Place {
                path: path.clone(),
                is_key: false,
            });
            let found = find_in_value(item, span, path).or(here);
            path.pop();
            found
        }),
        _ => None,
    }
}

/// Keys that change no result.
const WITHOUT_EFFECT: &[&[&str]] = &[
    &["title"],
    &["output", "directory"],
    &["zones", "damage-at-edge"],
    &["warnings"],
    &["solve", "explicit", "largest-energy-gain"],
    &["solve", "explicit", "largest-rotation"],
    &["solve", "quasi-static", "largest-rotation"],
    &["solve", "quasi-static", "when-parted"],
    &["solve", "explicit", "checkpoint-every"],
    &["solve", "quasi-static", "checkpoint-every"],
];

/// Returns true for a key that changes no result, and for a table of such keys alone.
fn is_without_effect(path: &[String], value: &DeValue<'_>) -> bool {
    let is_one = |key: Option<&str>| {
        // a stage has the keys of `solve`
        let (first, rest) = match path {
            [stages, _, rest @ ..] if stages == "stages" => ("solve", rest),
            [first, rest @ ..] => (first.as_str(), rest),
            [] => return false,
        };
        let rest = || rest.iter().map(String::as_str).chain(key);
        let path = || std::iter::once(first).chain(rest());
        WITHOUT_EFFECT.iter().any(|p| path().eq(p.iter().copied()))
    };
    let of_such = |table: &DeTable<'_>| {
        let mut keys = table.iter().map(|(key, _)| key.get_ref());
        table.iter().next().is_some() && keys.all(|key| is_one(Some(key)))
    };
    is_one(None) || value.as_table().is_some_and(of_such)
}

fn add_table(table: &DeTable<'_>, path: &mut Vec<String>, print: &mut Fingerprint) {
    // the tables of the toml crate are sorted by key
    for (key, value) in table.iter() {
        path.push(key.get_ref().to_string());
        if !is_without_effect(path, value.get_ref()) {
            print.add(key.get_ref().as_bytes());
            add_value(value.get_ref(), path, print);
            if !value.get_ref().is_table() {
                let mut of_value = Fingerprint::default();
                add_value(value.get_ref(), path, &mut of_value);
                print.note(path.join("."), &of_value);
            }
        }
        path.pop();
    }
    print.add(b"end of table");
}

fn add_value(value: &DeValue<'_>, path: &mut Vec<String>, print: &mut Fingerprint) {
    match value {
        DeValue::Table(table) => add_table(table, path, print),
        DeValue::Array(items) => {
            for item in items.iter() {
                add_value(item.get_ref(), path, print);
            }
            print.add(b"end of list");
        }
        DeValue::String(text) => print.add(text.as_bytes()),
        DeValue::Integer(i) => print.add(format!("{i}").as_bytes()),
        DeValue::Float(f) => print.add(f.as_str().as_bytes()),
        DeValue::Boolean(b) => print.add(&[u8::from(*b)]),
        DeValue::Datetime(d) => print.add(d.to_string().as_bytes()),
    }
}

/// The source of a scene file with overrides, the folder that its paths are relative to, and the name of its files.
///
/// # Errors
/// A [`SceneError`] for a file that cannot be read or an override without `=`.
pub fn read<'p>(
    path: &'p Path,
    overrides: &[String],
) -> Result<(Source, &'p Path, String), SceneError> {
    let text = regular_file::read_scene(path).map_err(|error| {
        SceneError::file(format!("cannot read the scene {}: {error}", path.display())).help(
            regular_file::remedy(
                &error,
                "check the path; `bondline new scene.toml` writes a template",
            ),
        )
    })?;
    let mut source = Source::new(path.display().to_string(), text);
    for text in overrides {
        source.push_override(text)?;
    }
    let directory = path.parent().unwrap_or(Path::new(""));
    let name = path
        .file_stem()
        .map_or("scene".into(), |s| s.to_string_lossy().into_owned());
    Ok((source, directory, name))
}
