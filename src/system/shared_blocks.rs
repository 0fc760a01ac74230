//! Rows that share their blocks.
//!
//! On a lattice every row far from a boundary has the same blocks, and so has every row of a regular mesh: stored once, a row costs its columns only,
//! 4 bytes instead of 36 (2D) or 76 (3D) per block, and a product reads the blocks from the cache.

use super::BlockCsr;

/// Rows of a [`BlockCsr`] that share their blocks.
///
/// Shapes: one entry per block row in each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SharedRows {
    /// First block of each row, counted in blocks from the start of the values.
    pub starts: Vec<usize>,
    /// True if a row has the blocks of the row before it and its columns plus one.
    pub follows: Vec<bool>,
}

/// Rows whose entries differ by at most this fraction of their largest one are the same row.
///
/// Bond vectors are differences of coordinates, so that rows that are equal in exact arithmetic differ by rounding: a bound as small as this
/// stores a few of them more than once (1 % of the memory with 480² points), and leaves forces in equilibrium to 1e-12 of those applied.
const SAME: f64 = 1e-14;

/// Rows of one length that a new row is compared with; a model without equal rows is found out by the first entries.
const CANDIDATES: usize = 64;

/// Distinct rows among those of one length, the one that was met last first.
#[derive(Clone, Debug, Default)]
struct Known {
    /// By row length: first block and largest entry.
    by_length: Vec<Vec<(usize, f64)>>,
}

impl Known {
    /// The first block of a row that equals `row`, or `None` after noting that `row` starts at block `next`.
    fn find(&mut self, values: &[f64], row: &[f64], size: usize, next: usize) -> Option<usize> {
        let length = row.len() / size;
        if self.by_length.len() <= length {
            self.by_length.resize(length + 1, Vec::new());
        }
        let known = &mut self.by_length[length];
        let same = |&(start, largest): &(usize, f64)| {
            let other = &values[start * size..][..row.len()];
            let bound = SAME * largest;
            // written so that a row with a NaN equals none
            row.iter().zip(other).all(|(a, b)| (a - b).abs() <= bound)
        };
        if let Some(k) = known.iter().position(same) {
            known[..=k].rotate_right(1);
            return Some(known[0].0);
        }
        let largest = row.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        known.truncate(CANDIDATES - 1);
        known.insert(0, (next, largest));
        None
    }
}

/// In place of the number of a distinct row: a row without blocks.
const EMPTY: u32 = u32::MAX;

/// Consecutive rows with the distinct ones among them, gathered by one task.
#[derive(Clone, Debug)]
pub struct RowBatch {
    size: usize,
    ends: Vec<usize>,
    columns: Vec<u32>,
    /// For each row its number among the distinct ones.
    distinct: Vec<u32>,
    follows: Vec<bool>,
    /// First block of each distinct row, and the end of the last.
    starts: Vec<usize>,
    values: Vec<f64>,
    known: Known,
}

impl RowBatch {
    /// No rows yet, of blocks of `block × block`.
    pub fn new(block: usize) -> Self {
        Self {
            size: block * block,
            ends: Vec::new(),
            columns: Vec::new(),
            distinct: Vec::new(),
            follows: Vec::new(),
            starts: vec![0],
            values: Vec::new(),
            known: Known::default(),
        }
    }

    /// Appends a row: its columns, ascending, and their blocks.
    pub fn push(&mut self, columns: &[u32], values: &[f64]) {
        if columns.is_empty() {
            // nothing to share; a start of its own would be that of the next distinct row
            self.distinct.push(EMPTY);
            self.follows.push(false);
            self.ends.push(self.columns.len());
            return;
        }
        let next = self.values.len() / self.size;
        let found = self.known.find(&self.values, values, self.size, next);
        let number = match found {
            Some(start) => self.starts.binary_search(&start).unwrap_or(0),
            None => {
                self.values.extend_from_slice(values);
                self.starts.push(next + columns.len());
                self.starts.len() - 2
            }
        } as u32;
        let last = self.ends.last().copied().unwrap_or(0);
        let before = &self.columns[last - columns.len().min(last)..last];
        self.follows.push(
            self.distinct.last() == Some(&number)
                && columns.iter().zip(before).all(|(c, b)| *c == b + 1),
        );
        self.distinct.push(number);
        self.columns.extend_from_slice(columns);
        self.ends.push(self.columns.len());
    }
}

/// A matrix in the making, batch by batch.
#[derive(Clone, Debug)]
pub struct GatheredRows {
    matrix: BlockCsr,
    shared: SharedRows,
    known: Known,
}

impl SharedRows {
    /// A matrix of `rows` rows in blocks of `block × block`, to be gathered from batches.
    pub fn gather(block: usize, rows: usize) -> GatheredRows {
        let mut row_offsets = Vec::with_capacity(rows + 1);
        row_offsets.push(0);
        GatheredRows {
            matrix: BlockCsr {
                block,
                row_offsets,
                ..BlockCsr::default()
            },
            shared: Self {
                starts: Vec::with_capacity(rows),
                follows: Vec::with_capacity(rows),
            },
            known: Known::default(),
        }
    }
}

