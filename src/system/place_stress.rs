//! The stress of a place, as a system gives it for output.

use crate::tensor::Tensor;

/// Cauchy stress of a site or a cell \[Pa\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaceStress {
    /// Its components within the body, padded with zeros.
    pub rows: [[f64; 3]; 3],
    /// The normal stress out of the plane of a long body; none where the law says nothing of it, and Poisson's ratio does.
    pub across: Option<f64>,
}

impl PlaceStress {
    /// Of a body of `D` dimensions.
    pub fn new<const D: usize>(tensor: &Tensor<D>, across: Option<f64>) -> Self {
        let entry = |i: usize, j: usize| if i < D && j < D { tensor[(i, j)] } else { 0.0 };
        Self {
            rows: std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j))),
            across,
        }
    }

    /// The components within a body of `D` dimensions.
    pub fn tensor<const D: usize>(&self) -> Tensor<D> {
        Tensor::from_fn(|i, j| self.rows[i][j])
    }
}
