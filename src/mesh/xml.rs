//! The tags of an XML file, as far as VTK writes it: elements, attributes and text, one after the other, without a copy.
//!
//! A reader of XML in general would do; of those that depend on nothing else none stops at the byte where raw data begin.

use std::borrow::Cow;

/// Next item of a file.
#[derive(Debug, PartialEq)]
pub(super) enum Event<'a> {
    /// `<NAME …>`, or `<NAME …/>`, which ends where it begins.
    Start {
        tag: Tag<'a>,
        is_empty: bool,
    },
    /// `</NAME>`
    End(&'a [u8]),
    Text(&'a [u8]),
    /// The end of the file.
    Nothing,
}

/// A tag with its attributes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tag<'a> {
    pub name: &'a [u8],
    attributes: &'a [u8],
}

/// A place at which the text is no XML, and what is missing there.
pub(super) type Wrong = (usize, &'static str);

/// A file, and how far it has been read.
pub(super) struct Xml<'a> {
    pub bytes: &'a [u8],
    pub at: usize,
}

impl<'a> Xml<'a> {
    /// Reads on; declarations and comments are skipped.
    pub fn next(&mut self) -> Result<Event<'a>, Wrong> {
        loop {
            let rest = &self.bytes[self.at..];
            if rest.is_empty() {
                return Ok(Event::Nothing);
            }
            if rest[0] != b'<' {
                let length = rest.iter().position(|&b| b == b'<').unwrap_or(rest.len());
                self.at += length;
                return Ok(Event::Text(&rest[..length]));
            }
            let passed = [("<?", "?>"), ("<!--", "-->"), ("<!", ">")];
            if let Some((_, end)) = passed
                .iter()
                .find(|(begin, _)| rest.starts_with(begin.as_bytes()))
            {
                self.at += self.until(end)? + end.len();
                continue;
            }
            let length = self.end_of_tag()?;
            let inner = &rest[1..length];
            let begin = self.at;
            self.at += length + 1;
            if let Some(name) = inner.strip_prefix(b"/") {
                return Ok(Event::End(name.trim_ascii()));
            }
            let (inner, is_empty) = match inner.strip_suffix(b"/") {
                Some(inner) => (inner, true),
                None => (inner, false),
            };
            let name = inner
                .iter()
                .position(u8::is_ascii_whitespace)
                .unwrap_or(inner.len());
            let (name, attributes) = inner.split_at(name);
            if !name
                .first()
                .is_some_and(|b| b.is_ascii_alphabetic() || *b == b'_')
            {
                return Err((begin, "the name of a tag"));
            }
            return Ok(Event::Start {
                tag: Tag { name, attributes },
                is_empty,
            });
        }
    }

    /// Distance to `end` in bytes.
    fn until(&self, end: &'static str) -> Result<usize, Wrong> {
        let rest = &self.bytes[self.at..];
        let found = rest.windows(end.len()).position(|w| w == end.as_bytes());
        found.ok_or((self.at, end))
    }

    /// Distance to the end of the tag that begins here; `>` within quotes belongs to a value.
    fn end_of_tag(&self) -> Result<usize, Wrong> {
        let mut quote = None;
        for (k, &b) in self.bytes[self.at..].iter().enumerate().skip(1) {
            match (quote, b) {
                (None, b'>') => return Ok(k),
                (None, b'<') => return Err((self.at + k, "`>` before the next tag")),
                (None, b'"' | b'\'') => quote = Some(b),
                (Some(q), b) if q == b => quote = None,
                _ => {}
            }
        }
        Err((self.at, "`>` at the end of a tag"))
    }
}

impl<'a> Tag<'a> {
    /// The value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<Cow<'a, str>> {
        let mut rest = self.attributes;
        loop {
            let equals = rest.iter().position(|&b| b == b'=')?;
            let (key, value) = (
                rest[..equals].trim_ascii(),
                rest[equals + 1..].trim_ascii_start(),
            );
            let (&quote, value) = value.split_first()?;
            if quote != b'"' && quote != b'\'' {
                return None;
            }
            let end = value.iter().position(|&b| b == quote)?;
            if key == name.as_bytes() {
                return std::str::from_utf8(&value[..end]).ok().map(plain);
            }
            rest = &value[end + 1..];
        }
    }
}

/// A value without entities.
fn plain(text: &str) -> Cow<'_, str> {
    if !text.contains('&') {
        return Cow::Borrowed(text);
    }
    let text = text.replace("&lt;", "<").replace("&gt;", ">");
    let text = text.replace("&quot;", "\"").replace("&apos;", "'");
    Cow::Owned(text.replace("&amp;", "&"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_come_in_order_with_their_attributes() {
        let bytes = b"<?xml version='1.0'?><!-- a > b --><A x=\"1 > 0\" y = 'a &amp; &quot;b&quot;'>text<B/></A>";
        let mut xml = Xml { bytes, at: 0 };
        let Ok(Event::Start {
            tag,
            is_empty: false,
        }) = xml.next()
        else {
            panic!("a tag")
        };
        assert_eq!(tag.name, b"A");
        assert_eq!(tag.attribute("x").as_deref(), Some("1 > 0"));
        assert_eq!(tag.attribute("y").as_deref(), Some("a & \"b\""));
        assert_eq!(tag.attribute("z"), None);
        assert_eq!(xml.next(), Ok(Event::Text(b"text")));
        assert!(matches!(
            xml.next(),
            Ok(Event::Start { is_empty: true, .. })
        ));
        assert_eq!(xml.next(), Ok(Event::End(b"A")));
        assert_eq!(xml.next(), Ok(Event::Nothing));
        for wrong in ["<A x='", "<A <B>", "<>", "<!-- ", "< A>", "<?xml"] {
            assert!(
                Xml {
                    bytes: wrong.as_bytes(),
                    at: 0
                }
                .next()
                .is_err(),
                "{wrong}"
            );
        }
    }
}
