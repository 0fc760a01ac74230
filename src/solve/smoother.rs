//! Block-Jacobi and the Chebyshev smoother built on it.

use crate::solve::krylov::{LinearMap, add_scaled, norm};
use crate::system::BlockCsr;
use crate::{parallel, solve::FreeDofs};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// The inverse of the diagonal blocks, restricted to free dofs.
#[derive(Clone, Debug)]
pub struct BlockJacobi {
    block: usize,
    /// One `block × block` inverse per site, row-major; rows and columns of prescribed dofs are zero.
    inverse: Vec<f64>,
}

impl BlockJacobi {
    /// Inverts the diagonal blocks of `matrix`.
    ///
    /// # Errors
    /// The first site whose block is missing or singular.
    pub fn new(matrix: &BlockCsr, free: &FreeDofs) -> Result<BlockJacobi, usize> {
        let d = matrix.block;
        let blocks: Vec<Vec<f64>> = parallel::try_map(matrix.rows(), 1, |i| -> Result<_, usize> {
            let (columns, values) = matrix.row(i);
            let dofs: Vec<usize> = free.of_site(i).collect();
            let mut inverse = vec![0.0; d * d];
            if dofs.is_empty() {
                return Ok(inverse);
            }
            let e = columns.binary_search(&(i as u32)).map_err(|_| i)?;
            let own = &values[e * d * d..(e + 1) * d * d];
            let small = DMatrix::from_fn(dofs.len(), dofs.len(), |a, b| own[dofs[a] * d + dofs[b]]);
            let small = small
                .try_inverse()
                .filter(|m| m.iter().all(|v| v.is_finite()))
                .ok_or(i)?;
            for (ka, &a) in dofs.iter().enumerate() {
                for (kb, &b) in dofs.iter().enumerate() {
                    inverse[a * d + b] = small[(ka, kb)];
                }
            }
            Ok(inverse)
        })?;
        Ok(BlockJacobi {
            block: d,
            inverse: blocks.concat(),
        })
    }

    /// The inverse block of site `i`, row-major.
    pub fn inverse_of_site(&self, i: usize) -> &[f64] {
        let size = self.block * self.block;
        &self.inverse[i * size..(i + 1) * size]
    }

    /// The largest eigenvalue of `D⁻¹A` by power iteration, with a margin.
    ///
    /// Power iteration comes from below, and a Chebyshev polynomial grows fast above its interval: hence the margin
    /// of 10 %. The test below holds the result to between 1 and 1.1 times the true value.
    pub fn largest_eigenvalue(&self, operator: &dyn LinearMap) -> f64 {
        let n = self.inverse.len() / self.block;
        // a fixed start without smoothness: the wanted vector oscillates
        let mut x: Vec<f64> = (0..n)
            .map(|k| ((k * 7919 + 13) % 1009) as f64 / 1009.0 - 0.5)
            .collect();
        let mut y = vec![0.0; n];
        let mut largest = 1.0;
        self.apply_into(&x.clone(), &mut x);
        for _ in 0..20 {
            let size = norm(&x);
            if size == 0.0 || !size.is_finite() {
                break;
            }
            x.iter_mut().for_each(|v| *v /= size);
            operator.apply_into(&x, &mut y);
            self.apply_into(&y, &mut x);
            largest = norm(&x);
        }
        1.1 * largest
    }
}

impl LinearMap for BlockJacobi {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        let d = self.block;
        y.par_chunks_mut(d)
            .zip(x.par_chunks(d))
            .zip(self.inverse.par_chunks(d * d))
            .with_min_len(512)
            .for_each(|((y, x), m)| {
                for (y, row) in y.iter_mut().zip(m.chunks(d)) {
                    *y = row.iter().zip(x).map(|(m, x)| m * x).sum();
                }
            });
    }
}

/// Residual after a smoother: up to date, or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Residual {
    /// The residual is that of the smoothed solution.
    Update,
    /// The residual is not needed again: one product less.
    Forget,
}

/// A Chebyshev polynomial in `D⁻¹A` that damps the upper part of its spectrum.
#[derive(Clone, Debug)]
pub struct Chebyshev {
    jacobi: BlockJacobi,
    centre: f64,
    radius: f64,
    degree: usize,
}

