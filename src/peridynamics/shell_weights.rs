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
    use crate::peridynamics::influence::Micromodulus;

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
