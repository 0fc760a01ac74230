//! Sparse rows: transfer rows that express a place through sites, and the accumulator of one stiffness row.

use rayon::prelude::*;

use crate::{
    system::BlockCsr,
    tensor::{Tensor, Vector},
};

/// Expresses the displacement of places through the displacements of sites, `u(place) = Σ w u(site)`.
///
/// A place that is a site itself has one weight, 1. The weights of every row add up to 1 and reproduce affine fields,
/// which is what carries a patch test through the seam.
#[derive(Clone, Debug, Default)]
pub struct Transfer {
    offsets: Vec<usize>,
    sites: Vec<u32>,
    weights: Vec<f64>,
}

impl Transfer {
    /// A transfer without rows.
    pub fn new() -> Self {
        Self {
            offsets: vec![0],
            ..Self::default()
        }
    }

    /// A transfer from its rows.
    pub fn from_rows(rows: impl IntoIterator<Item = Vec<(u32, f64)>>) -> Self {
        let mut transfer = Self::new();
        for row in rows {
            transfer.push(&row);
        }
        transfer
    }

    /// Appends a row; entries for the same site are added, zero weights dropped.
    pub fn push(&mut self, row: &[(u32, f64)]) {
        let mut row: Vec<_> = row.iter().copied().filter(|&(_, w)| w != 0.0).collect();
        row.sort_by_key(|&(site, _)| site);
        let start = self.sites.len();
        for (site, weight) in row {
            if self.sites.len() > start && self.sites.last() == Some(&site) {
                if let Some(last) = self.weights.last_mut() {
                    *last += weight;
                }
            } else {
                self.sites.push(site);
                self.weights.push(weight);
            }
        }
        self.offsets.push(self.sites.len());
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Whether there is no place.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sites and weights of a place; none for a place that no equation uses.
    pub fn row(&self, place: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let range = self.offsets[place]..self.offsets[place + 1];
        self.sites[range.clone()]
            .iter()
            .copied()
            .zip(self.weights[range].iter().copied())
    }

    /// Number of stored weights.
    pub fn weight_count(&self) -> usize {
        self.sites.len()
    }

    /// The displacement of a place; `u` holds `D` numbers per site.
    pub fn displacement<const D: usize>(&self, place: usize, u: &[f64]) -> Vector<D> {
        let mut sum = Vector::zeros();
        for (site, weight) in self.row(place) {
            for a in 0..D {
                sum[a] += weight * u[site as usize * D + a];
            }
        }
        sum
    }
}

/// Accumulates one block row of the stiffness; sparse, reused from row to row.
pub struct Row<const D: usize> {
    slot: Vec<u32>,
    columns: Vec<u32>,
    blocks: Vec<Tensor<D>>,
}

const EMPTY: u32 = u32::MAX;

impl<const D: usize> Row<D> {
    /// An empty row of a system of `sites` sites.
    pub fn new(sites: usize) -> Self {
        Self {
            slot: vec![EMPTY; sites],
            columns: Vec::new(),
            blocks: Vec::new(),
        }
    }

    /// Adds `block · u(site)` to the row.
    #[inline]
    pub fn add_site(&mut self, site: u32, block: &Tensor<D>) {
        let slot = self.slot[site as usize];
        if slot == EMPTY {
            self.slot[site as usize] = self.columns.len() as u32;
            self.columns.push(site);
            self.blocks.push(*block);
        } else {
            self.blocks[slot as usize] += block;
        }
    }

    /// Adds `block · u(place)` to the row, the place being expressed through sites.
    #[inline]
    pub fn add(&mut self, transfer: &Transfer, place: usize, block: &Tensor<D>) {
        for (site, weight) in transfer.row(place) {
            if weight == 1.0 {
                self.add_site(site, block);
            } else {
                self.add_site(site, &(block * weight));
            }
        }
    }

    /// The row times each of `u` (`D` numbers per site), which empties it: for rows that are needed once, without a matrix.
    pub fn take_products<const N: usize>(&mut self, u: [&[f64]; N]) -> [Vector<D>; N] {
        let mut sums = [Vector::zeros(); N];
        for (&column, block) in self.columns.iter().zip(&self.blocks) {
            let start = column as usize * D;
            for (sum, u) in sums.iter_mut().zip(u) {
                *sum += block * Vector::<D>::from_column_slice(&u[start..start + D]);
            }
            self.slot[column as usize] = EMPTY;
        }
        self.columns.clear();
        self.blocks.clear();
        sums
    }

