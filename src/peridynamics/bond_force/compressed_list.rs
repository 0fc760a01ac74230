//! Neighbours and weights of the bonds of a list, in few bytes.

use std::ops::Range;

use super::simd::LANES;

/// Numbers of the neighbours, family by family and ascending within each.
pub(super) enum Neighbours {
    /// No family spans more numbers than two bytes count: that of its first neighbour, and how far beyond it each lies.
    Near { first: Vec<u32>, beyond: Vec<u16> },
    /// Four bytes each.
    Far(Vec<u32>),
}

impl Neighbours {
    /// Packs families; point `i` has the neighbours `offsets[i]..offsets[i + 1]`.
    pub fn new(offsets: &[usize], neighbours: &[u32]) -> Self {
        let families = || offsets.windows(2).map(|w| &neighbours[w[0]..w[1]]);
        let first: Vec<u32> = families()
            .map(|f| f.first().copied().unwrap_or(0))
            .collect();
        let spans = |f: &[u32]| f.last().map_or(0, |last| last - f[0]);
        if families().any(|f| spans(f) > u32::from(u16::MAX)) {
            return Self::Far(neighbours.to_vec());
        }
        let near = families().zip(&first);
        Self::Near {
            beyond: near
                .flat_map(|(f, first)| f.iter().map(move |j| (j - first) as u16))
                .collect(),
            first,
        }
    }

    /// The neighbour of point `i` at the other end of a bond.
    #[inline(always)]
    pub fn get(&self, i: usize, bond: usize) -> usize {
        match self {
            Self::Near { first, beyond } => first[i] as usize + usize::from(beyond[bond]),
            Self::Far(neighbours) => neighbours[bond] as usize,
        }
    }

    /// The neighbours of point `i` at the other ends of at most eight bonds; `i` itself beyond.
    #[inline(always)]
    pub fn eight(&self, i: usize, bonds: Range<usize>) -> [usize; LANES] {
        let mut eight = [i; LANES];
        match self {
            Self::Near { first, beyond } => {
                let first = first[i] as usize;
                for (j, b) in eight.iter_mut().zip(&beyond[bonds]) {
                    *j = first + usize::from(*b);
                }
            }
            Self::Far(neighbours) => {
                for (j, n) in eight.iter_mut().zip(&neighbours[bonds]) {
                    *j = *n as usize;
                }
            }
        }
        eight
    }

    /// The place of `j` in the family of `i`, which has these bonds.
    pub fn place(&self, i: usize, bonds: Range<usize>, j: usize) -> Option<usize> {
        match self {
            Self::Near { first, beyond } => {
                let wanted = j.checked_sub(first[i] as usize)?;
                let wanted = u16::try_from(wanted).ok()?;
                beyond[bonds].binary_search(&wanted).ok()
            }
            Self::Far(neighbours) => neighbours[bonds].binary_search(&(j as u32)).ok(),
        }
    }

    pub fn memory_bytes(&self) -> usize {
        match self {
            Self::Near { first, beyond } => first.len() * 4 + beyond.len() * 2,
            Self::Far(neighbours) => neighbours.len() * 4,
        }
    }
}

/// Bond weights.
pub(super) enum Weights {
    Double(Vec<f64>),
    Single(Vec<f32>),
}

impl Weights {
    #[inline(always)]
    pub fn get(&self, bond: usize) -> f64 {
        match self {
            Self::Double(w) => w[bond],
            Self::Single(w) => f64::from(w[bond]),
        }
    }

    /// Those of at most eight bonds, zero beyond.
    #[inline(always)]
    pub fn eight(&self, bonds: Range<usize>) -> [f64; LANES] {
        let mut eight = [0.0; LANES];
        match self {
            Self::Double(w) => eight[..bonds.len()].copy_from_slice(&w[bonds]),
            Self::Single(w) => {
                for (e, w) in eight.iter_mut().zip(&w[bonds]) {
                    *e = f64::from(*w);
                }
            }
        }
        eight
    }

    pub fn memory_bytes(&self) -> usize {
        match self {
            Self::Double(w) => w.len() * 8,
            Self::Single(w) => w.len() * 4,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_what_they_were_in_two_bytes_and_in_four() {
        // the second family spans one number more than two bytes count, or just as many
        for (far, bytes) in [(70_000 + 65_536, 4 * 5), (70_000 + 65_535, 4 * 4 + 2 * 5)] {
            let offsets = [0, 2, 2, 4, 5];
            let neighbours = [3, 900, 70_000, far, 7];
            let packed = Neighbours::new(&offsets, &neighbours);
            assert_eq!(packed.memory_bytes(), bytes);
            for i in 0..4 {
                let bonds = offsets[i]..offsets[i + 1];
                for (k, bond) in bonds.clone().enumerate() {
                    let j = neighbours[bond] as usize;
                    assert_eq!(packed.get(i, bond), j);
                    assert_eq!(packed.place(i, bonds.clone(), j), Some(k));
                }
                for other in [0, 8, 65_543, 70_001, 200_000] {
                    assert_eq!(packed.place(i, bonds.clone(), other), None);
                }
            }
        }
    }
}
