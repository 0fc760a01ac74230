//! Least squares of a sparse matrix by conjugate gradients on the normal equations (CGLS, \[Bjorck1996\] section 7.4.1).

use rayon::prelude::*;

/// Columns of a sparse matrix.
#[derive(Default)]
pub(super) struct Columns {
    pub rows: usize,
    /// Where each column begins.
    pub offsets: Vec<usize>,
    pub entries: Vec<(u32, f64)>,
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

    fn column(&self, k: usize) -> &[(u32, f64)] {
        &self.entries[self.offsets[k]..self.offsets[k + 1]]
    }

    /// `y += A x`, of the rows that count.
    pub fn add_product(&self, x: &[f64], counts: &[bool], y: &mut [f64]) {
        for (k, x) in x.iter().enumerate() {
            for (row, a) in self.column(k) {
                if counts[*row as usize] {
                    y[*row as usize] += a * x;
                }
            }
        }
    }

    /// `S Aᵀ y`.
    fn transposed(&self, scale: &[f64], y: &[f64]) -> Vec<f64> {
        let columns = scale.par_iter().enumerate().with_min_len(256);
        let product = |(k, scale): (usize, &f64)| {
            let column = self.column(k).iter();
            scale * column.map(|(row, a)| a * y[*row as usize]).sum::<f64>()
        };
        columns.map(product).collect()
    }
}

/// Iterations at most.
const LONGEST: usize = 4000;

/// The least x that minimises `|A S x − b|² + damping² |x|²` over the rows that count, of columns that are scaled by S; b is zero in other rows. It ends where the residual of the normal equations is `tolerance` of that at the start.
pub(super) fn least_squares(
    a: &Columns,
    scale: &[f64],
    b: Vec<f64>,
    counts: &[bool],
    (damping, tolerance): (f64, f64),
) -> Vec<f64> {
    let mut residual = b;
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let mut x = vec![0.0; scale.len()];
    let mut gradient = a.transposed(scale, &residual);
    let mut direction = gradient.clone();
    let mut size = dot(&gradient, &gradient);
    let enough = size * tolerance * tolerance;
    for _ in 0..LONGEST {
        if size <= enough {
            break;
        }
        let mut image = vec![0.0; a.rows];
        let scaled: Vec<f64> = direction.iter().zip(scale).map(|(d, s)| d * s).collect();
        a.add_product(&scaled, counts, &mut image);
        let curvature = dot(&image, &image) + damping * damping * dot(&direction, &direction);
        let step = size / curvature;
        x.iter_mut()
            .zip(&direction)
            .for_each(|(x, d)| *x += step * d);
        residual
            .iter_mut()
            .zip(&image)
            .for_each(|(r, i)| *r -= step * i);
        gradient = a.transposed(scale, &residual);
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
