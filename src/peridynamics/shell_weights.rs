//! Isotropic lattices: one factor per shell of bonds, the smallest change that gives the fourth moments of the specified material.
//!
//! A lattice sum differs from the integral that it approximates: a plain lattice of m = δ/h = 3 in 3D has a Zener ratio of 1.25 to 1.33.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::bounded_least_norm::{Bound, least_change};
use crate::tensor::{Tensor4, Vector};

/// Smallest factor that a shell's weight may take, relative to a uniform rescaling of all shells.
///
/// Positive by a margin, so that no shell is switched off in all but name.
pub const SMALLEST_SHELL_FACTOR: f64 = 0.05;

/// Lattice bonds of equal length.
#[derive(Clone, Debug, PartialEq)]
pub struct Shell<const D: usize> {
    /// `|k|²` of its integer offsets.
    pub squared: u64,
    /// Integer offsets `k`, in lexicographic order.
    pub offsets: Vec<[i32; D]>,
}

impl<const D: usize> Shell<D> {
    /// Length of the shell's bonds on a lattice of spacing `h`.
    pub fn length(&self, h: f64) -> f64 {
        (self.squared as f64).sqrt() * h
    }

    /// `mean(n_1⁴) − 3 mean(n_1² n_2²)` over the shell's unit directions; zero if the shell alone is isotropic.
    fn anisotropy(&self) -> f64 {
        let (mut fourth, mut mixed) = (0.0, 0.0);
        for k in &self.offsets {
            let square = k.map(|c| f64::from(c) * f64::from(c));
            for i in 0..D {
                fourth += square[i] * square[i];
                for j in 0..D {
                    if j != i {
                        mixed += square[i] * square[j];
                    }
                }
            }
        }
        let d = D as f64;
        let norm = self.offsets.len() as f64 * (self.squared * self.squared) as f64;
        (fourth / d - 3.0 * mixed / (d * (d - 1.0))) / norm
    }
}

/// The full family of a lattice point, grouped into shells of ascending length.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeFamily<const D: usize> {
    /// `m = δ/h`.
    pub ratio: f64,
    /// Shells by ascending length.
    pub shells: Vec<Shell<D>>,
}

impl<const D: usize> LatticeFamily<D> {
    /// The offsets `k ≠ 0` with `|k| ≤ m (1 + tie_tolerance)`, `m = δ/h` being `ratio`.
    ///
    /// # Errors
    /// [`ShellError::Ratio`] if `ratio` is no finite number or leaves the family empty or larger than `|k| = 1000`.
    pub fn new(ratio: f64, tie_tolerance: f64) -> Result<Self, ShellError> {
        let reach = ratio * (1.0 + tie_tolerance);
        if !(1.0..=1000.0).contains(&reach) {
            return Err(ShellError::Ratio { ratio });
        }
        let n = reach.floor() as i32;
        let mut shells: BTreeMap<u64, Vec<[i32; D]>> = BTreeMap::new();
        let mut k = [-n; D];
        'odometer: loop {
            let squared: u64 = k.iter().map(|&c| u64::from(c.unsigned_abs()).pow(2)).sum();
            if squared > 0 && squared as f64 <= reach * reach {
                shells.entry(squared).or_default().push(k);
            }
            for axis in (0..D).rev() {
                if k[axis] < n {
                    k[axis] += 1;
                    continue 'odometer;
                }
                k[axis] = -n;
            }
            break;
        }
        let shells = shells
            .into_iter()
            .map(|(squared, offsets)| Shell { squared, offsets })
            .collect();
        Ok(Self { ratio, shells })
    }

    /// Number of bonds.
    pub fn bond_count(&self) -> usize {
        self.shells.iter().map(|s| s.offsets.len()).sum()
    }

    /// `Σ g ξ⊗ξ⊗ξ⊗ξ V` with one kernel value `g` per shell on a lattice of spacing `h`, `V = h^D`.
    pub fn fourth_moments(&self, h: f64, g: &[f64]) -> Tensor4<D> {
        let mut sum = Tensor4::zeros();
        for (shell, &g) in self.shells.iter().zip(g) {
            for k in &shell.offsets {
                let xi = Vector::from_fn(|i, _| f64::from(k[i]) * h);
                sum.add_fourth_power(g * h.powi(D as i32), &xi);
            }
        }
        sum
    }
}

