//! The shares of the cells around a lattice point.

use std::collections::BTreeMap;

use super::{BoxCell, PartialVolume, PartialVolumeError};
use crate::{
    peridynamics::shell_weights::{LatticeFamily, Shell},
    tensor::Vector,
};

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

/// Names a bond of a lattice up to the lattice's symmetry: the magnitudes of its offsets, in order.
pub fn orbit<const D: usize>(offset: &[i32; D]) -> [u32; D] {
    let mut orbit = offset.map(i32::unsigned_abs);
    orbit.sort_unstable();
    orbit
}

/// The family of a lattice point with the share of each shell's cells.
///
/// Full volumes have one shell per length; the others tell apart bonds of one length whose cells the horizon cuts differently.
///
/// # Errors
/// [`PartialVolumeError::Ratio`] unless `ratio` lies between 1 and 1000.
pub fn lattice_shells<const D: usize>(
    algorithm: PartialVolume,
    ratio: f64,
    tie_tolerance: f64,
) -> Result<(LatticeFamily<D>, Vec<f64>), PartialVolumeError> {
    if algorithm == PartialVolume::Full {
        let lattice = LatticeFamily::<D>::new(ratio, tie_tolerance)
            .map_err(|_| PartialVolumeError::Ratio { ratio })?;
        let shares = vec![1.0; lattice.shells.len()];
        return Ok((lattice, shares));
    }
    // shells by length, then by orbit: their offsets, and the share of each
    let mut orbits = BTreeMap::new();
    for cell in lattice_cells::<D>(algorithm, ratio, tie_tolerance)? {
        let squared = cell
            .offset
            .iter()
            .map(|&k| u64::from(k.unsigned_abs()).pow(2));
        let key = (squared.sum::<u64>(), orbit(&cell.offset));
        let (offsets, share): &mut (Vec<[i32; D]>, f64) =
            orbits.entry(key).or_insert((Vec::new(), cell.share));
        offsets.push(cell.offset);
        // equal by symmetry, and to the last bit by this
        *share = share.min(cell.share);
    }
    let mut shells = Vec::with_capacity(orbits.len());
    let mut shares = Vec::with_capacity(orbits.len());
    for ((squared, _), (offsets, share)) in orbits {
        shells.push(Shell { squared, offsets });
        shares.push(share);
    }
    Ok((LatticeFamily { ratio, shells }, shares))
}
