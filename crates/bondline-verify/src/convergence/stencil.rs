//! The peridynamic operator of a lattice with constant horizon, applied without a list of bonds.
//!
//! On a lattice every point has the same bonds, so that the operator is a convolution: `y = A v` costs some Fourier transforms whatever the horizon.
//! Values are kept in the inner box only. Displacements beyond it are prescribed, hence zero in `v`, and the periodic grid is wide enough that no bond
//! reaches round it.

use std::f64::consts::PI;

use bondline::{
    peridynamics::{Influence, PartialVolume, PartialVolumeError, TIE_TOLERANCE},
    solve::krylov::LinearMap,
};

use super::transform::{Periodic, smooth_length};
use bondline::peridynamics::partial_volume::lattice_cells;

/// A bond of the stencil and the quadrature weight `V` that goes with it, times ω.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StencilBond<const D: usize> {
    /// Offset in spacings.
    pub offset: [i32; D],
    /// `ω(|ξ|) V` [m^(D − α)].
    pub weight: f64,
}

/// The bonds of a lattice point under a quadrature algorithm and an influence function.
#[derive(Clone, Debug, PartialEq)]
pub struct Stencil<const D: usize> {
    /// Spacing h \[m\].
    pub spacing: f64,
    /// Its bonds; with every one those of all signs.
    pub bonds: Vec<StencilBond<D>>,
}

impl<const D: usize> Stencil<D> {
    /// The stencil of a horizon on a lattice \[m\].
    ///
    /// # Errors
    /// [`PartialVolumeError::Ratio`] if the horizon is shorter than the spacing.
    pub fn new(
        algorithm: PartialVolume,
        influence: Influence,
        horizon: f64,
        spacing: f64,
    ) -> Result<Self, PartialVolumeError> {
        let bonds = lattice_cells::<D>(algorithm, horizon / spacing, TIE_TOLERANCE)?
            .into_iter()
            .map(|cell| StencilBond {
                offset: cell.offset,
                weight: influence.value(length(&cell.offset) * spacing, horizon)
                    * cell.share
                    * spacing.powi(D as i32),
            })
            .collect();
        Ok(Self { spacing, bonds })
    }

    /// `Σ ω V f(ξ)` over the bonds, `ξ` \[m\].
    pub fn sum(&self, f: impl Fn([f64; D]) -> f64) -> f64 {
        self.bonds
            .iter()
            .map(|b| b.weight * f(b.offset.map(|k| f64::from(k) * self.spacing)))
            .sum()
    }

    /// Largest component of an offset.
    pub fn reach(&self) -> usize {
        self.bonds
            .iter()
            .flat_map(|b| b.offset)
            .map(|k| k.unsigned_abs() as usize)
            .max()
            .unwrap_or(0)
    }
}

fn length<const D: usize>(offset: &[i32; D]) -> f64 {
    offset
        .iter()
        .map(|&k| f64::from(k) * f64::from(k))
        .sum::<f64>()
        .sqrt()
}

/// Constants of the operator `A u = −Σ [a ω n ⊗ n (u_j − u_i) + b ω (θ_i + θ_j) ξ] V`, `θ = Σ ω ξ·(u_j − u_i) V`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    /// `a`: c of eq. (5.9), (5.13); `30 G/m` of eq. (5.19).
    pub bond: f64,
    /// `b`: zero, or `(3K − 5G)/m · 3/m`.
    pub dilatation: f64,
}

/// The operator on the displacements of the inner points of a box, `n` points along each axis.
pub struct StencilOperator<const D: usize> {
    grid: Periodic,
    /// `D (D + 1)/2` components per mode, `[k2][k1][k0]`.
    symbol: Vec<f64>,
}

impl<const D: usize> StencilOperator<D> {
    /// The operator of a stencil on `n^D` points.
    ///
    /// Source: eq. (5.9a), (5.13a), (5.19a) in the discretisation (5.5), as symbols: the bonds give `a Σ ω V n ⊗ n (1 − cos k·ξ)`, the dilatation
    /// `b s ⊗ s` with `s = Σ ω V ξ sin k·ξ`.
    pub fn new(stencil: &Stencil<D>, constants: Constants, n: usize) -> Self {
        // the dilatation of a neighbour reaches two horizons
        let rounds = if constants.dilatation == 0.0 { 1 } else { 2 };
        let m = smooth_length(n + rounds * stencil.reach());
        let axis = |a: usize, length: usize| if a + D >= 3 { length } else { 1 };
        let period = [0, 1, 2].map(|a| axis(a, m));
        let grid = Periodic::new(period, [0, 1, 2].map(|a| axis(a, n)));
        let symbol = symbol(stencil, constants, grid.modes(), m);
        Self { grid, symbol }
    }

