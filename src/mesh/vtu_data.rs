//! The data of arrays of VTU files: bytes as text or raw, headers, and blocks by zlib.

use std::io::{Error, ErrorKind, Read};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;

use crate::mesh::vtk_grid::Kind;

/// Storage of numbers in the file.
#[derive(Clone, Copy)]
pub(super) struct Storage {
    pub is_big_endian: bool,
    /// Bytes of a number in the header of an array.
    pub header: usize,
    pub is_compressed: bool,
}

/// The type of numbers that VTK calls `name`.
pub(super) fn kind(name: &str) -> Option<Kind> {
    let integer = |bytes, signed| Kind::Integer { bytes, signed };
    Some(match name {
        "Int8" => integer(1, true),
        "UInt8" => integer(1, false),
        "Int16" => integer(2, true),
        "UInt16" => integer(2, false),
        "Int32" => integer(4, true),
        "UInt32" => integer(4, false),
        "Int64" => integer(8, true),
        "UInt64" => integer(8, false),
        "Float32" => Kind::Real { bytes: 4 },
        "Float64" => Kind::Real { bytes: 8 },
        _ => return None,
    })
}

/// Stored bytes, one after the other.
pub(super) struct Data<'a> {
    text: &'a [u8],
    is_base64: bool,
    /// Decoded bytes that nobody has taken yet.
    decoded: Vec<u8>,
    taken: usize,
}

impl<'a> Data<'a> {
    pub fn raw(text: &'a [u8]) -> Self {
        Self {
            text,
            is_base64: false,
            decoded: Vec::new(),
            taken: 0,
        }
    }

    pub fn base64(text: &'a [u8]) -> Self {
        Self {
            is_base64: true,
            ..Self::raw(text)
        }
    }

    /// No more bytes than these can follow.
    fn at_most(&self) -> u64 {
        (self.text.len() + self.decoded.len() - self.taken) as u64
    }

    /// Decodes some more text. Where it is padded a part ends, for headers are encoded apart, and the next one follows.
    fn decode(&mut self) -> Result<(), Error> {
        let mut group = Vec::with_capacity(1 << 12);
        let mut end = self.text.len();
        for (k, &b) in self.text.iter().enumerate() {
            if b.is_ascii_whitespace() {
                continue;
            }
            let is_after_padding = group.len().is_multiple_of(4) && group.last() == Some(&b'=');
            if group.len() == 1 << 12 || is_after_padding {
                end = k;
                break;
            }
            group.push(b);
        }
        self.text = &self.text[end..];
        self.taken = 0;
        self.decoded.clear();
        STANDARD
            .decode_vec(&group, &mut self.decoded)
            .map_err(|e| Error::new(ErrorKind::InvalidData, format!("no base64 ({e})")))
    }
}

impl Read for Data<'_> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize, Error> {
        if !self.is_base64 {
            return self.text.read(out);
        }
        while self.taken == self.decoded.len() {
            if self.text.iter().all(u8::is_ascii_whitespace) {
                return Ok(0);
            }
            self.decode()?;
        }
        let count = out.len().min(self.decoded.len() - self.taken);
        out[..count].copy_from_slice(&self.decoded[self.taken..][..count]);
        self.taken += count;
        Ok(count)
    }
}

/// The bytes of an array, decompressed where they are compressed.
pub(super) struct Blocks<'d, 'a> {
    data: &'d mut Data<'a>,
    /// Compressed bytes of the blocks to come, the last one first; none where nothing is compressed.
    sizes: Option<Vec<u64>>,
    block: Option<ZlibDecoder<std::io::Cursor<Vec<u8>>>>,
}

impl<'d, 'a> Blocks<'d, 'a> {
    /// Reads the header, which has to announce `wanted` bytes.
    pub fn begin(data: &'d mut Data<'a>, storage: Storage, wanted: u64) -> Result<Self, Error> {
        let mut number = || -> Result<u64, Error> {
            let mut word = [0; 8];
            let word = &mut word[..storage.header];
            data.read_exact(word)?;
            let kind = Kind::Integer {
                bytes: storage.header,
                signed: false,
            };
            let value = kind.number(word, storage.is_big_endian).integer();
            Ok(value.map_or(u64::MAX, |v| v as u64))
        };
        let announces = |bytes: u64| match bytes == wanted {
            true => Ok(()),
            false => Err(Error::new(
                ErrorKind::InvalidData,
                format!("a header of {bytes} bytes"),
            )),
        };
        if !storage.is_compressed {
            announces(number()?)?;
            return Ok(Self {
                data,
                sizes: None,
                block: None,
            });
        }
        let count = number()?;
        if count == 0 {
            announces(0)?;
            return Ok(Self {
                data,
                sizes: Some(Vec::new()),
                block: None,
            });
        }
        let (whole, last) = (number()?, number()?);
        // the last block is whole where its size is given as 0
        let short = if last == 0 {
            0
        } else {
            whole.wrapping_sub(last)
        };
        let bytes = count.checked_mul(whole).and_then(|b| b.checked_sub(short));
        announces(bytes.unwrap_or(u64::MAX))?;
        let header = storage.header as u64;
        if count.saturating_mul(header) > data.at_most() {
            return Err(ErrorKind::UnexpectedEof.into());
        }
        let mut number = || -> Result<u64, Error> {
            let mut word = [0; 8];
            let word = &mut word[..storage.header];
            data.read_exact(word)?;
            let kind = Kind::Integer {
                bytes: storage.header,
                signed: false,
            };
            let value = kind.number(word, storage.is_big_endian).integer();
            Ok(value.map_or(u64::MAX, |v| v as u64))
        };
        let mut sizes: Vec<u64> = (0..count).map(|_| number()).collect::<Result<_, _>>()?;
        sizes.reverse();
        Ok(Self {
            data,
            sizes: Some(sizes),
            block: None,
        })
    }
}

impl Read for Blocks<'_, '_> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize, Error> {
        let Some(sizes) = &mut self.sizes else {
            return self.data.read(out);
        };
        loop {
            if let Some(block) = &mut self.block {
                let count = block.read(out)?;
                if count > 0 || out.is_empty() {
                    return Ok(count);
                }
            }
            let Some(size) = sizes.pop() else {
                return Ok(0);
            };
            if size > self.data.at_most() {
                return Err(ErrorKind::UnexpectedEof.into());
            }
            let mut bytes = vec![0; size as usize];
            self.data.read_exact(&mut bytes)?;
            self.block = Some(ZlibDecoder::new(std::io::Cursor::new(bytes)));
        }
    }
}
