//! Least squares of a sparse matrix by conjugate gradients on the normal equations (CGLS, \[Bjorck1996\] section 7.4.1).

use rayon::prelude::*;

/// Columns of a sparse matrix, and once they are all there its rows.
#[derive(Default)]
pub(super) struct Columns {
    pub rows: usize,
    /// Where each column begins.
    pub offsets: Vec<usize>,
    pub entries: Vec<(u32, f64)>,
    /// Where each row begins.
    of_rows: Vec<usize>,
    /// Columns and numbers of all rows.
    by_rows: Vec<(u32, f64)>,
}

impl Columns {
    pub fn new() -> Self {
        Self {
            offsets: vec![0],
            ..Self::default()
        }
    }

    /// Ends a column, whose entries were pushed.
    pub fn end(&mut self) {
        self.offsets.push(self.entries.len());
    }

    /// Ends the last column: products may follow.
    pub fn finish(&mut self) {
        let mut starts = vec![0; self.rows + 1];
        for (row, _) in &self.entries {
            starts[*row as usize + 1] += 1;
        }
        for r in 0..self.rows {
            starts[r + 1] += starts[r];
        }
        let mut next = starts.clone();
        self.by_rows = vec![(0, 0.0); self.entries.len()];
        for k in 0..self.offsets.len() - 1 {
            for &(row, a) in &self.entries[self.offsets[k]..self.offsets[k + 1]] {
                let place = &mut next[row as usize];
                self.by_rows[*place] = (k as u32, a);
                *place += 1;
            }
        }
        self.of_rows = starts;
    }

    /// A number of each row that counts, made of its entries; zero of others.
    fn of_each_row(
        &self,
        counts: &[bool],
        number: impl Fn(&[(u32, f64)]) -> f64 + Sync,
    ) -> Vec<f64> {
        let rows = (0..self.rows).into_par_iter().with_min_len(64);
        let of_row = |r: usize| match counts[r] {
            true => number(&self.by_rows[self.of_rows[r]..self.of_rows[r + 1]]),
            false => 0.0,
        };
        rows.map(of_row).collect()
    }

    /// `A x`, of the rows that count.
    pub fn product(&self, x: &[f64], counts: &[bool]) -> Vec<f64> {
        self.of_each_row(counts, |row| {
            row.iter().map(|(k, a)| a * x[*k as usize]).sum()
        })
    }

    /// `S Aᵀ y`.
    fn transposed(&self, scale: &[f64], y: &[f64]) -> Vec<f64> {
        let columns = scale.par_iter().enumerate().with_min_len(256);
        let product = |(k, scale): (usize, &f64)| {
            let column = self.entries[self.offsets[k]..self.offsets[k + 1]].iter();
            scale * column.map(|(row, a)| a * y[*row as usize]).sum::<f64>()
        };
        columns.map(product).collect()
    }

    /// One over the length of each row of `A S`, or over the smallest length if that is shorter.
    fn row_weights(&self, scale: &[f64], counts: &[bool], smallest: f64) -> Vec<f64> {
        self.of_each_row(counts, |row| {
            let square = |(k, a): &(u32, f64)| (a * scale[*k as usize]).powi(2);
            1.0 / row.iter().map(square).sum::<f64>().sqrt().max(smallest)
        })
    }
}

/// Iterations at most.
const LONGEST: usize = 4000;

/// The least x that minimises `|W (A S x − b)|² + damping² |x|²` over the rows that count, of columns that are scaled by S; b is zero in other rows. It ends where the
/// residual of the normal equations is `tolerance` of that at the start.
///
/// Without damping the weights W make rows of one length, all but those shorter than the `smallest`, which converges sooner and leaves a solution of `A S x = b` what it is; with it they are one.
pub(super) fn least_squares(
    (a, smallest): (&Columns, f64),
    scale: &[f64],
    b: Vec<f64>,
    counts: &[bool],
    (damping, tolerance): (f64, f64),
) -> Vec<f64> {
    let weights = match damping > 0.0 {
        true => vec![1.0; a.rows],
        false => a.row_weights(scale, counts, smallest),
    };
    let weighted = |mut values: Vec<f64>| {
        values.iter_mut().zip(&weights).for_each(|(v, w)| *v *= w);
        values
    };
    let mut residual = weighted(b);
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let mut x = vec![0.0; scale.len()];
    let mut gradient = a.transposed(scale, &weighted(residual.clone()));
    let mut direction = gradient.clone();
    let mut size = dot(&gradient, &gradient);
    let enough = size * tolerance * tolerance;
    for _ in 0..LONGEST {
        if size <= enough {
            break;
        }
        let scaled: Vec<f64> = direction.iter().zip(scale).map(|(d, s)| d * s).collect();
        let image = weighted(a.product(&scaled, counts));
        let curvature = dot(&image, &image) + damping * damping * dot(&direction, &direction);
        let step = size / curvature;
        x.iter_mut()
            .zip(&direction)
            .for_each(|(x, d)| *x += step * d);
        residual
            .iter_mut()
            .zip(&image)
            .for_each(|(r, i)| *r -= step * i);
        gradient = a.transposed(scale, &weighted(residual.clone()));
        if damping > 0.0 {
            let damped = gradient.iter_mut().zip(&x);
            damped.for_each(|(g, x)| *g -= damping * damping * x);
        }
        let next = dot(&gradient, &gradient);
        let share = next / size;
        let pairs = direction.iter_mut().zip(&gradient);
        pairs.for_each(|(d, g)| *d = g + share * *d);
        size = next;
    }
    x
}
