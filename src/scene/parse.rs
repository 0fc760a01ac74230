//! From text to [`SceneSpec`], and from a deserialiser's complaint to place, value and remedy.

use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

use super::error::{SceneError, SceneErrorKind, quoted};
use super::function;
use super::source::{Place, Source, find};
use super::spec::{MeshSpec, SceneSpec};
use super::table::{self, Table};
use super::table_rows;
use super::tagged_table;

impl SceneSpec {
    /// Reads a scene.
    ///
    /// # Errors
    /// A [`SceneError`] that underlines the token at fault.
    pub fn parse(source: &Source) -> Result<Self, SceneError> {
        let table = source.merged()?;
        let places = table.get_ref().clone();
        let root = Spanned::new(table.span(), DeValue::Table(table.into_inner()));
        let tables = tables_of(&places);
        let read = || Self::deserialize(ValueDeserializer::from(root));
        let mut spec = table::with_tables(&tables, || {
            function::with_functions(source.functions(), read)
        })
        .map_err(|error| translate(&error, &places).shown_in(source))?;
        table_rows::take_in(&mut spec.tables, &tables).map_err(|error| error.shown_in(source))?;
        if let Some(MeshSpec::File(file)) = &mut spec.mesh {
            file.held = source.mesh().cloned();
        }
        Ok(spec)
    }
}

/// The tables of a scene by their names, which its expressions may use; their rows come later.
fn tables_of(scene: &DeTable<'_>) -> Vec<Table> {
    match scene.get("tables").map(Spanned::get_ref) {
        Some(DeValue::Table(tables)) => tables
            .keys()
            .map(|name| Table::named(name.get_ref()))
            .collect(),
        _ => Vec::new(),
    }
}

impl Place {
    fn dotted(&self) -> String {
        self.path.join(".")
    }

    /// Returns the remedy for a value of another type.
    fn belongs_here(&self, expected: &str, found: &str) -> String {
        match (self.dotted().as_str(), found) {
            ("mesh.file", _) => "write mesh.file.path = \"part.msh\"".to_owned(),
            (at, "map") if at.ends_with(".on") => {
                "`on` is the name of a set of the mesh; a shape is written as `inside`, for displacements, velocities, rotations and springs: tractions and pressures act on sets of facets".to_owned()
            }
            _ => format!("write {expected} here"),
        }
    }

    /// The path of the table around.
    fn parent(&self) -> String {
        self.path[..self.path.len().saturating_sub(1)].join(".")
    }
}

fn translate(error: &toml::de::Error, places: &DeTable<'_>) -> SceneError {
    let message = error.message().lines().next().unwrap_or_default();
    let span = error.span().unwrap_or_default();
    let mut path = Vec::new();
    let place = find(places, &span, &mut path).unwrap_or(Place {
        path: Vec::new(),
        is_key: false,
    });
    let names = ticked(message);
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    if message.starts_with("unknown field") || message.starts_with("unknown variant") {
        let (word, known) = names.split_first().map_or(("", &[][..]), |(w, k)| (*w, k));
        let at = if place.is_key {
            place.parent()
        } else {
            place.dotted()
        };
        return tagged_table::unknown(word, &at, known).label(span, "not known here");
    }
    if message.starts_with("missing field") {
        let key = names.first().copied().unwrap_or_default();
        let at = place.dotted();
        let (message, help) = missing(key, &at);
        let error = SceneError::missing(message).help(help);
        // the span of a whole file says nothing; that of a table is its header
        return if at.is_empty() {
            error.label(0..0, "not found in this scene")
        } else {
            error.label(span, format!("`{key}` belongs here"))
        };
    }
    let at = if place.path.is_empty() {
        "the scene".to_owned()
    } else {
        format!("`{}`", place.dotted())
    };
    if let Some(rest) = message.strip_prefix("in the expression ") {
        return SceneError::wrong_value(format!("{at}: in the expression {rest}"))
            .label(span, "this expression")
            .help(
                "expressions know + - * / ^, comparisons, brackets and functions such as sin(pi * x)",
            );
    }
    if let Some(rest) = message.strip_prefix("invalid type: ") {
        let (found, expected) = rest
            .split_once(", expected ")
            .unwrap_or((rest, "another type"));
        return SceneError::new(
            SceneErrorKind::WrongType,
            format!("{at} is {}", plain(found)),
        )
        .label(span, format!("not {}", plain(expected)))
        .help(place.belongs_here(&plain(expected), found));
    }
    if message.starts_with("wanted") {
        let path: Vec<&str> = place.path.iter().map(String::as_str).collect();
        return SceneError::new(
            SceneErrorKind::WrongType,
            format!("{at} must make exactly one choice"),
        )
        .label(span, "a table of one key belongs here")
        .help(match tagged_table::options(&path) {
            Some(options) => format!("write {{ key = ... }} with one of {}", quoted(&options)),
            None => "see `bondline schema` for the choices".to_owned(),
        });
    }
    SceneError::wrong_value(format!("{at}: {message}"))
        .label(span, "this value")
        .help("see `bondline schema` for what belongs here")
}

/// Returns message and remedy for a missing key.
fn missing(key: &str, at: &str) -> (String, String) {
    let place = if at.is_empty() {
        "the scene".to_owned()
    } else {
        format!("`{at}`")
    };
    let help = match (at, key) {
        ("", "kinematics") => {
            "add kinematics = \"bar\", \"plane-stress\", \"plane-strain\" or \"solid\""
        }
        ("", "materials") => {
            "add a material, for example [materials.steel.lps] with youngs-modulus and poisson-ratio"
        }
        (_, "poisson-ratio") => {
            "add poisson-ratio = 0.25, or use a bond-based material, which has its own"
        }
        _ => {
            return (
                format!("{place} lacks `{key}`"),
                format!("add `{key} = ...` to {place}"),
            );
        }
    };
    (format!("{place} lacks `{key}`"), help.to_owned())
}

/// A deserialiser's words in those of a scene.
fn plain(text: &str) -> String {
    let text = text
        .replace("string", "text")
        .replace("floating point", "number")
        .replace("boolean", "truth value")
        .replace("a sequence", "a list")
        .replace("sequence", "a list")
        .replace("map", "a table");
    match text.split_once(' ') {
        Some(("struct" | "enum", name)) if name.ends_with("Spec") => "a table".to_owned(),
        _ => text,
    }
}

/// The words between backticks.
fn ticked(message: &str) -> Vec<String> {
    message
        .split('`')
        .skip(1)
        .step_by(2)
        .map(str::to_owned)
        .collect()
}