/// Target of the fourth moments of a lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShellTarget {
    /// Isotropic with `M_1111 = 3 M_1122` of this value; a bond-based material needs `2 C_1111`.
    Strength(f64),
    /// Isotropic, with the trace (for LPS, the weighted volume `m`) that the lattice has.
    Isotropy,
}

/// Failure to make a lattice isotropic by shells.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ShellError {
    /// The ratio δ/h gives no family.
    #[error(
        "lattice family: m = horizon / spacing is {ratio}; choose a horizon of at least one spacing (and at most 1000)"
    )]
    Ratio {
        /// m = δ/h.
        ratio: f64,
    },
    /// A kernel value, the spacing or the target is not usable.
    #[error(
        "isotropic shell weights: {what} is {value}; it must be finite and {wanted}; check the influence function \
         (most vanish at the horizon itself), the horizon over the spacing and the modulus"
    )]
    Input {
        /// Name of the number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Requirement on it besides that it is finite.
        wanted: &'static str,
    },
    /// No factors of at least [`SMALLEST_SHELL_FACTOR`] meet the conditions.
    #[error(
        "`peridynamics.weights`: in {dimension}D, a horizon of {ratio} spacings leaves {} kind(s) of bonds with weight (|k|^2 in {squares:?} spacings), and no \
         positive weights make them isotropic; make peridynamics.horizon larger or the spacing smaller (three spacings are usual), or take another influence function or plain weights",
        squares.len()
    )]
    NotIsotropic {
        /// Dimension of the lattice.
        dimension: usize,
        /// m = δ/h.
        ratio: f64,
        /// `|k|²` of the shells whose weight is not zero.
        squares: Vec<u64>,
    },
}

/// The refusal of a number that nothing can be done with.
fn refusal(what: &'static str, value: f64, wanted: &'static str) -> ShellError {
    ShellError::Input {
        what,
        value,
        wanted,
    }
}

/// Refuses a spacing and kernel values that are not those of a lattice.
fn check_input<const D: usize>(
    lattice: &LatticeFamily<D>,
    spacing: f64,
    base: &[f64],
) -> Result<(), ShellError> {
    let refuse = |what, value, wanted| Err(refusal(what, value, wanted));
    if !(spacing.is_finite() && spacing > 0.0) {
        return refuse("the spacing", spacing, "positive");
    }
    if base.len() != lattice.shells.len() {
        return refuse(
            "the number of kernel values",
            base.len() as f64,
            "one per shell",
        );
    }
    if let Some(&g) = base.iter().find(|g| !(g.is_finite() && **g >= 0.0)) {
        return refuse("a shell's kernel value", g, "not negative");
    }
    Ok(())
}

