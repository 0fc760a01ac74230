//! Factors of sparse positive definite equations: normal equations of the conditions at a seam.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SparseColMat;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::{Conj, MatMut, Par, Side};

/// A sparse Cholesky factorisation on one thread, since its bits would depend on how many there are.
pub(crate) struct SparseFactors {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
}

impl SparseFactors {
    /// Of the lower half of a matrix; none if it is not positive definite, or there is no memory.
    pub fn new(matrix: &SparseColMat<usize, f64>) -> Option<Self> {
        let symbolic = symbolic(matrix)?;
        let mut values = Vec::new();
        values.try_reserve_exact(symbolic.len_val()).ok()?;
        values.resize(symbolic.len_val(), 0.0);
        let needed = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        symbolic
            .factorize_numeric_llt(
                &mut values,
                matrix.as_ref(),
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut MemBuffer::try_new(needed).ok()?),
                Default::default(),
            )
            .ok()?;
        Some(Self { symbolic, values })
    }

    /// The solution for a right-hand side.
    pub fn solved(&self, wanted: &[f64]) -> Vec<f64> {
        let mut solution = wanted.to_vec();
        let needed = self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq);
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(&mut solution, wanted.len(), 1),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(needed)),
        );
        solution
    }

    /// Entries that the factors of the lower half of a matrix have; none if they cannot be counted.
    pub fn entries(matrix: &SparseColMat<usize, f64>) -> Option<usize> {
        symbolic(matrix).map(|symbolic| symbolic.len_val())
    }
}

fn symbolic(matrix: &SparseColMat<usize, f64>) -> Option<SymbolicCholesky<usize>> {
    factorize_symbolic_cholesky(
        matrix.symbolic(),
        Side::Lower,
        SymmetricOrdering::Amd,
        CholeskySymbolicParams::default(),
    )
    .ok()
}
