//! A sparse matrix from its products with few vectors.
//!
//! Columns that share no row are found by one product: each of its numbers belongs to one of them. Columns are coloured so, greedily in their order, and a product is taken for each colour and unknown of a site \[CurtisPowellReid1974\].

use crate::solve::krylov::LinearMap;
use crate::system::BlockCsr;

/// Colours of the columns of a pattern.
#[derive(Debug)]
pub(super) struct Probes {
    /// Columns of each colour.
    columns: Vec<Vec<u32>>,
    /// The rows that have an entry in a column, and the number of that entry, column by column.
    entries: Vec<Vec<(u32, u32)>>,
}

impl Probes {
    /// Colours the columns of a square matrix.
    pub fn new(pattern: &BlockCsr) -> Self {
        let n = pattern.rows();
        let mut entries = vec![Vec::new(); n];
        for row in 0..n {
            for (k, &column) in pattern.row(row).0.iter().enumerate() {
                entries[column as usize].push((row as u32, k as u32));
            }
        }
        let mut colour = vec![usize::MAX; n];
        // the column for which a colour was last found to be taken
        let mut taken: Vec<usize> = Vec::new();
        let mut columns: Vec<Vec<u32>> = Vec::new();
        for column in 0..n {
            for &(row, _) in &entries[column] {
                for &other in pattern.row(row as usize).0 {
                    if let Some(mark) = taken.get_mut(colour[other as usize]) {
                        *mark = column;
                    }
                }
            }
            let free = taken.iter().position(|&mark| mark != column);
            let own = free.unwrap_or(columns.len());
            if own == columns.len() {
                taken.push(usize::MAX);
                columns.push(Vec::new());
            }
            colour[column] = own;
            columns[own].push(column as u32);
        }
        Self { columns, entries }
    }

    /// Number of products that a matrix takes.
    pub fn products(&self, block: usize) -> usize {
        self.columns.len() * block
    }

    /// The matrix of a map, on the entries of the pattern.
    pub fn matrix(&self, pattern: &BlockCsr, map: &dyn LinearMap) -> BlockCsr {
        let d = pattern.block;
        let mut values = vec![0.0; pattern.columns.len() * d * d];
        let (mut x, mut y) = (vec![0.0; pattern.dofs()], vec![0.0; pattern.dofs()]);
        for columns in &self.columns {
            for b in 0..d {
                columns.iter().for_each(|&c| x[c as usize * d + b] = 1.0);
                map.apply_into(&x, &mut y);
                for &c in columns {
                    x[c as usize * d + b] = 0.0;
                    for &(row, k) in &self.entries[c as usize] {
                        let start = (pattern.row_offsets[row as usize] + k as usize) * d * d;
                        for a in 0..d {
                            values[start + a * d + b] = y[row as usize * d + a];
                        }
                    }
                }
            }
        }
        BlockCsr {
            block: d,
            row_offsets: pattern.row_offsets.clone(),
            columns: pattern.columns.clone(),
            values,
            shared: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_comes_back_from_few_products() {
        // an unsymmetric pattern of a band and a few entries far off
        let (n, d) = (40, 2);
        let mut matrix = BlockCsr {
            block: d,
            row_offsets: vec![0],
            ..BlockCsr::default()
        };
        for row in 0..n as u32 {
            let band = row.saturating_sub(2)..(row + 3).min(n as u32);
            let far = (row % 7 == 3).then_some((row * 11) % n as u32);
            let mut columns: Vec<u32> = band.chain(far).collect();
            columns.sort_unstable();
            columns.dedup();
            for c in columns {
                matrix.columns.push(c);
                let entries = (0..d * d).map(|e| f64::from(row * 97 + c * 13) + e as f64);
                matrix.values.extend(entries);
            }
            matrix.row_offsets.push(matrix.columns.len());
        }
        let probes = Probes::new(&matrix);
        assert!(probes.products(d) < n, "{}", probes.products(d));
        struct Product<'a>(&'a BlockCsr);
        impl LinearMap for Product<'_> {
            fn apply_into(&self, x: &[f64], y: &mut [f64]) {
                self.0.multiply_into(x, y);
            }
        }
        let found = probes.matrix(&matrix, &Product(&matrix));
        assert_eq!(found.values, matrix.values);
    }
}