impl GatheredRows {
    /// Appends the rows of a batch. The result depends on the batches and their order only.
    pub fn append(&mut self, batch: RowBatch) {
        let size = batch.size;
        let starts: Vec<usize> = batch
            .starts
            .windows(2)
            .map(|w| {
                let row = &batch.values[w[0] * size..w[1] * size];
                let next = self.matrix.values.len() / size;
                self.known
                    .find(&self.matrix.values, row, size, next)
                    .unwrap_or_else(|| {
                        self.matrix.values.extend_from_slice(row);
                        next
                    })
            })
            .collect();
        let before = self.matrix.columns.len();
        self.matrix
            .row_offsets
            .extend(batch.ends.iter().map(|e| before + e));
        self.matrix.columns.extend(batch.columns);
        self.shared
            .starts
            .extend(batch.distinct.iter().map(|&n| match n {
                EMPTY => 0,
                n => starts[n as usize],
            }));
        self.shared.follows.extend(batch.follows);
    }

    /// The matrix.
    pub fn finish(self) -> BlockCsr {
        let mut matrix = self.matrix;
        matrix.columns.shrink_to_fit();
        matrix.values.shrink_to_fit();
        matrix.shared = Some(self.shared);
        matrix
    }
}

impl BlockCsr {
    /// The same matrix with equal rows stored once.
    pub fn share(&self) -> Self {
        let mut gathered = SharedRows::gather(self.block, self.rows());
        for first in (0..self.rows()).step_by(256) {
            let mut batch = RowBatch::new(self.block);
            for i in first..(first + 256).min(self.rows()) {
                let (columns, blocks) = self.row(i);
                batch.push(columns, blocks);
            }
            gathered.append(batch);
        }
        gathered.finish()
    }

    /// The same matrix with blocks of its own for every row, in the order of its columns.
    pub fn unshare(&self) -> Self {
        let values = (0..self.rows())
            .flat_map(|i| self.row(i).1.iter().copied())
            .collect();
        Self {
            block: self.block,
            row_offsets: self.row_offsets.clone(),
            columns: self.columns.clone(),
            values,
            shared: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::solve::stencils::StencilGrid;

    #[test]
    fn rows_without_blocks_stay_empty() {
        let mut matrix = StencilGrid::rectangle(9, 7).bonds(2).unshare();
        // every third row loses its blocks, the first and the last among them
        let mut emptied = crate::system::BlockCsr {
            block: matrix.block,
            row_offsets: vec![0],
            ..Default::default()
        };
        for i in 0..matrix.rows() {
            let (columns, blocks) = matrix.row(i);
            if i % 3 != 0 {
                emptied.columns.extend(columns);
                emptied.values.extend(blocks);
            }
            emptied.row_offsets.push(emptied.columns.len());
        }
        matrix = emptied.share();
        let x: Vec<f64> = (0..matrix.dofs()).map(|k| (k as f64).sin()).collect();
        let (a, b) = (emptied.multiply(&x), matrix.multiply(&x));
        for (i, (a, b)) in a.iter().zip(&b).enumerate() {
            assert!((a - b).abs() <= 1e-12 * (1.0 + a.abs()), "{i}");
            assert!(!(i / matrix.block).is_multiple_of(3) || *b == 0.0, "{i}");
        }
    }

    #[test]
    fn shared_rows_are_those_of_the_matrix_and_have_its_products() {
        for lattice in [StencilGrid::rectangle(31, 29), StencilGrid::block(18, 9, 8)] {
            for matrix in [lattice.bonds(2), lattice.elements()] {
                let shared = matrix.share();
                assert!(shared.values.len() * 4 < matrix.values.len());
                let scale = matrix.values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
                let same = shared.unshare();
                assert_eq!(same.columns, matrix.columns);
                assert!(
                    same.values
                        .iter()
                        .zip(&matrix.values)
                        .all(|(a, b)| (a - b).abs() <= 1e-14 * scale)
                );
                let follows = shared
                    .shared
                    .as_ref()
                    .map_or(0, |s| s.follows.iter().filter(|f| **f).count());
                assert!(
                    follows > matrix.rows() / 4,
                    "{follows} of {}",
                    matrix.rows()
                );
                // the product goes along runs of rows, yet adds in the same order
                let x: Vec<f64> = (0..matrix.dofs())
                    .map(|k| ((k * 131) % 101) as f64 / 101.0 - 0.5)
                    .collect();
                assert_eq!(shared.multiply(&x), same.multiply(&x));
            }
        }
    }

    #[test]
    fn rows_that_differ_by_more_than_round_off_stay_apart() {
        let lattice = StencilGrid::rectangle(20, 20);
        let mut matrix = lattice.bonds(2);
        let middle = 4 * matrix.row_offsets[10 * 20 + 10];
        matrix.values[middle] *= 1.0 + 1e-9;
        let shared = matrix.share();
        assert_eq!(shared.unshare().values[middle], matrix.values[middle]);
        matrix.values[middle] = f64::NAN;
        assert!(matrix.share().unshare().values[middle].is_nan());
    }
}