/// Factors `w`, one per shell, for which `Σ w g ξ⊗ξ⊗ξ⊗ξ V` on the lattice is isotropic and Cauchy-symmetric.
///
/// `base` holds `g(|ξ|)` of each shell (bond-based: λ; LPS: `ω/|ξ|²`), `spacing` is h, `V = h^D`. The factors minimise
/// `Σ N g |ξ|⁴ V (w − 1)²` over the shells of N bonds each; where that would fall below [`SMALLEST_SHELL_FACTOR`] (relative to a
/// uniform rescaling), the shell is held there and the rest is optimal. A shell of zero base has factor 1.
///
/// By the symmetry of the lattice, two conditions suffice in 2D and 3D, one in 1D. With isotropy, `M_1111 = 3 Σ g |ξ|⁴ V/(D (D+2))`;
/// for LPS this is `3m/(D (D+2))`, so isotropy alone is imposed and `m` stays free.
///
/// # Errors
/// [`ShellError::NotIsotropic`] where the shells do not allow it, [`ShellError::Input`] on unusable numbers.
pub fn isotropic_shell_factors<const D: usize>(
    lattice: &LatticeFamily<D>,
    spacing: f64,
    base: &[f64],
    target: ShellTarget,
) -> Result<Vec<f64>, ShellError> {
    check_input(lattice, spacing, base)?;
    let shares: Vec<f64> = lattice
        .shells
        .iter()
        .zip(base)
        .map(|(s, g)| s.offsets.len() as f64 * g * s.length(spacing).powi(4))
        .collect();
    // Plus zero turns −0 into 0, for the message.
    let trace = shares.iter().sum::<f64>() + 0.0;
    if !(trace.is_finite() && trace > 0.0) {
        return Err(refusal("the sum of the shells' weights", trace, "positive"));
    }
    let scale = match target {
        ShellTarget::Isotropy => 1.0,
        ShellTarget::Strength(t) if t.is_finite() && t > 0.0 => {
            let d = D as f64;
            t * d * (d + 2.0) / 3.0 / (trace * spacing.powi(D as i32))
        }
        ShellTarget::Strength(t) => return Err(refusal("the wanted strength", t, "positive")),
    };
    // Isotropy, and the trace kept: what scale leaves is a change of the shells against one another.
    let conditions = if D == 1 { 0 } else { 2 };
    let rows = DMatrix::from_fn(conditions, shares.len(), |c, s| match c {
        0 => lattice.shells[s].anisotropy(),
        _ => 1.0,
    });
    let missing = DVector::from_fn(conditions, |c, _| match c {
        0 => -shares
            .iter()
            .enumerate()
            .map(|(s, d)| d * rows[(0, s)])
            .sum::<f64>(),
        _ => 0.0,
    });
    let change = least_change(
        &rows,
        &shares,
        &missing,
        Bound::AtLeast(SMALLEST_SHELL_FACTOR),
    )
    .map_err(|_| ShellError::NotIsotropic {
        dimension: D,
        ratio: lattice.ratio,
        squares: lattice
            .shells
            .iter()
            .zip(base)
            .filter(|(_, g)| **g > 0.0)
            .map(|(s, _)| s.squared)
            .collect(),
    })?;
    Ok(change
        .iter()
        .zip(base)
        .map(|(d, g)| if *g > 0.0 { scale * (1.0 + d) } else { 1.0 })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peridynamics::families::TIE_TOLERANCE;
    use crate::peridynamics::influence::{Alpha, Degree, Influence, Micromodulus};

    fn kernels() -> Vec<Micromodulus> {
        let mut all = vec![Micromodulus::InverseDistance, Micromodulus::Uniform];
        for degree in Degree::ALL {
            for alpha in Alpha::ALL {
                all.push(Micromodulus::Influence(Influence::Polynomial {
                    degree,
                    alpha,
                }));
            }
        }
        all
    }

    #[test]
    fn bonds_on_the_horizon_belong_to_the_family() {
        let count2 = |m| {
            LatticeFamily::<2>::new(m, TIE_TOLERANCE)
                .unwrap()
                .bond_count()
        };
        assert_eq!(count2(1.0), 4);
        assert_eq!(count2(3.0), 28);
        assert_eq!(count2(3.0 - 1e-12), 28);
        assert_eq!(count2(0.05 / (1.0 / 120.0)), 112);
        assert_eq!(count2(2.999), 24);
        let three = LatticeFamily::<3>::new(3.0, TIE_TOLERANCE).unwrap();
        assert_eq!(three.bond_count(), 122);
        assert_eq!(
            LatticeFamily::<1>::new(4.5, TIE_TOLERANCE)
                .unwrap()
                .bond_count(),
            8
        );
        // |k|² = 7 is no sum of three squares.
        let squares: Vec<u64> = three.shells.iter().map(|s| s.squared).collect();
        assert_eq!(squares, [1, 2, 3, 4, 5, 6, 8, 9]);
        for bad in [0.5, f64::NAN, f64::INFINITY, -3.0] {
            assert!(matches!(
                LatticeFamily::<2>::new(bad, TIE_TOLERANCE),
                Err(ShellError::Ratio { .. })
            ));
        }
    }

    /// Asserts, for one lattice and kernel, that the factors give the wanted tensor to 1e-12 and are positive.
    fn holds<const D: usize>(m: f64, kernel: Micromodulus) {
        let h = 0.01;
        let lattice = LatticeFamily::<D>::new(m, TIE_TOLERANCE).unwrap();
        let base: Vec<f64> = lattice
            .shells
            .iter()
            .map(|s| kernel.shape(s.length(h), m * h))
            .collect();
        let weighted =
            |w: &[f64]| -> Vec<f64> { w.iter().zip(&base).map(|(w, g)| w * g).collect() };

        // Bond-based: the typed strength.
        let c1111 = 3.5;
        let target = ShellTarget::Strength(2.0 * c1111);
        let w = isotropic_shell_factors(&lattice, h, &base, target).unwrap();
        assert!(w.iter().all(|w| *w > 0.0), "{D}D m = {m} {kernel:?}: {w:?}");
        let mut miss = lattice.fourth_moments(h, &weighted(&w)).scaled(0.5);
        let third = c1111 / 3.0;
        // λ = μ = C_1111/3: the Cauchy tensor, ν = 1/4 in 3D.
        miss.add_scaled(-1.0, &Tensor4::isotropic(third, third));
        assert!(
            miss.amax() < 1e-12 * c1111,
            "{D}D m = {m} {kernel:?}: {:e}",
            miss.amax()
        );

        // LPS: isotropy alone, the weighted volume m = Σ ω |ξ|² V, ω = g |ξ|², as the lattice has it.
        let w = isotropic_shell_factors(&lattice, h, &base, ShellTarget::Isotropy).unwrap();
        let volume = |g: &[f64]| -> f64 {
            lattice
                .shells
                .iter()
                .zip(g)
                .map(|(s, g)| g * s.length(h).powi(4) * s.offsets.len() as f64 * h.powi(D as i32))
                .sum()
        };
        let plain = volume(&base);
        assert!((volume(&weighted(&w)) / plain - 1.0).abs() < 1e-12);
        let moments = lattice.fourth_moments(h, &weighted(&w));
        let d = D as f64;
        let m1111 = 3.0 * plain / (d * (d + 2.0));
        let mut miss = moments;
        miss.add_scaled(-1.0, &Tensor4::isotropic(m1111 / 3.0, m1111 / 3.0));
        assert!(miss.amax() < 1e-12 * m1111);
    }

    // Refused: nothing with m = 1.5, 2, 2.5, ..., 6; all of m = 1, which lacks diagonal bonds. Smallest and largest factor over
    // that of the nearest neighbours (at m = 1.5 the smooth functions all but lack diagonal bonds, hence the large factors):
    //
    // | kernel | 2D, m = 1.5 | m = 2 | m = 3 | m = 6 | 3D, m = 1.5 | m = 2 | m = 3 | m = 6 |
    // |---|---|---|---|---|---|---|---|---|
    // | c/r³ | 0.71 to 1 | 1 to 2.12 | 1 to 1.1 | 0.89 to 1 | 1 to 1.41 | 1 to 1.36 | 0.33 to 1 | 0.47 to 1 |
    // | c | 0.25 to 1 | 1 to 4.25 | 1 to 1.21 | 0.8 to 1 | 0.5 to 1 | 1 to 1.74 | 0.012 to 1 | 0.15 to 1 |
    // | P0, α = 0 | 0.5 to 1 | 1 to 2.5 | 1 to 1.1 | 0.84 to 1 | 1 to 1 | 1 to 1.39 | 0.13 to 1 | 0.34 to 1 |
    // | P0, α = 1 | 0.71 to 1 | 1 to 2.12 | 1 to 1.1 | 0.89 to 1 | 1 to 1.41 | 1 to 1.36 | 0.33 to 1 | 0.47 to 1 |
    // | P1, α = 0 | 1 to 2.91 | 0.85 to 1 | 0.88 to 1 | 0.95 to 1 | 1 to 5.83 | 0.74 to 1 | 1 to 1.02 | 0.98 to 1 |
    // | P1, α = 1 | 1 to 4.12 | 1 to 1.21 | 1 to 1.09 | 1 to 1.01 | 1 to 8.24 | 1 to 1.24 | 1 to 1.21 | 1 to 1.02 |
    // | P3, α = 0 | 1 to 13.7 | 1 to 1.21 | 1 to 1.11 | 1 to 1.01 | 1 to 27.5 | 1 to 1.57 | 1 to 1.18 | 1 to 1.03 |
    // | P3, α = 1 | 1 to 19.4 | 1 to 1.71 | 1 to 1.28 | 1 to 1.05 | 1 to 38.8 | 1 to 2.5 | 1 to 1.37 | 1 to 1.06 |
    // | P5, α = 0 | 1 to 61.2 | 1 to 1.63 | 1 to 1.16 | 1 to 1.01 | 1 to 122 | 1 to 2.76 | 1 to 1.2 | 1 to 1.01 |
    // | P5, α = 1 | 1 to 86.6 | 1 to 2.3 | 1 to 1.33 | 1 to 1.05 | 1 to 173 | 1 to 4.24 | 1 to 1.42 | 1 to 1.06 |
    // | P7, α = 0 | 1 to 266 | 1 to 2.14 | 1 to 1.14 | 1 to 1.01 | 1 to 532 | 1 to 4.31 | 1 to 1.17 | 1 to 1.01 |
    // | P7, α = 1 | 1 to 377 | 1 to 3.02 | 1 to 1.33 | 1 to 1.05 | 1 to 753 | 1 to 6.44 | 1 to 1.42 | 1 to 1.06 |
    //
    // (by an independent program that solves the same least change)
    #[test]
    fn the_lattice_has_the_typed_tensor() {
        for half in 3..=12 {
            let m = f64::from(half) / 2.0;
            for kernel in kernels() {
                holds::<1>(m, kernel);
                holds::<2>(m, kernel);
                holds::<3>(m, kernel);
            }
        }
    }

    #[test]
    fn factors_are_the_nearest_ones() {
        // Among all factors that meet the two conditions, none is nearer in the stated norm: moving along any direction that
        // keeps both conditions makes the norm grow.
        let m = 4.0;
        let lattice = LatticeFamily::<2>::new(m, TIE_TOLERANCE).unwrap();
        let base: Vec<f64> = lattice
            .shells
            .iter()
            .map(|s| s.length(1.0).powi(-3))
            .collect();
        let w = isotropic_shell_factors(&lattice, 1.0, &base, ShellTarget::Isotropy).unwrap();
        let share: Vec<f64> = lattice
            .shells
            .iter()
            .zip(&base)
            .map(|(s, g)| g * s.length(1.0).powi(4) * s.offsets.len() as f64)
            .collect();
        let norm = |w: &[f64]| -> f64 {
            share
                .iter()
                .zip(w)
                .map(|(d, w)| d * (w - 1.0).powi(2))
                .sum()
        };
        // What one shell adds to M_1111 − 3 M_1122 and to the trace, from the tensor itself.
        let effect: Vec<[f64; 2]> = (0..base.len())
            .map(|s| {
                let mut one = vec![0.0; base.len()];
                one[s] = base[s];
                let t = lattice.fourth_moments(1.0, &one);
                let (a, b) = (t.get(0, 0, 0, 0), t.get(0, 0, 1, 1));
                [a - 3.0 * b, 2.0 * (a + b)]
            })
            .collect();
        for s in 0..base.len() - 2 {
            let (p, q) = (s + 1, s + 2);
            // Solve effect[p] x + effect[q] y = −effect[s].
            let det = effect[p][0] * effect[q][1] - effect[q][0] * effect[p][1];
            let x = (-effect[s][0] * effect[q][1] + effect[q][0] * effect[s][1]) / det;
            let y = (-effect[p][0] * effect[s][1] + effect[s][0] * effect[p][1]) / det;
            for step in [1e-3, -1e-3] {
                let mut other = w.clone();
                other[s] += step;
                other[p] += step * x;
                other[q] += step * y;
                assert!(norm(&other) > norm(&w), "shell {s}");
            }
        }
    }

    #[test]
    fn what_the_shells_cannot_do_is_refused() {
        let kernel = Micromodulus::InverseDistance;
        let lattice = LatticeFamily::<2>::new(1.0, TIE_TOLERANCE).unwrap();
        let error = isotropic_shell_factors(
            &lattice,
            1.0,
            &[kernel.shape(1.0, 1.0)],
            ShellTarget::Isotropy,
        )
        .unwrap_err()
        .to_string();
        assert!(
            error.contains("2D, a horizon of 1 spacings")
                && error.contains("[1]")
                && error.contains("horizon larger"),
            "{error}"
        );
        // Diagonal bonds alone are as anisotropic as axial ones.
        let lattice = LatticeFamily::<3>::new(1.5, TIE_TOLERANCE).unwrap();
        assert!(matches!(
            isotropic_shell_factors(&lattice, 1.0, &[0.0, 1.0], ShellTarget::Isotropy),
            Err(ShellError::NotIsotropic { squares, .. }) if squares == [2]
        ));
        for (base, target) in [
            ([0.0, 0.0], ShellTarget::Isotropy),
            ([1.0, -1.0], ShellTarget::Isotropy),
            ([1.0, f64::NAN], ShellTarget::Isotropy),
            ([1.0, 1.0], ShellTarget::Strength(0.0)),
        ] {
            let got = isotropic_shell_factors(&lattice, 1.0, &base, target);
            assert!(matches!(got, Err(ShellError::Input { .. })), "{got:?}");
        }
    }
}