    /// Unknowns: `D` components of each inner point, component by component.
    pub fn unknowns(&self) -> usize {
        D * self.grid.values()
    }
}

/// The pairs of components of a symmetric tensor, in the order in which a symbol stores them.
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)];

impl<const D: usize> LinearMap for StencilOperator<D> {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        let [m0, m1, _] = self.grid.modes();
        let stored = D * (D + 1) / 2;
        self.grid.convolve(D, x, y, |[k0, k1, k2], mode| {
            let at = ((k2 * m1 + k1) * m0 + k0) * stored;
            let s = &self.symbol[at..at + stored];
            let v = *mode;
            for p in 0..D {
                mode[p] = v[p] * s[p * (p + 1) / 2 + p];
            }
            for (&(p, q), s) in PAIRS.iter().zip(s) {
                if p != q {
                    mode[p] += v[q] * s;
                    mode[q] += v[p] * s;
                }
            }
        });
    }
}

/// Parity of a lattice function in one coordinate.
#[derive(Clone, Copy, PartialEq)]
enum Parity {
    Even,
    Odd,
}

/// `Σ f(k) Π (cos or sin)(2π k_a j_a/m)` over the bonds for every mode `j`, `[j2][j1][j0]`: cosines where `f` is even in a coordinate.
fn series<const D: usize>(
    stencil: &Stencil<D>,
    f: impl Fn(&StencilBond<D>) -> f64,
    parity: [Parity; D],
    modes: [usize; 3],
    m: usize,
) -> Vec<f64> {
    let reach = stencil.reach() + 1;
    let long = |a: usize| if a + D >= 3 { reach } else { 1 };
    let [r0, r1, r2] = [long(0), long(1), long(2)];
    // values on the octant, with the number of their images
    let mut octant = vec![0.0; r0 * r1 * r2];
    for bond in &stencil.bonds {
        if bond.offset.iter().all(|&k| k >= 0) {
            let mut k = [0; 3];
            for a in 0..D {
                k[a + 3 - D] = bond.offset[a] as usize;
            }
            let images = 1 << bond.offset.iter().filter(|&&k| k > 0).count();
            octant[(k[0] * r1 + k[1]) * r2 + k[2]] = f64::from(images) * f(bond);
        }
    }
    let wave = |axis: usize, k: usize, j: usize| {
        if axis + D < 3 {
            return 1.0;
        }
        let angle = 2.0 * PI * ((k * j) % m) as f64 / m as f64;
        match parity[axis + D - 3] {
            Parity::Even => angle.cos(),
            Parity::Odd => angle.sin(),
        }
    };
    // one axis after another
    let mut last = vec![0.0; modes[2] * r0 * r1];
    for j2 in 0..modes[2] {
        for k2 in 0..r2 {
            let w = wave(2, k2, j2);
            for k in 0..r0 * r1 {
                last[j2 * r0 * r1 + k] += w * octant[k * r2 + k2];
            }
        }
    }
    let mut middle = vec![0.0; modes[2] * modes[1] * r0];
    for j1 in 0..modes[1] {
        for k1 in 0..r1 {
            let w = wave(1, k1, j1);
            for j2 in 0..modes[2] {
                for k0 in 0..r0 {
                    middle[(j2 * modes[1] + j1) * r0 + k0] += w * last[(j2 * r0 + k0) * r1 + k1];
                }
            }
        }
    }
    let waves: Vec<f64> = (0..modes[0] * r0)
        .map(|i| wave(0, i % r0, i / r0))
        .collect();
    let mut all = vec![0.0; modes[2] * modes[1] * modes[0]];
    for (sums, k) in all.chunks_exact_mut(modes[0]).zip(middle.chunks_exact(r0)) {
        for (sum, w) in sums.iter_mut().zip(waves.chunks_exact(r0)) {
            *sum = w.iter().zip(k).map(|(a, b)| a * b).sum();
        }
    }
    all
}