    /// Empties the row into sorted columns and row-major blocks.
    fn drain_into(&mut self, columns: &mut Vec<u32>, values: &mut Vec<f64>) {
        let mut order: Vec<u32> = (0..self.columns.len() as u32).collect();
        order.sort_unstable_by_key(|&e| self.columns[e as usize]);
        for e in order {
            let site = self.columns[e as usize];
            self.slot[site as usize] = EMPTY;
            columns.push(site);
            let block = &self.blocks[e as usize];
            for a in 0..D {
                for b in 0..D {
                    values.push(block[(a, b)]);
                }
            }
        }
        self.columns.clear();
        self.blocks.clear();
    }
}

/// Assembles a block matrix row by row, in parallel; the same bits for any number of threads.
pub fn assemble<const D: usize>(
    sites: usize,
    advance: impl Fn(u64) + Sync,
    add_row: impl Fn(usize, &mut Row<D>) + Sync,
) -> BlockCsr {
    const CHUNK: usize = 256;
    let chunks: Vec<(Vec<usize>, Vec<u32>, Vec<f64>)> = (0..sites.div_ceil(CHUNK))
        .into_par_iter()
        .map_init(
            || Row::<D>::new(sites),
            |row, chunk| {
                let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(sites);
                let (mut lengths, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
                let count = range.len() as u64;
                for site in range {
                    let before = columns.len();
                    add_row(site, row);
                    row.drain_into(&mut columns, &mut values);
                    lengths.push(columns.len() - before);
                }
                advance(count);
                (lengths, columns, values)
            },
        )
        .collect();
    let entries = chunks.iter().map(|c| c.1.len()).sum();
    let mut matrix = BlockCsr {
        block: D,
        row_offsets: Vec::with_capacity(sites + 1),
        columns: Vec::with_capacity(entries),
        values: Vec::with_capacity(entries * D * D),
    };
    matrix.row_offsets.push(0);
    let mut total = 0;
    for (lengths, columns, values) in chunks {
        for length in lengths {
            total += length;
            matrix.row_offsets.push(total);
        }
        matrix.columns.extend(columns);
        matrix.values.extend(values);
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_the_sum_of_its_weights() {
        let transfer = Transfer::from_rows([
            vec![(3, 0.25), (1, 0.5), (3, 0.25), (0, 0.0)],
            vec![],
            vec![(2, 1.0)],
        ]);
        assert_eq!(transfer.len(), 3);
        assert_eq!(transfer.row(0).collect::<Vec<_>>(), [(1, 0.5), (3, 0.5)]);
        assert_eq!(transfer.row(1).count(), 0);
        let u = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
        assert_eq!(
            transfer.displacement::<2>(0, &u),
            Vector::<2>::new(5.0, 6.0)
        );
        assert_eq!(
            transfer.displacement::<2>(2, &u),
            Vector::<2>::new(5.0, 6.0)
        );
    }

    #[test]
    fn rows_are_sorted_summed_and_reused() {
        let transfer = Transfer::from_rows([vec![(5, 0.5), (1, 0.5)]]);
        let matrix = assemble::<2>(
            600,
            |_| {},
            |site, row| {
                row.add(&transfer, 0, &(Tensor::identity() * site as f64));
                row.add_site(site as u32, &Tensor::<2>::new(1.0, 2.0, 3.0, 4.0));
                row.add_site(site as u32, &Tensor::<2>::new(1.0, 2.0, 3.0, 4.0));
            },
        );
        assert_eq!(matrix.rows(), 600);
        let (columns, blocks) = matrix.row(7);
        assert_eq!(columns, [1, 5, 7]);
        assert_eq!(blocks[..4], [3.5, 0.0, 0.0, 3.5]);
        assert_eq!(blocks[8..], [2.0, 4.0, 6.0, 8.0]);
        assert_eq!(matrix.row(1).0, [1, 5]);
        assert_eq!(matrix.row(1).1[..4], [2.5, 4.0, 6.0, 8.5]);
    }
}