impl Chebyshev {
    /// Damps eigenvalues from `largest / range` to `largest` by a polynomial of `degree`.
    pub fn new(jacobi: BlockJacobi, largest: f64, range: f64, degree: usize) -> Chebyshev {
        let smallest = largest / range;
        Chebyshev {
            jacobi,
            centre: 0.5 * (largest + smallest),
            radius: 0.5 * (largest - smallest),
            degree,
        }
    }

    /// Improves `x`; `r` is the residual of `x` on entry.
    pub fn smooth(
        &self,
        operator: &dyn LinearMap,
        x: &mut [f64],
        r: &mut [f64],
        residual: Residual,
    ) {
        let n = x.len();
        let (mut z, mut step, mut product) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let sigma = self.centre / self.radius;
        let mut rho = 1.0 / sigma;
        for k in 0..self.degree {
            self.jacobi.apply_into(r, &mut z);
            let (keep, take) = if k == 0 {
                (0.0, 1.0 / self.centre)
            } else {
                let next = 1.0 / (2.0 * sigma - rho);
                let factors = (next * rho, 2.0 * next / self.radius);
                rho = next;
                factors
            };
            step.par_iter_mut()
                .zip(&z)
                .with_min_len(4096)
                .for_each(|(s, z)| *s = keep * *s + take * z);
            add_scaled(1.0, &step, x);
            if k + 1 < self.degree || residual == Residual::Update {
                operator.apply_into(&step, &mut product);
                add_scaled(-1.0, &product, r);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::FreeOperator;
    use crate::solve::stencils::StencilGrid;

    #[test]
    fn the_largest_eigenvalue_is_not_underestimated() {
        let plane = StencilGrid::rectangle(14, 9);
        let solid = StencilGrid::block(6, 5, 4);
        for (lattice, matrix) in [
            (&plane, plane.elements()),
            (&plane, plane.bonds(2)),
            (&plane, plane.bonds(4)),
            (&solid, solid.elements()),
            (&solid, solid.bonds(2)),
        ] {
            let (n, d) = (matrix.dofs(), lattice.dimension);
            let free = FreeDofs::all(lattice.len(), d);
            let operator = FreeOperator::new(&matrix, &free);
            let jacobi = BlockJacobi::new(&matrix, &free).expect("regular blocks");
            let mut dense = DMatrix::zeros(n, n);
            for k in 0..n {
                let mut unit = vec![0.0; n];
                unit[k] = 1.0;
                let (mut product, mut column) = (vec![0.0; n], vec![0.0; n]);
                operator.apply_into(&unit, &mut product);
                jacobi.apply_into(&product, &mut column);
                dense.set_column(k, &nalgebra::DVector::from_vec(column));
            }
            let exact = dense
                .complex_eigenvalues()
                .iter()
                .map(|z| z.re)
                .fold(0.0, f64::max);
            let ratio = jacobi.largest_eigenvalue(&operator) / exact;
            println!("{d}D: estimate over exact {ratio:.3}");
            assert!((1.0..=1.1 + 1e-9).contains(&ratio), "{ratio}");
        }
    }

    #[test]
    fn smoothing_damps_what_oscillates_and_keeps_the_residual() {
        let lattice = StencilGrid::rectangle(20, 20);
        let matrix = lattice.elements();
        let free = FreeDofs::all(400, 2);
        let operator = FreeOperator::new(&matrix, &free);
        let jacobi = BlockJacobi::new(&matrix, &free).expect("regular blocks");
        let largest = jacobi.largest_eigenvalue(&operator);
        let smoother = Chebyshev::new(jacobi, largest, 10.0, 2);
        // a checkerboard, as rough as the lattice can hold, is a solution error for a load of zero
        let mut x: Vec<f64> = (0..800)
            .map(|k| {
                if (k / 2 % 20 + k / 40) % 2 == 0 {
                    1.0
                } else {
                    -1.0
                }
            })
            .collect();
        let before = norm(&x);
        let mut r = matrix.multiply(&x);
        r.iter_mut().for_each(|v| *v = -*v);
        smoother.smooth(&operator, &mut x, &mut r, Residual::Update);
        // the polynomial is at most 1 / T₂(11/9) on its interval
        assert!(norm(&x) < 0.51 * before, "{}", norm(&x) / before);
        let product = matrix.multiply(&x);
        assert!(r.iter().zip(&product).all(|(r, p)| (r + p).abs() < 1e-12));
    }
}
