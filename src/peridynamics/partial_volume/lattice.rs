//! The shares of the cells around a lattice point.

use super::{BoxCell, PartialVolume, PartialVolumeError};
use crate::tensor::Vector;

/// A cell of a lattice seen from the lattice point at the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticeCell<const D: usize> {
    /// Integer offset of its middle, in spacings.
    pub offset: [i32; D],
    /// Share of its volume that counts.
    pub share: f64,
}

/// The cells with a share, except the origin's own, in lexicographic order of their offsets; `ratio` is `m = δ/h`.
///
/// # Errors
/// [`PartialVolumeError::Ratio`] unless `ratio` lies between 1 and 1000.
pub fn lattice_cells<const D: usize>(
    algorithm: PartialVolume,
    ratio: f64,
    tie_tolerance: f64,
) -> Result<Vec<LatticeCell<D>>, PartialVolumeError> {
    if !(1.0..=1000.0).contains(&(ratio * (1.0 + tie_tolerance))) {
        return Err(PartialVolumeError::Ratio { ratio });
    }
    let n = (ratio + 0.5 + tie_tolerance * ratio).ceil() as i32;
    let mut cells = Vec::new();
    let mut k = [-n; D];
    loop {
        let point = Vector::<D>::from_fn(|a, _| f64::from(k[a]));
        if let Some(cell) = BoxCell::cube(point, 1.0).filter(|_| k.iter().any(|&c| c != 0)) {
            let share = algorithm.share(&Vector::zeros(), ratio, &point, &cell, tie_tolerance);
            if share > 0.0 {
                cells.push(LatticeCell { offset: k, share });
            }
        }
        let Some(axis) = (0..D).rev().find(|&a| k[a] < n) else {
            return Ok(cells);
        };
        k[axis] += 1;
        k[axis + 1..].fill(-n);
    }
}