fn symbol<const D: usize>(
    stencil: &Stencil<D>,
    constants: Constants,
    modes: [usize; 3],
    m: usize,
) -> Vec<f64> {
    let stored = D * (D + 1) / 2;
    let count = modes.iter().product::<usize>();
    let mut symbol = vec![0.0; count * stored];
    for (place, &(p, q)) in PAIRS.iter().take(stored).enumerate() {
        let part = |b: &StencilBond<D>| {
            let k = b.offset.map(f64::from);
            b.weight * k[p] * k[q] / k.iter().map(|c| c * c).sum::<f64>()
        };
        let odd = |a: usize| p != q && (a == p || a == q);
        let parity = std::array::from_fn(|a| if odd(a) { Parity::Odd } else { Parity::Even });
        let waves = series(stencil, part, parity, modes, m);
        // cos(a + b) = cos a cos b − sin a sin b: a mixed component has the other sign
        let (rest, sign) = if p == q {
            (stencil.bonds.iter().map(part).sum(), -1.0)
        } else {
            (0.0, 1.0)
        };
        for (s, w) in symbol.iter_mut().skip(place).step_by(stored).zip(waves) {
            *s = constants.bond * (rest + sign * w);
        }
    }
    if constants.dilatation != 0.0 {
        let slopes: Vec<Vec<f64>> = (0..D)
            .map(|p| {
                let parity =
                    std::array::from_fn(|a| if a == p { Parity::Odd } else { Parity::Even });
                let part = |b: &StencilBond<D>| b.weight * f64::from(b.offset[p]) * stencil.spacing;
                series(stencil, part, parity, modes, m)
            })
            .collect();
        for (place, &(p, q)) in PAIRS.iter().take(stored).enumerate() {
            for (mode, s) in symbol.iter_mut().skip(place).step_by(stored).enumerate() {
                *s += constants.dilatation * slopes[p][mode] * slopes[q][mode];
            }
        }
    }
    symbol
}

#[cfg(test)]
mod tests {
    use super::*;
    use bondline::peridynamics::influence::{Alpha, Degree};

    /// The operator bond by bond, dilatations of a whole lattice included.
    fn by_bonds<const D: usize>(
        stencil: &Stencil<D>,
        c: Constants,
        n: usize,
        u: &[f64],
    ) -> Vec<f64> {
        let points = n.pow(D as u32);
        let value = |at: [i64; D], component: usize| {
            let mut index = 0;
            for a in at {
                if a < 0 || a >= n as i64 {
                    return 0.0;
                }
                index = index * n + a as usize;
            }
            u[component * points + index]
        };
        let shifted = |at: [i64; D], k: &[i32; D]| std::array::from_fn(|a| at[a] + i64::from(k[a]));
        let theta = |at: [i64; D]| -> f64 {
            stencil
                .bonds
                .iter()
                .map(|b| {
                    let there = shifted(at, &b.offset);
                    (0..D)
                        .map(|p| {
                            let xi = f64::from(b.offset[p]) * stencil.spacing;
                            b.weight * xi * (value(there, p) - value(at, p))
                        })
                        .sum::<f64>()
                })
                .sum()
        };
        let mut y = vec![0.0; D * points];
        for i in 0..points {
            let at: [i64; D] = std::array::from_fn(|a| (i / n.pow((D - 1 - a) as u32) % n) as i64);
            let here = theta(at);
            for b in &stencil.bonds {
                let there = shifted(at, &b.offset);
                let xi = b.offset.map(|k| f64::from(k) * stencil.spacing);
                let square: f64 = xi.iter().map(|x| x * x).sum();
                let along: f64 = (0..D)
                    .map(|p| xi[p] * (value(there, p) - value(at, p)))
                    .sum();
                let both = if c.dilatation == 0.0 {
                    0.0
                } else {
                    here + theta(there)
                };
                for p in 0..D {
                    y[p * points + i] -=
                        b.weight * xi[p] * (c.bond * along / square + c.dilatation * both);
                }
            }
        }
        y
    }

    fn compare<const D: usize>(n: usize, dilatation: f64) {
        let influence = Influence::Polynomial {
            degree: Degree::P1,
            alpha: Alpha::One,
        };
        for algorithm in PartialVolume::ALL {
            let stencil = Stencil::<D>::new(algorithm, influence, 0.26, 0.1).unwrap();
            let constants = Constants {
                bond: 1.3,
                dilatation,
            };
            let operator = StencilOperator::new(&stencil, constants, n);
            let u: Vec<f64> = (0..operator.unknowns())
                .map(|k| ((k * k % 17) as f64 - 8.0) / 8.0)
                .collect();
            let mut y = vec![0.0; u.len()];
            operator.apply_into(&u, &mut y);
            let expected = by_bonds(&stencil, constants, n, &u);
            let size = expected.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            for (a, b) in y.iter().zip(&expected) {
                assert!((a - b).abs() < 1e-13 * size, "{D}D {algorithm:?}: {a} {b}");
            }
        }
    }

    #[test]
    fn convolution_is_the_sum_over_bonds() {
        compare::<1>(9, 0.0);
        compare::<2>(7, 0.0);
        compare::<2>(6, 2.0);
        compare::<3>(5, 0.0);
        compare::<3>(4, 7.0);
    }
}
