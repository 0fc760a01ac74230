//! Factors of normal equations.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor as llt;
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::{MatMut, MatRef, Par};

/// The Cholesky factor of a dense matrix, `L Lᵀ`.
pub(super) struct Dense {
    rows: usize,
    /// Column-major; what is above the diagonal has no meaning.
    lower: Vec<f64>,
}

impl Dense {
    /// Factorises a matrix of so many rows, by its lower triangle, column after column; none if it is not positive.
    pub fn new(rows: usize, mut matrix: Vec<f64>) -> Option<Self> {
        // by one thread: the same bits for any number of them
        let mut memory = MemBuffer::new(llt::cholesky_in_place_scratch::<f64>(
            rows,
            Par::Seq,
            Default::default(),
        ));
        llt::cholesky_in_place(
            MatMut::from_column_major_slice_mut(&mut matrix, rows, rows),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .ok()?;
        Some(Self {
            rows,
            lower: matrix,
        })
    }

    /// Solves for one right side.
    pub fn solved(&self, wanted: &[f64]) -> Vec<f64> {
        let mut solution = wanted.to_vec();
        let lower = MatRef::from_column_major_slice(&self.lower, self.rows, self.rows);
        let mut of = MatMut::from_column_major_slice_mut(&mut solution, self.rows, 1);
        solve_lower_triangular_in_place(lower, of.as_mut(), Par::Seq);
        solve_upper_triangular_in_place(lower.transpose(), of, Par::Seq);
        solution
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_solves() {
        // [4 2; 2 5] [1; 2] = [8; 12]
        let x = Dense::new(2, vec![4.0, 2.0, f64::NAN, 5.0]).map(|f| f.solved(&[8.0, 12.0]));
        let x = x.unwrap();
        assert!((x[0] - 1.0).abs() < 1e-15 && (x[1] - 2.0).abs() < 1e-15);
        assert!(Dense::new(2, vec![1.0, 2.0, 2.0, 1.0]).is_none());
    }
}
