//! Numbers and lines of a Gmsh file, in text or binary.

use super::Reader;
use crate::mesh::MeshError;
use crate::mesh::raw::Encoding;

impl<'a> Reader<'a> {
    pub(super) fn point(&mut self) -> Result<[f64; 3], MeshError> {
        let mut x = [0.0; 3];
        for x in &mut x {
            *x = self.double("a coordinate of a node")?;
        }
        Ok(x)
    }

    /// An `int` of the format.
    pub(super) fn integer(&mut self, wanted: &str) -> Result<i64, MeshError> {
        if self.source.encoding == Encoding::Text {
            return self.number(wanted);
        }
        let n = i32::from_ne_bytes(self.bytes(wanted)?);
        Ok(i64::from(if self.swapped { n.swap_bytes() } else { n }))
    }

    /// A `size_t` of the format.
    pub(super) fn size(&mut self, wanted: &str) -> Result<usize, MeshError> {
        if self.source.encoding == Encoding::Text {
            return self.number(wanted);
        }
        if self.size_bytes == 4 {
            let n = u32::from_ne_bytes(self.bytes(wanted)?);
            return Ok(if self.swapped { n.swap_bytes() } else { n } as usize);
        }
        let n = u64::from_ne_bytes(self.bytes(wanted)?);
        Ok(if self.swapped { n.swap_bytes() } else { n } as usize)
    }

    pub(super) fn double(&mut self, wanted: &str) -> Result<f64, MeshError> {
        if self.source.encoding == Encoding::Text {
            return self.number(wanted);
        }
        let n = u64::from_ne_bytes(self.bytes(wanted)?);
        Ok(f64::from_bits(if self.swapped {
            n.swap_bytes()
        } else {
            n
        }))
    }

    pub(super) fn bytes<const N: usize>(&mut self, wanted: &str) -> Result<[u8; N], MeshError> {
        match self.source.bytes[self.at..].first_chunk::<N>() {
            Some(chunk) => {
                self.at += N;
                Ok(*chunk)
            }
            None => Err(self.truncated(wanted)),
        }
    }

    /// The next word of a text file as a number.
    pub(super) fn number<T: std::str::FromStr>(&mut self, wanted: &str) -> Result<T, MeshError> {
        let start = self.next_at();
        let rest = &self.source.bytes[start..];
        let length = rest
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(rest.len());
        if length == 0 {
            self.at = start;
            return Err(self.truncated(wanted));
        }
        let word = String::from_utf8_lossy(&rest[..length]);
        match word.parse() {
            Ok(value) => {
                self.at = start + length;
                Ok(value)
            }
            Err(_) => Err(self.syntax_at(start, &word, wanted)),
        }
    }

    /// Position of the next entry: in text after blanks and line ends.
    pub(super) fn next_at(&self) -> usize {
        if self.source.encoding == Encoding::Binary {
            return self.at;
        }
        self.source.next(self.at)
    }

    pub(super) fn skip_space(&mut self) {
        self.at = self.source.next(self.at);
    }

    /// The rest of the line, trimmed; what is not UTF-8 reads as nothing.
    pub(super) fn line(&mut self) -> &'a str {
        let (text, next) = self.source.line(self.at);
        self.at = next;
        text
    }
}
