//! Fields from one set of sites to another: kept where a site stays, fitted by a cubic where it is new.

use std::collections::HashMap;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use bondline::{model::Bins, tensor::Vector};

/// Monomials up to the third degree.
const TERMS: usize = 10;
/// Sites of a fit at least; fewer than twice the terms leave it no choice.
const SITES: usize = 20;
/// Sum of the magnitudes of the weights beyond which a fit extrapolates, and more sites are asked for.
const LARGEST: f64 = 2.5;
/// Positions of sites times this are whole numbers.
const KEY: f64 = 64.0;

/// The sites that have a field.
pub struct Scattered<'a> {
    positions: &'a [Vector<2>],
    bins: Bins<2>,
    numbers: HashMap<[i64; 2], usize>,
}

fn key(x: &Vector<2>) -> [i64; 2] {
    std::array::from_fn(|i| (x[i] * KEY).round() as i64)
}

impl<'a> Scattered<'a> {
    /// Sites at positions that are multiples of 1/64, at distances of 1 and less.
    pub fn new(positions: &'a [Vector<2>]) -> Self {
        Self {
            bins: Bins::new(positions, 1.0),
            numbers: positions
                .iter()
                .enumerate()
                .map(|(k, x)| (key(x), k))
                .collect(),
            positions,
        }
    }

    /// The sites, with weights, that a field at `x` follows: the site there, or those of the smallest ball that determines a cubic well.
    ///
    /// The weights are those of least squares with a Gaussian weight, hence exact for cubics. At the edge of the plate, where all fits extrapolate, those of the smallest magnitude; empty if no ball within
    /// five cells determines a cubic.
    pub fn weights(&self, x: &Vector<2>) -> Vec<(usize, f64)> {
        if let Some(&site) = self.numbers.get(&key(x)) {
            return vec![(site, 1.0)];
        }
        let mut radius = 0.6;
        let (mut best, mut smallest) = (Vec::new(), f64::INFINITY);
        while radius < 5.0 {
            let mut near: Vec<(usize, Vector<2>)> = self
                .bins
                .around(x, radius)
                .map(|k| (k, self.positions[k] - x))
                .filter(|(_, d)| d.norm() < radius)
                .collect();
            // the same order of sums whatever order the bins have
            near.sort_unstable_by_key(|n| n.0);
            if near.len() >= SITES
                && let Some(weights) = fit(&near, radius)
            {
                let size: f64 = weights.iter().map(|w| w.1.abs()).sum();
                if size < smallest {
                    (best, smallest) = (weights, size);
                }
                if smallest <= LARGEST {
                    break;
                }
            }
            radius *= 1.25;
        }
        best
    }

    /// Fields of two components at other places.
    ///
    /// # Errors
    /// A place that too few sites are near of.
    pub fn carry<const N: usize>(
        &self,
        places: &[Vector<2>],
        fields: [&[f64]; N],
    ) -> Result<[Vec<f64>; N], String> {
        let rows: Vec<Vec<(usize, f64)>> = places.par_iter().map(|x| self.weights(x)).collect();
        if let Some(k) = rows.iter().position(Vec::is_empty) {
            return Err(format!(
                "no cubic can be fitted at {}",
                places[k].transpose()
            ));
        }
        let value = |field: &[f64], row: &[(usize, f64)], i: usize| -> f64 {
            row.iter().map(|&(k, w)| w * field[2 * k + i]).sum()
        };
        Ok(fields.map(|field| {
            rows.iter()
                .flat_map(|row| [value(field, row, 0), value(field, row, 1)])
                .collect()
        }))
    }
}

/// Weights of the value at the middle of a fit; none if the sites lie on a curve of the third degree.
fn fit(near: &[(usize, Vector<2>)], radius: f64) -> Option<Vec<(usize, f64)>> {
    let root = |d: &Vector<2>| (-2.0 * d.norm_squared() / (radius * radius)).exp();
    let rows = DMatrix::from_fn(near.len(), TERMS, |n, t| {
        let d = near[n].1 / radius;
        let (a, b) = [
            (0, 0),
            (1, 0),
            (0, 1),
            (2, 0),
            (1, 1),
            (0, 2),
            (3, 0),
            (2, 1),
            (1, 2),
            (0, 3),
        ][t];
        root(&near[n].1) * d[0].powi(a) * d[1].powi(b)
    });
    let qr = rows.qr();
    let (q, r) = (qr.q(), qr.r());
    let diagonal = r.diagonal().abs();
    if diagonal.min() < 1e-4 * diagonal.max() {
        return None;
    }
    // the value at the middle is the first coefficient: e₁ᵀ R⁻¹ Qᵀ
    let mut first = DVector::zeros(TERMS);
    first[0] = 1.0;
    let solved = r.transpose().solve_lower_triangular(&first)?;
    let weights = q * solved;
    Some(
        near.iter()
            .zip(weights.iter())
            .map(|((k, d), w)| (*k, w * root(d)))
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bobaru::nested::plate::Plate;

    #[test]
    fn cubics_pass_between_grids_in_both_directions_and_sites_that_stay_keep_their_values() {
        let plate = Plate {
            half: 10,
            levels: vec![1, 2, 4],
            m: 2.0,
            crack: None,
        };
        let levels = |cells: &[[usize; 2]]| {
            let marked: Vec<usize> = cells.iter().map(|&c| plate.index(c)).collect();
            plate.levels_about(&marked, 2.0)
        };
        // the second grid divides what the first leaves whole, and joins what it divides
        let grids = [levels(&[[6, 6]]), levels(&[[13, 12], [14, 12]])];
        let [a, b] = grids.map(|l| plate.body(&l).unwrap().positions);
        for (from, to) in [(&a, &b), (&b, &a)] {
            let scattered = Scattered::new(from);
            for degree in 0..=3 {
                let field = |places: &[Vector<2>]| -> Vec<f64> {
                    places
                        .iter()
                        .flat_map(|x| {
                            let t = 0.1 * x[0] - 0.07 * x[1] + 0.3;
                            [t.powi(degree), (0.4 - 0.08 * x[0]).powi(degree)]
                        })
                        .collect()
                };
                let [found] = scattered.carry(to, [&field(from)]).unwrap();
                for (k, (f, w)) in found.iter().zip(field(to)).enumerate() {
                    assert!((f - w).abs() < 1e-12, "degree {degree} at {}", to[k / 2]);
                }
            }
            // a field that no cubic is: exact at sites of both grids, and close to it at others
            let rough = |places: &[Vector<2>]| -> Vec<f64> {
                places
                    .iter()
                    .flat_map(|x| [(0.5 * x[0]).sin(), (0.5 * x[1]).cos()])
                    .collect()
            };
            let [found] = scattered.carry(to, [&rough(from)]).unwrap();
            let (mut kept, mut new) = (0, 0);
            for ((x, f), w) in to
                .iter()
                .zip(found.chunks_exact(2))
                .zip(rough(to).chunks_exact(2))
            {
                let miss = (f[0] - w[0]).abs().max((f[1] - w[1]).abs());
                if from.contains(x) {
                    assert_eq!(miss, 0.0);
                    kept += 1;
                } else {
                    assert!(miss < 0.02, "{miss} at {x}");
                    new += 1;
                }
            }
            assert!(kept > 100 && new > 100, "{kept} {new}");
        }
    }
}
