//! Error of a scene: place, value and remedy.

use std::fmt;

/// A range of bytes of the text of a scene, its overrides after it.
pub type Span = std::ops::Range<usize>;

/// Kind of mistake that a [`SceneError`] reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SceneErrorKind {
    /// The text is no TOML.
    Syntax,
    /// A key or a name of a choice that does not exist.
    UnknownKey,
    /// A table, number or text where another is expected.
    WrongType,
    /// A number or expression outside what the model allows.
    WrongValue,
    /// A key or table that must be there is not.
    Missing,
    /// None or several keys where exactly one is expected.
    Choice,
    /// A named set that the mesh does not have.
    UnknownSet,
    /// Something given in another dimension than the scene's.
    Dimension,
    /// Parts that are right alone and do not go together.
    Conflict,
    /// A zone, set or shape that selects nothing.
    Empty,
    /// A mesh that cannot be read or used.
    Mesh,
    /// A file that cannot be read or written.
    File,
    /// Something that is planned and not there yet.
    Later,
}

/// A mistake in a scene, with its place and its remedy.
///
/// `Display` gives all on one line, `file:line: message; help`. [`SceneError::excerpt`] has what a terminal underlines.
#[derive(Clone, Debug)]
pub struct SceneError {
    kind: SceneErrorKind,
    message: String,
    help: Option<String>,
    labels: Vec<(Span, String)>,
    shown: Option<Box<Excerpt>>,
}

/// A piece of a scene's text, with the mistake in it.
#[derive(Clone, Debug)]
pub struct Excerpt {
    /// The path of the scene, or `--set`; of a scene that a program made its name and the key at fault.
    pub name: String,
    /// The whole text.
    pub text: String,
    /// Bytes of `text` to underline, and a few words to write under each.
    pub labels: Vec<(Span, String)>,
    /// The line of the first label, from 1; 0 if there is none, or if nobody has typed it.
    pub line: usize,
}

/// Declares the mistakes by their kind.
macro_rules! kinds {
    ($($name:ident: $kind:ident),* $(,)?) => {
        impl SceneError {
            $(
                #[doc = concat!("A mistake of the kind [`SceneErrorKind::", stringify!($kind), "`], without a place yet.")]
                pub fn $name(message: impl Into<String>) -> Self {
                    Self::new(SceneErrorKind::$kind, message)
                }
            )*
        }
    };
}

kinds! {
    syntax: Syntax,
    wrong_value: WrongValue,
    missing: Missing,
    choice: Choice,
    dimension: Dimension,
    conflict: Conflict,
    empty: Empty,
    mesh: Mesh,
    file: File,
}

impl SceneError {
    /// A mistake without a place yet.
    pub fn new(kind: SceneErrorKind, message: impl Into<String>) -> Self {
        Self {
            kind,
            message: message.into(),
            help: None,
            labels: Vec::new(),
            shown: None,
        }
    }

    /// Adds a place with a few words to write under it.
    pub fn label(mut self, span: Span, text: impl Into<String>) -> Self {
        self.labels.push((span, text.into()));
        self
    }

    /// Sets the remedy.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Places, with the words under them.
    pub(super) fn labels(&self) -> &[(Span, String)] {
        &self.labels
    }

    /// The mistake with what is shown of the scene.
    pub(super) fn shown(mut self, excerpt: Excerpt) -> Self {
        self.shown = Some(Box::new(excerpt));
        self
    }

    /// Returns the kind of mistake.
    pub fn kind(&self) -> SceneErrorKind {
        self.kind
    }

    /// Place and value, without the remedy.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// The remedy.
    pub fn remedy(&self) -> Option<&str> {
        self.help.as_deref()
    }

    /// The text that is underlined.
    pub fn underlined(&self) -> Vec<&str> {
        let Some(shown) = &self.shown else {
            return Vec::new();
        };
        let labels = shown.labels.iter();
        labels
            .filter_map(|(span, _)| shown.text.get(span.clone()))
            .collect()
    }

    /// The text that the mistake stands in; none where it stands in no text.
    pub fn excerpt(&self) -> Option<&Excerpt> {
        self.shown.as_deref()
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(shown) = &self.shown {
            match shown.line {
                0 => write!(f, "{}: ", shown.name)?,
                line => write!(f, "{}:{line}: ", shown.name)?,
            }
        }
        f.write_str(&self.message)?;
        if let Some(help) = &self.help {
            write!(f, "; {help}")?;
        }
        Ok(())
    }
}

impl std::error::Error for SceneError {}

/// `` `a`, `b`, `c` ``.
pub(crate) fn quoted(names: &[&str]) -> String {
    names
        .iter()
        .map(|n| format!("`{n}`"))
        .collect::<Vec<_>>()
        .join(", ")
}

/// The member of `known` that `word` was probably meant to be.
pub(crate) fn closest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    known
        .into_iter()
        .map(|k| (edits(word, k), k))
        .filter(|(d, k)| *d <= 1 + k.len().min(word.len()) / 4 && *d < k.len())
        .min()
        .map(|(_, k)| k)
}

/// Returns the edit distance of two words, two letters that changed places counted once, ignoring case and taking `_` for `-`.
fn edits(a: &str, b: &str) -> usize {
    let plain = |s: &str| s.to_lowercase().replace('_', "-");
    strsim::osa_distance(&plain(a), &plain(b))
}

#[cfg(test)]
mod tests {
    use super::{closest, edits};

    #[test]
    fn distances() {
        assert_eq!(edits("kitten", "sitting"), 3);
        assert_eq!(edits("youngs_modulus", "youngs-modulus"), 0);
        assert_eq!(edits("", "abc"), 3);
        assert_eq!(edits("lsp", "lps"), 1);
    }

    #[test]
    fn suggestions_are_near() {
        let known = ["horizon", "weights", "points"];
        assert_eq!(closest("horizn", known), Some("horizon"));
        assert_eq!(closest("density", known), None);
        assert_eq!(closest("spilce", ["splice", "blending"]), Some("splice"));
    }
}
