//! An unstructured grid of a VTK file, whichever syntax it is written in.

use std::fmt;

/// A number as a file stores it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Number {
    Signed(i64),
    Unsigned(u64),
    Real(f64),
}

impl Number {
    pub fn real(self) -> f64 {
        match self {
            Self::Signed(n) => n as f64,
            Self::Unsigned(n) => n as f64,
            Self::Real(x) => x,
        }
    }

    /// The number as an integer, if it is one that fits.
    pub fn integer(self) -> Option<i64> {
        match self {
            Self::Signed(n) => Some(n),
            Self::Unsigned(n) => i64::try_from(n).ok(),
            Self::Real(_) => None,
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Signed(n) => n.fmt(f),
            Self::Unsigned(n) => n.fmt(f),
            Self::Real(x) => x.fmt(f),
        }
    }
}

/// The type of the numbers of an array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Integer { bytes: usize, signed: bool },
    Real { bytes: usize },
}

impl Kind {
    /// Bytes of a number.
    pub fn bytes(self) -> usize {
        match self {
            Self::Integer { bytes, .. } | Self::Real { bytes } => bytes,
        }
    }

    pub fn is_integer(self) -> bool {
        matches!(self, Self::Integer { .. })
    }

    /// The number in `word`, which holds [`Kind::bytes`] bytes.
    pub fn number(self, word: &[u8], is_big_endian: bool) -> Number {
        let mut own = [0u8; 8];
        for (k, own) in own.iter_mut().enumerate().take(word.len()) {
            // the least significant byte first
            *own = match is_big_endian {
                true => word[word.len() - 1 - k],
                false => word[k],
            };
        }
        let bits = u64::from_le_bytes(own);
        match self {
            Self::Real { bytes: 4 } => Number::Real(f64::from(f32::from_bits(bits as u32))),
            Self::Real { .. } => Number::Real(f64::from_bits(bits)),
            Self::Integer { signed: false, .. } => Number::Unsigned(bits),
            Self::Integer {
                bytes,
                signed: true,
            } => {
                // the sign is in the highest bit of the word
                let above = 64 - 8 * bytes as u32;
                Number::Signed((bits << above) as i64 >> above)
            }
        }
    }

    /// A number written as text.
    pub fn parse(self, text: &str) -> Option<Number> {
        match self {
            Self::Real { .. } => text.parse().ok().map(Number::Real),
            Self::Integer { .. } => match text.parse() {
                Ok(n) => Some(Number::Signed(n)),
                Err(_) => text.parse().ok().map(Number::Unsigned),
            },
        }
    }
}

/// All points of a file with a number for each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Their coordinates.
    pub coordinates: Vec<[f64; 3]>,
    /// Their values.
    pub values: Vec<f64>,
}

/// The cells of a piece, and the points that they use.
#[derive(Debug, Default)]
pub(super) struct Grid {
    /// Byte where it stands in the file.
    pub at: usize,
    /// Points in the file.
    pub points: u64,
    /// VTK's number for the type of each cell.
    pub types: Vec<u8>,
    /// End of the nodes of each cell in `nodes`.
    pub ends: Vec<u64>,
    pub nodes: Vec<u64>,
    /// Integer arrays with a number per cell.
    pub cell_data: Vec<(String, Vec<i64>)>,
    /// The points that cells use, by their number, and their coordinates.
    pub(super) used: Vec<u64>,
    pub(super) coordinates: Vec<[f64; 3]>,
    /// Coordinates seen.
    pub(super) seen: u64,
}

impl Grid {
    /// A piece at a byte of the file, of so many points.
    pub fn new(at: usize, points: u64) -> Self {
        Self {
            at,
            points,
            ..Self::default()
        }
    }

    /// From here on coordinates follow; only those of points that cells use are kept, however many there are.
    pub fn begin_points(&mut self) {
        self.used.clone_from(&self.nodes);
        self.used.sort_unstable();
        self.used.dedup();
    }

    /// Takes the next coordinate: x, y, z of the first point, of the second one, and so on.
    pub fn push_coordinate(&mut self, x: f64) {
        let (point, axis) = (self.seen / 3, (self.seen % 3) as usize);
        self.seen += 1;
        let next = self.coordinates.len() - usize::from(axis > 0 && self.is_open());
        if self.used.get(next) == Some(&point) {
            if axis == 0 {
                self.coordinates.push([x, 0.0, 0.0]);
            } else {
                self.coordinates[next][axis] = x;
            }
        }
    }

    /// Returns true if the current point is one that is kept.
    pub(super) fn is_open(&self) -> bool {
        let last = self.coordinates.len().checked_sub(1);
        last.is_some_and(|k| self.used[k] == (self.seen - 1) / 3)
    }
}
