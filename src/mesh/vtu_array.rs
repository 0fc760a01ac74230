//! Arrays of VTK's XML files, as their tags describe them.

use std::borrow::Cow;

use super::MeshError;
use super::vtk_grid::{Kind, Number};

/// An array as its tag describes it.
pub(super) struct Array<'a> {
    pub name: String,
    pub kind: Option<Kind>,
    pub components: u64,
    pub content: Content<'a>,
    /// Byte where its tag stands.
    pub at: usize,
}

/// The numbers of an array.
pub(super) enum Content<'a> {
    Text(Cow<'a, [u8]>),
    Base64(Cow<'a, [u8]>),
    /// This far into the appended data.
    Appended(u64),
}

/// Hands on `count` numbers that are written as words.
pub(super) fn each_word(
    text: &[u8],
    kind: Kind,
    count: u64,
    named: &dyn Fn(String, &str) -> MeshError,
    take: &mut dyn FnMut(Number) -> Result<(), String>,
) -> Result<(), MeshError> {
    let mut found = 0u64;
    for word in text
        .split(u8::is_ascii_whitespace)
        .filter(|w| !w.is_empty())
    {
        let number = std::str::from_utf8(word).ok().and_then(|w| kind.parse(w));
        let Some(number) = number else {
            let word: String = String::from_utf8_lossy(word).chars().take(40).collect();
            return Err(named(format!("\"{word}\""), "a number"));
        };
        found += 1;
        if found > count {
            break;
        }
        take(number).map_err(|e| named(e, "a number that fits the grid"))?;
    }
    if found == count {
        return Ok(());
    }
    let more = if found > count { "more" } else { "fewer" };
    Err(named(format!("{more} numbers"), &format!("{count}")))
}

impl<'a> Array<'a> {
    /// Adds a part of the text between the tags; keys of information between two parts are left out.
    pub fn add(&mut self, text: &'a [u8]) {
        let (Content::Text(own) | Content::Base64(own)) = &mut self.content else {
            return;
        };
        if own.iter().all(u8::is_ascii_whitespace) {
            *own = Cow::Borrowed(text);
        } else if !text.iter().all(u8::is_ascii_whitespace) {
            own.to_mut().extend_from_slice(text);
        }
    }
}
