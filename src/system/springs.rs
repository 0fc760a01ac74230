//! Springs between sites and the ground: rows that are added to a stiffness.

use std::collections::BTreeMap;

use super::{BlockCsr, SharedRows};

/// The stiffness `S` of springs between sites and the ground \[N/m\]: symmetric, and no displacement has a negative energy.
///
/// Shapes: row `k` of `rows` is that of site `sites[k]`; sites ascend.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpringRows {
    sites: Vec<u32>,
    rows: BlockCsr,
}

impl SpringRows {
    /// From the blocks of pairs of sites, row-major.
    pub fn from_blocks(block: usize, blocks: &BTreeMap<(u32, u32), Vec<f64>>) -> Self {
        let mut own = Self {
            sites: Vec::new(),
            rows: BlockCsr {
                block,
                row_offsets: vec![0],
                ..BlockCsr::default()
            },
        };
        for (&(row, column), values) in blocks {
            if own.sites.last() != Some(&row) {
                own.sites.push(row);
                own.rows.row_offsets.push(own.rows.columns.len());
            }
            own.rows.columns.push(column);
            own.rows.values.extend(values);
            if let Some(end) = own.rows.row_offsets.last_mut() {
                *end = own.rows.columns.len();
            }
        }
        own
    }

    /// The sum of several.
    pub fn sum<'s>(block: usize, all: impl Iterator<Item = &'s Self>) -> Self {
        let mut blocks: BTreeMap<(u32, u32), Vec<f64>> = BTreeMap::new();
        for own in all {
            own.each(|row, columns, values| {
                for (&column, block) in columns.iter().zip(values.chunks_exact(block * block)) {
                    let sum = blocks.entry((row, column));
                    let sum = sum.or_insert_with(|| vec![0.0; block.len()]);
                    sum.iter_mut().zip(block).for_each(|(sum, b)| *sum += b);
                }
            });
        }
        match blocks.is_empty() {
            true => Self::default(),
            false => Self::from_blocks(block, &blocks),
        }
    }

    /// Returns true if there are none.
    pub fn is_empty(&self) -> bool {
        self.sites.is_empty()
    }

    /// Hands each row to `visit`: its site, its columns, its blocks.
    fn each<'s>(&'s self, mut visit: impl FnMut(u32, &'s [u32], &'s [f64])) {
        for (k, &site) in self.sites.iter().enumerate() {
            let (columns, blocks) = self.rows.row(k);
            visit(site, columns, blocks);
        }
    }

    /// `y += S x`.
    pub fn add_product(&self, x: &[f64], y: &mut [f64]) {
        let d = self.rows.block;
        self.each(|site, columns, blocks| {
            let y = &mut y[site as usize * d..][..d];
            for (&column, block) in columns.iter().zip(blocks.chunks_exact(d * d)) {
                let x = &x[column as usize * d..][..d];
                for (y, row) in y.iter_mut().zip(block.chunks_exact(d)) {
                    *y += row.iter().zip(x).map(|(s, x)| s * x).sum::<f64>();
                }
            }
        });
    }

    /// `½ uᵀ S u` \[J\].
    pub fn energy(&self, u: &[f64]) -> f64 {
        let mut force = vec![0.0; if self.is_empty() { 0 } else { u.len() }];
        self.add_product(u, &mut force);
        0.5 * u.iter().zip(&force).map(|(u, f)| u * f).sum::<f64>()
    }

    /// Adds the rows to a matrix with a row for each site; rows that share their blocks with others get their own.
    pub fn add_to(&self, matrix: &mut BlockCsr) {
        if self.is_empty() {
            return;
        }
        let own: Vec<u32> = (0..matrix.rows() as u32).collect();
        *matrix = self.added(matrix, &own);
    }

    /// The rows of a matrix, row `k` that of site `sites[k]`, with those of the springs added.
    pub fn added(&self, matrix: &BlockCsr, sites: &[u32]) -> BlockCsr {
        let size = matrix.block * matrix.block;
        let mut sum = BlockCsr {
            block: matrix.block,
            row_offsets: vec![0],
            // shared blocks stay where they are, rows of their own follow
            values: matrix
                .shared
                .as_ref()
                .map_or(Vec::new(), |_| matrix.values.clone()),
            shared: matrix.shared.as_ref().map(|_| SharedRows::default()),
            ..BlockCsr::default()
        };
        for (k, site) in sites.iter().enumerate() {
            let (columns, blocks) = matrix.row(k);
            let added = self.sites.binary_search(site).ok();
            let first = sum.values.len() / size;
            match added.map(|place| self.rows.row(place)) {
                Some(springs) => sum.merge_row((columns, blocks), springs, size),
                None => {
                    sum.columns.extend(columns);
                    if matrix.shared.is_none() {
                        sum.values.extend(blocks);
                    }
                }
            }
            if let (Some(shared), Some(before)) = (&mut sum.shared, &matrix.shared) {
                shared.starts.push(match added {
                    Some(_) => first,
                    None => before.starts[k],
                });
                let is_after_own = k > 0 && self.sites.binary_search(&sites[k - 1]).is_ok();
                shared
                    .follows
                    .push(before.follows[k] && added.is_none() && !is_after_own);
            }
            sum.row_offsets.push(sum.columns.len());
        }
        sum
    }

    /// Adds `Σ_b |S_ab|` to every scalar row's sum.
    pub(super) fn add_sums_to(&self, sums: &mut [f64]) {
        let d = self.rows.block;
        self.each(|site, _, blocks| {
            for block in blocks.chunks_exact(d * d) {
                let own = sums[site as usize * d..].iter_mut();
                for (sum, row) in own.zip(block.chunks_exact(d)) {
                    *sum += row.iter().map(|s| s.abs()).sum::<f64>();
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Springs of two sites, the second of which stands twice in the pattern.
    fn springs() -> SpringRows {
        let blocks = [
            ((1, 1), vec![2.0, 1.0, 1.0, 3.0]),
            ((1, 3), vec![0.5, 0.0, 0.0, 0.25]),
            ((3, 1), vec![0.5, 0.0, 0.0, 0.25]),
            ((3, 3), vec![4.0, 0.0, 0.0, 5.0]),
        ];
        SpringRows::from_blocks(2, &blocks.into_iter().collect())
    }

    fn matrix(shared: Option<SharedRows>) -> BlockCsr {
        // diagonal, with one entry beside it in the second row
        BlockCsr {
            block: 2,
            row_offsets: vec![0, 1, 3, 4, 5],
            columns: vec![0, 1, 2, 2, 3],
            values: match shared {
                None => [
                    [1.0, 0.0, 0.0, 1.0],
                    [7.0, 0.0, 0.0, 7.0],
                    [1.0, 2.0, 3.0, 4.0],
                    [1.0, 0.0, 0.0, 1.0],
                    [1.0, 0.0, 0.0, 1.0],
                ]
                .concat(),
                Some(_) => [
                    [1.0, 0.0, 0.0, 1.0],
                    [7.0, 0.0, 0.0, 7.0],
                    [1.0, 2.0, 3.0, 4.0],
                ]
                .concat(),
            },
            shared,
        }
    }

    #[test]
    fn a_matrix_with_springs_has_the_products_of_both() {
        let shared = SharedRows {
            starts: vec![0, 1, 0, 0],
            follows: vec![false, false, false, true],
        };
        let x: Vec<f64> = (0..8).map(|k| f64::from(k) - 2.5).collect();
        for of in [None, Some(shared)] {
            let plain = matrix(of);
            let mut wanted = plain.multiply(&x);
            springs().add_product(&x, &mut wanted);
            let mut sum = plain.clone();
            springs().add_to(&mut sum);
            assert_eq!(sum.multiply(&x), wanted);
            assert_eq!(sum.row(1).0, [1, 2, 3]);
            // bounds of the rows hold for the sum
            let mut sums = plain.row_sums();
            springs().add_sums_to(&mut sums);
            assert!(sum.row_sums().iter().zip(&sums).all(|(a, b)| a <= b));
        }
        let energy = springs().energy(&x);
        let mut force = vec![0.0; 8];
        springs().add_product(&x, &mut force);
        let work: f64 = x.iter().zip(&force).map(|(u, f)| u * f).sum();
        assert_eq!(energy, 0.5 * work);
    }
}
