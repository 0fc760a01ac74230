//! Some of many numbers, as ranges within chunks of fixed length: the numbers that loops over chunks traverse where a process has some sites only.

use std::ops::Range;

/// Marked places, as ranges in each chunk.
#[derive(Clone, Debug)]
pub struct Segments {
    /// Offset of the ranges of each chunk, and the end.
    starts: Vec<u32>,
    /// From the start of the chunk.
    ranges: Vec<Range<u32>>,
}

impl Segments {
    /// Of the marked places, in chunks of so many.
    pub fn of(marked: &[bool], chunk: usize) -> Self {
        let (mut starts, mut ranges) = (vec![0], Vec::new());
        for marked in marked.chunks(chunk) {
            let mut end = 0;
            for run in marked.chunk_by(|a, b| a == b) {
                let first = end;
                end += run.len() as u32;
                if run[0] {
                    ranges.push(first..end);
                }
            }
            starts.push(ranges.len() as u32);
        }
        Self { starts, ranges }
    }

    /// All of so many places.
    pub fn all(count: usize, chunk: usize) -> Self {
        Self::of(&vec![true; count], chunk)
    }

    /// None of so many places.
    pub fn none(count: usize, chunk: usize) -> Self {
        Self::of(&vec![false; count], chunk)
    }

    /// The ranges of a chunk, ascending, from its start.
    pub fn of_chunk(&self, chunk: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        let ranges = self.starts[chunk] as usize..self.starts[chunk + 1] as usize;
        let ranges = self.ranges[ranges].iter();
        ranges.map(|r| r.start as usize..r.end as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marked_places_are_those_of_the_ranges() {
        let marked: Vec<bool> = (0..103).map(|k| k * k % 7 < 3).collect();
        let segments = Segments::of(&marked, 10);
        let mut found = vec![false; marked.len()];
        for chunk in 0..11 {
            for range in segments.of_chunk(chunk) {
                found[chunk * 10..][range].fill(true);
            }
        }
        assert_eq!(found, marked);
        assert_eq!(Segments::none(20, 10).of_chunk(1).count(), 0);
        assert!(Segments::all(20, 10).of_chunk(1).eq(std::iter::once(0..10)));
    }
}
