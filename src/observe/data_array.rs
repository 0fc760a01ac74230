//! Numbers as text of a VTK XML file: blocks, compressed side by side, in base64.
//!
//! Source: the VTK XML formats, "binary" arrays with headers of type `UInt64`: plain, the number of bytes and the bytes in one run of base64; compressed, a run with the number of blocks, their
//! size, the size of the last one and what each was compressed to, then a run with the blocks.

use std::io::Write;

use crate::parallel;
use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::{Compression as Level, write::ZlibEncoder};

/// Storage of arrays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// As they are: about four times larger, about five times as fast to write.
    Plain,
    /// zlib at a low level; higher levels cost several times the time for a few per cent.
    #[default]
    Zlib,
}

/// Bytes per block: blocks are compressed side by side, so that there are some of them in an array of 10 000 numbers, and each is long enough to repay the set-up of a compressor.
const BLOCK: usize = 1 << 17;

/// Level of zlib.
const LEVEL: u32 = 1;

/// A type of numbers that VTK knows.
pub(super) trait Number: Copy + Sync {
    /// Name of the type in VTK.
    const TYPE: &'static str;

    /// Appends the bytes of a number, the lowest first.
    fn push(self, bytes: &mut Vec<u8>);
}

macro_rules! numbers {
    ($($number:ty: $name:literal),*) => {
        $(impl Number for $number {
            const TYPE: &'static str = $name;

            fn push(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        })*
    };
}

numbers!(f64: "Float64", i64: "Int64", i32: "Int32", u8: "UInt8");

/// The text of an array; the same bytes for any number of threads.
///
/// # Errors
/// None in practice: a compressor that writes to memory does not fail.
pub(super) fn encoded<T: Number>(
    numbers: &[T],
    compression: Compression,
) -> std::io::Result<String> {
    let block = BLOCK / size_of::<T>();
    let bytes = |numbers: &[T]| {
        let mut bytes = Vec::with_capacity(size_of_val(numbers));
        numbers.iter().for_each(|n| n.push(&mut bytes));
        bytes
    };
    let length = size_of_val(numbers) as u64;
    if compression == Compression::Plain {
        let mut all = length.to_le_bytes().to_vec();
        all.extend(bytes(numbers));
        return Ok(STANDARD.encode(all));
    }
    let blocks: Vec<Vec<u8>> = parallel::try_map(numbers.len().div_ceil(block), 1, |k| {
        let end = ((k + 1) * block).min(numbers.len());
        let mut encoder = ZlibEncoder::new(Vec::new(), Level::new(LEVEL));
        encoder.write_all(&bytes(&numbers[k * block..end]))?;
        encoder.finish()
    })?;
    let last = numbers.chunks(block).next_back().map_or(0, size_of_val);
    let header = [blocks.len() as u64, BLOCK as u64, last as u64];
    let sizes = blocks.iter().map(|b| b.len() as u64);
    let header: Vec<u8> = header
        .into_iter()
        .chain(sizes)
        .flat_map(u64::to_le_bytes)
        .collect();
    Ok(STANDARD.encode(header) + &STANDARD.encode(blocks.concat()))
}
