//! Bond weights: the smallest changes of pair coefficients that give one family, regular or not, the moments it should have.
//!
//! The coefficients `g` of `Σ g ξ⊗ξ⊗ξ⊗ξ V` are changed by factors `w = 1 + Δ` that minimise
//!
//! ```text
//! Σ share Δ²,   share = g |ξ|⁴ V,
//! ```
//!
//! that is, the relative change of a bond is weighted by its share in the stiffness. With this norm the factor of a bond depends only
//! on its direction, a uniform change of all factors stays uniform, and bonds of zero weight keep it.

use nalgebra::{DMatrix, DVector};

pub use super::bounded_least_norm::Bound;
use super::bounded_least_norm::least_change;
use crate::tensor::{Tensor4, Vector};

/// One condition `Σ g |ξ|^radial Π_i ξ_i^exponents[i] V = value` on the coefficients `g` of a family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentCondition<const D: usize> {
    /// Powers of the bond's components.
    pub exponents: [u8; D],
    /// Power of the bond's length.
    pub radial: i32,
    /// The wanted value.
    pub value: f64,
}

/// Conditions on the moments of one family.
#[derive(Clone, Debug, PartialEq)]
pub struct MomentConditions<const D: usize> {
    /// The conditions; consistent repetitions do no harm.
    pub rows: Vec<MomentCondition<D>>,
    /// A bond's relative change counts by its share `g |ξ|^share V`.
    pub share: i32,
}

impl<const D: usize> MomentConditions<D> {
    /// `Σ λ ξ⊗ξ⊗ξ⊗ξ V = 2 C`, for a bond-based law; `stiffness` must have all the symmetries of `ξ⊗ξ⊗ξ⊗ξ`
    /// (an isotropic one: λ = μ), of which only `C_ijkl` with `i ≤ j ≤ k ≤ l` is read.
    ///
    /// Source: [SAND2015-7998] eq. (3.6). 1, 5 or 15 conditions.
    pub fn bond_based(stiffness: &Tensor4<D>) -> Self {
        let rows = exponents::<D>(4)
            .into_iter()
            .map(|e| {
                let [i, j, k, l] = indices(&e);
                MomentCondition {
                    exponents: e,
                    radial: 0,
                    value: 2.0 * stiffness.get(i, j, k, l),
                }
            })
            .collect();
        Self { rows, share: 4 }
    }

    /// `Σ ω ξ⊗ξ⊗ξ⊗ξ/|ξ|² V` isotropic with the weighted volume `m`, for the influence values ω of a linear peridynamic solid.
    ///
    /// Its trace is `Σ ω ξ⊗ξ V = (m/D) I`, so that the dilatation is exact as well; it needs no conditions of its own.
    /// 1, 5 or 15 conditions. Units: m [m^(D+2)] times those of ω.
    pub fn lps(weighted_volume: f64) -> Self {
        let d = D as f64;
        let third = weighted_volume / (d * (d + 2.0));
        let moment = Tensor4::isotropic(third, third);
        let mut conditions = Self::bond_based(&moment.scaled(0.5));
        for row in &mut conditions.rows {
            row.radial = -2;
        }
        conditions.share = 2;
        conditions
    }

    /// Adds `Σ g ξ⊗…⊗ξ V = 0` (for [`MomentConditions::lps`]: `Σ ω ξ⊗…⊗ξ/|ξ|² V = 0`) of an odd degree, which a family lacks when it is not symmetric about its point: 1, 4 or 10 conditions of degree
    /// three, 1, 6 or 21 of degree five. With the latter its partial stress is exact for quadratic fields (the trace of those of an LPS holds the third moments of ω).
    pub fn with_vanishing_moments(mut self, degree: u8) -> Self {
        let radial = self.share - 4;
        let zero = |exponents| MomentCondition {
            exponents,
            radial,
            value: 0.0,
        };
        self.rows
            .extend(exponents::<D>(degree).into_iter().map(zero));
        self
    }

    /// The same conditions with the values that another family has, of coefficients `g` on the bonds `(ξ, V)`; those of [`MomentConditions::lps`] at the weighted volume that they ask for.
    pub fn with_values_of(mut self, bonds: &[(Vector<D>, f64)], g: &[f64]) -> Self {
        let values: Vec<f64> = self
            .rows
            .iter()
            .map(|row| {
                let terms = bonds.iter().zip(g);
                terms.map(|((xi, v), g)| g * v * monomial(row, xi)).sum()
            })
            .collect();
        // Σ ω |ξ|² V is the double trace
        let (mut asked, mut there) = (0.0, 0.0);
        for (row, value) in self.rows.iter().zip(&values) {
            if row.exponents.iter().all(|e| e % 2 == 0) {
                let times = if row.exponents.contains(&4) { 1.0 } else { 2.0 };
                asked += times * row.value;
                there += times * value;
            }
        }
        let scale = if self.share == 2 { asked / there } else { 1.0 };
        for (row, value) in self.rows.iter_mut().zip(values) {
            row.value = scale * value;
        }
        self
    }
}

/// Coefficients that meet the conditions of a family.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The changed coefficients, one per bond.
    pub values: Vec<f64>,
    /// Smallest factor between a changed coefficient and its base.
    pub smallest_factor: f64,
}

/// Failure to meet the moment conditions of a family.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The bonds cannot carry the conditions: too few, or in too few directions.
    #[error(
        "{}bond weights: {bonds} bonds meet only {rank} of {conditions} moment conditions independently; widen the horizon \
         there, fill the family (a missing side, a thin part) or use a correspondence law or plain weights",
        place(point)
    )]
    Deficient {
        /// The point, once [`FitError::at`] has told.
        point: Option<usize>,
        /// Bonds of non-zero weight.
        bonds: usize,
        /// Independent conditions among the bonds at hand.
        rank: usize,
        /// Number of conditions.
        conditions: usize,
    },
    /// The conditions can be met, but not with every factor at or above the bound.
    #[error(
        "{}bond weights: {bonds} bonds of full rank {rank} meet the {conditions} moment conditions only with factors below \
         {bound}; widen the horizon there, allow smaller factors or use plain weights",
        place(point)
    )]
    Bounded {
        /// The point, once [`FitError::at`] has told.
        point: Option<usize>,
        /// Bonds of non-zero weight.
        bonds: usize,
        /// Independent conditions among the bonds at hand.
        rank: usize,
        /// Number of conditions.
        conditions: usize,
        /// The lower bound of the factors.
        bound: f64,
    },
    /// A bond, a volume, a coefficient or a wanted value is no usable number.
    #[error(
        "{}bond weights: bond {bond} has length {length}, volume {volume} and coefficient {base}; all must be finite, length \
         and volume positive and the coefficient not negative; look for coincident points and empty cells",
        place(point)
    )]
    Input {
        /// The point, once [`FitError::at`] has told.
        point: Option<usize>,
        /// Position of the bond in the family.
        bond: usize,
        /// |ξ|.
        length: f64,
        /// V.
        volume: f64,
        /// The base coefficient.
        base: f64,
    },
}

impl FitError {
    /// The same error, naming the point of the family.
    pub fn at(mut self, index: usize) -> Self {
        match &mut self {
            Self::Deficient { point, .. }
            | Self::Bounded { point, .. }
            | Self::Input { point, .. } => *point = Some(index),
        }
        self
    }
}

/// "point 7: ", or nothing.
pub(super) fn place(point: &Option<usize>) -> String {
    point.map_or_else(String::new, |p| format!("point {p}: "))
}

/// The coefficients nearest to `base` that meet `conditions` on one family, regular or not.
///
/// `bonds` holds `(ξ, V)`; the change minimises `Σ base |ξ|^share V (g/base − 1)²`. On a full lattice with one orbit per shell the
/// result is that of [`super::shell_weights::isotropic_shell_factors`]. Moments are met to 1e-13 of the sum of magnitudes of their terms.
///
/// # Errors
/// [`FitError`] if the family cannot meet them, or not within `bound`.
pub fn fit<const D: usize>(
    bonds: &[(Vector<D>, f64)],
    base: &[f64],
    conditions: &MomentConditions<D>,
    bound: Bound,
) -> Result<Fit, FitError> {
    let reach = bonds.iter().map(|(xi, _)| xi.norm()).fold(0.0, f64::max);
    let mut shares = Vec::with_capacity(bonds.len());
    for (k, ((xi, volume), &g)) in bonds.iter().zip(base).enumerate() {
        let (r, v) = (xi.norm(), *volume);
        if !(r.is_finite() && v.is_finite() && g.is_finite() && r > 0.0 && v > 0.0 && g >= 0.0) {
            return Err(FitError::Input {
                point: None,
                bond: k,
                length: r,
                volume: v,
                base: g,
            });
        }
        shares.push(g * v * (r / reach).powi(conditions.share));
    }
    // Lengths in units of the longest bond, so that all rows are of one size whatever the scene's unit.
    let rows = DMatrix::from_fn(conditions.rows.len(), bonds.len(), |c, k| {
        monomial(&conditions.rows[c], &(bonds[k].0 / reach))
            / (bonds[k].0.norm() / reach).powi(conditions.share)
    });
    let missing = DVector::from_fn(conditions.rows.len(), |c, _| {
        let row = &conditions.rows[c];
        let degree = row.radial + row.exponents.iter().map(|&e| i32::from(e)).sum::<i32>();
        let present: f64 = shares
            .iter()
            .enumerate()
            .map(|(k, d)| d * rows[(c, k)])
            .sum();
        row.value / reach.powi(degree) - present
    });
    let count = shares.iter().filter(|d| **d > 0.0).count();
    let change = least_change(&rows, &shares, &missing, bound).map_err(|failure| {
        let (bonds, rank, conditions) = (count, failure.rank, conditions.rows.len());
        match bound {
            Bound::AtLeast(bound) if failure.unbounded_met => FitError::Bounded {
                point: None,
                bonds,
                rank,
                conditions,
                bound,
            },
            _ => FitError::Deficient {
                point: None,
                bonds,
                rank,
                conditions,
            },
        }
    })?;
    Ok(Fit {
        values: change
            .iter()
            .zip(base)
            .map(|(d, g)| g * (1.0 + d))
            .collect(),
        smallest_factor: 1.0 + change.iter().copied().fold(f64::INFINITY, f64::min),
    })
}

/// `|ξ|^radial Π ξ_i^e_i`.
fn monomial<const D: usize>(row: &MomentCondition<D>, xi: &Vector<D>) -> f64 {
    let mut value = xi.norm().powi(row.radial);
    for (x, &e) in xi.iter().zip(&row.exponents) {
        value *= x.powi(i32::from(e));
    }
    value
}

/// All exponents of total degree `degree` in `D` variables.
fn exponents<const D: usize>(degree: u8) -> Vec<[u8; D]> {
    let mut all = Vec::new();
    let mut e = [0u8; D];
    'odometer: loop {
        if e.iter().sum::<u8>() == degree {
            all.push(e);
        }
        for slot in e.iter_mut().rev() {
            if *slot < degree {
                *slot += 1;
                continue 'odometer;
            }
            *slot = 0;
        }
        return all;
    }
}

/// The tensor indices that quartic exponents stand for: (2, 1, 1) is 0, 0, 1, 2.
fn indices<const D: usize>(e: &[u8; D]) -> [usize; 4] {
    let mut all = [0; 4];
    let listed = e
        .iter()
        .enumerate()
        .flat_map(|(axis, &n)| std::iter::repeat_n(axis, usize::from(n)));
    for (slot, axis) in all.iter_mut().zip(listed) {
        *slot = axis;
    }
    all
}

/// Weighted volume `m = Σ ω |ξ|² V` over the bonds `(ξ, V)` of one family.
///
/// Source: [SAND2015-7998] eq. (5.18), as a sum. Units: ξ \[m\], V [m^D] → [m^(D+2)] times those of ω.
pub fn weighted_volume<const D: usize>(bonds: &[(Vector<D>, f64)], omega: &[f64]) -> f64 {
    bonds
        .iter()
        .zip(omega)
        .map(|((xi, volume), w)| w * volume * xi.norm_squared())
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peridynamics::families::TIE_TOLERANCE;
    use crate::peridynamics::shape_tensor::shape_tensor;
    use crate::peridynamics::shell_weights::{LatticeFamily, ShellTarget, isotropic_shell_factors};
    use crate::tensor::Tensor;

    /// Reproducible numbers in [−1, 1).
    fn random(state: &mut u64) -> f64 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// A lattice family of δ = m h seen from a point off the lattice, jittered, with uneven volumes.
    fn irregular<const D: usize>(m: f64, h: f64, seed: u64) -> Vec<(Vector<D>, f64)> {
        let mut state = seed;
        let shift: Vector<D> = Vector::from_fn(|_, _| 0.4 * random(&mut state));
        let lattice = LatticeFamily::<D>::new(m + 1.0, TIE_TOLERANCE).unwrap();
        lattice
            .shells
            .iter()
            .flat_map(|s| &s.offsets)
            .map(|k| {
                let xi = Vector::from_fn(|i, _| {
                    (f64::from(k[i]) + shift[i] + 0.15 * random(&mut state)) * h
                });
                (xi, h.powi(D as i32) * (1.0 + 0.3 * random(&mut state)))
            })
            .filter(|(xi, _): &(Vector<D>, f64)| xi.norm() <= m * h)
            .collect()
    }

    /// `Σ g ξ⊗ξ⊗ξ⊗ξ V` over the bonds `(ξ, V)` of one family.
    fn fourth_moments<const D: usize>(bonds: &[(Vector<D>, f64)], g: &[f64]) -> Tensor4<D> {
        let mut sum = Tensor4::zeros();
        for ((xi, volume), g) in bonds.iter().zip(g) {
            sum.add_fourth_power(g * volume, xi);
        }
        sum
    }

    fn largest_miss<const D: usize>(got: &Tensor4<D>, wanted: &Tensor4<D>) -> f64 {
        let mut miss = *got;
        miss.add_scaled(-1.0, wanted);
        miss.amax() / wanted.amax()
    }

    /// `Σ g ξ_i ξ_j ξ_k |ξ|^radial V`, largest component.
    fn third_moment<const D: usize>(bonds: &[(Vector<D>, f64)], g: &[f64], radial: i32) -> f64 {
        let mut largest: f64 = 0.0;
        for i in 0..D {
            for j in 0..D {
                for k in 0..D {
                    let sum: f64 = bonds
                        .iter()
                        .zip(g)
                        .map(|((x, v), g)| g * v * x[i] * x[j] * x[k] * x.norm().powi(radial))
                        .sum();
                    largest = largest.max(sum.abs());
                }
            }
        }
        largest
    }

    fn bond_based_fit<const D: usize>(m: f64, h: f64) {
        for seed in 1..6 {
            let bonds = irregular::<D>(m, h, seed);
            let base: Vec<f64> = bonds.iter().map(|(x, _)| x.norm().powi(-3)).collect();
            // The strength the family has on average, so that factors stay near one.
            let d = D as f64;
            let trace: f64 = bonds
                .iter()
                .zip(&base)
                .map(|((x, v), g)| g * v * x.norm().powi(4))
                .sum();
            let third = 0.5 * trace / (d * (d + 2.0));
            let c = Tensor4::isotropic(third, third);
            let plain = largest_miss(&fourth_moments(&bonds, &base).scaled(0.5), &c);

            let conditions = MomentConditions::bond_based(&c);
            let fit_plain = fit(&bonds, &base, &conditions, Bound::Free).unwrap();
            let got = fourth_moments(&bonds, &fit_plain.values).scaled(0.5);
            let miss = largest_miss(&got, &c);
            assert!(miss < 1e-13, "{D}D: {miss:e}, plain {plain:e}");
            assert!(D == 1 || plain > 1e-3);

            let conditions = conditions.with_vanishing_moments(3);
            let both = fit(&bonds, &base, &conditions, Bound::Free).unwrap();
            let got = fourth_moments(&bonds, &both.values).scaled(0.5);
            assert!(largest_miss(&got, &c) < 1e-13);
            let scale: f64 = bonds
                .iter()
                .zip(&base)
                .map(|((x, v), g)| g * v * x.norm().powi(3))
                .sum();
            assert!(third_moment(&bonds, &base, 0) > 1e-3 * scale);
            assert!(third_moment(&bonds, &both.values, 0) < 1e-13 * scale);
        }
    }

    #[test]
    fn irregular_families_get_the_typed_tensor() {
        bond_based_fit::<1>(3.0, 0.01);
        bond_based_fit::<2>(3.0, 0.02);
        bond_based_fit::<3>(3.0, 50.0);
    }

    fn lps_fit<const D: usize>() {
        let bonds = irregular::<D>(3.0, 1e-3, 3);
        let omega: Vec<f64> = bonds.iter().map(|(x, _)| 1.0 - x.norm() / 3.5e-3).collect();
        let m = weighted_volume(&bonds, &omega);
        let fitted = fit(&bonds, &omega, &MomentConditions::lps(m), Bound::Free).unwrap();
        let d = D as f64;
        // Σ ω ξ⊗ξ V = (m/D) I follows, and with it the dilatation of every affine field.
        let k = shape_tensor(&bonds, &fitted.values);
        assert!((k - Tensor::<D>::identity() * (m / d)).amax() < 1e-13 * m);
        let per_square: Vec<f64> = bonds
            .iter()
            .zip(&fitted.values)
            .map(|((x, _), w)| w / x.norm_squared())
            .collect();
        let third = m / (d * (d + 2.0));
        let wanted = Tensor4::isotropic(third, third);
        assert!(largest_miss(&fourth_moments(&bonds, &per_square), &wanted) < 1e-13);
        // Asking twice changes nothing, although the normal equations are then singular.
        let and = |weighted_volume| {
            let mut conditions = MomentConditions::<D>::lps(m);
            (conditions.rows).extend(MomentConditions::lps(weighted_volume).rows);
            conditions
        };
        let twice = and(m);
        let again = fit(&bonds, &omega, &twice, Bound::Free).unwrap();
        for (a, b) in fitted.values.iter().zip(&again.values) {
            assert!((a - b).abs() < 1e-11);
        }
        // Asking for another value too is refused, and says so by its rank.
        let contradiction = and(1.1 * m);
        let error = fit(&bonds, &omega, &contradiction, Bound::Free).unwrap_err();
        assert!(
            matches!(error, FitError::Deficient { rank, conditions, .. } if rank < conditions),
            "{error:?}"
        );
        let third = fit(
            &bonds,
            &omega,
            &MomentConditions::lps(m).with_vanishing_moments(3),
            Bound::Free,
        )
        .unwrap();
        let first: Vector<D> = bonds
            .iter()
            .zip(&third.values)
            .map(|((x, v), w)| x * (w * v))
            .sum();
        let scale: f64 = bonds
            .iter()
            .zip(&omega)
            .map(|((x, v), w)| w * v * x.norm())
            .sum();
        assert!(first.norm() < 1e-13 * scale);
    }

    #[test]
    fn lps_families_get_dilatation_and_shear_right() {
        lps_fit::<1>();
        lps_fit::<2>();
        lps_fit::<3>();
    }

    #[test]
    fn full_lattices_get_their_shell_factors() {
        // In 2D up to m = 4 every shell is one orbit of the lattice's symmetry; then both roads must end in one place.
        for m in [2.0, 3.0, 4.0] {
            let lattice = LatticeFamily::<2>::new(m, TIE_TOLERANCE).unwrap();
            let shells: Vec<f64> = lattice.shells.iter().map(|s| 1.0 / s.length(1.0)).collect();
            let factors =
                isotropic_shell_factors(&lattice, 1.0, &shells, ShellTarget::Strength(6.0))
                    .unwrap();
            let mut bonds = Vec::new();
            let mut base = Vec::new();
            let mut expected = Vec::new();
            for ((s, g), w) in lattice.shells.iter().zip(&shells).zip(&factors) {
                for k in &s.offsets {
                    bonds.push((Vector::<2>::new(f64::from(k[0]), f64::from(k[1])), 1.0));
                    base.push(*g);
                    expected.push(g * w);
                }
            }
            let c = Tensor4::isotropic(1.0, 1.0);
            let conditions = MomentConditions::bond_based(&c);
            let fitted = fit(&bonds, &base, &conditions, Bound::Free).unwrap();
            for (a, b) in fitted.values.iter().zip(&expected) {
                assert!((a / b - 1.0).abs() < 1e-12, "m = {m}: {a} {b}");
            }
        }
    }

    #[test]
    fn bounds_hold_and_what_they_forbid_is_said() {
        // A family whose fourth side is thin: the free fit overshoots, the bounded one does not.
        let bonds: Vec<(Vector<2>, f64)> = irregular::<2>(4.0, 1.0, 4)
            .into_iter()
            .filter(|(x, _)| x.x < 1.5)
            .collect();
        let base = vec![1.0; bonds.len()];
        let trace: f64 = bonds.iter().map(|(x, v)| v * x.norm().powi(4)).sum();
        let c = Tensor4::isotropic(trace / 16.0, trace / 16.0);
        let conditions = MomentConditions::bond_based(&c).with_vanishing_moments(3);
        let free = fit(&bonds, &base, &conditions, Bound::Free).unwrap();
        assert!(free.smallest_factor < 0.05, "{}", free.smallest_factor);
        let bounded = fit(&bonds, &base, &conditions, Bound::AtLeast(0.05)).unwrap();
        assert!((bounded.smallest_factor - 0.05).abs() < 1e-14);
        let miss = largest_miss(&fourth_moments(&bonds, &bounded.values).scaled(0.5), &c);
        assert!(miss < 1e-12, "{miss:e}");

        // All bonds on one side: no positive factors make third moments vanish.
        let half: Vec<(Vector<2>, f64)> = irregular::<2>(4.0, 1.0, 9)
            .into_iter()
            .filter(|(x, _)| x.x > 0.1)
            .collect();
        let base = vec![1.0; half.len()];
        let error = fit(&half, &base, &conditions, Bound::AtLeast(0.05)).unwrap_err();
        assert!(
            matches!(error, FitError::Bounded { rank: 9, .. }),
            "{error:?}"
        );
        assert!(error.at(4).to_string().starts_with("point 4: "));
    }

    #[test]
    fn too_few_bonds_are_refused_with_their_rank() {
        // Axial bonds alone carry M_1111 and M_2222 only.
        let bonds: Vec<(Vector<2>, f64)> = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
            .iter()
            .map(|&(x, y)| (Vector::<2>::new(x, y), 1.0))
            .collect();
        let conditions = MomentConditions::bond_based(&Tensor4::isotropic(1.0, 1.0));
        let error = fit(&bonds, &[1.0; 4], &conditions, Bound::Free).unwrap_err();
        assert_eq!(
            error,
            FitError::Deficient {
                point: None,
                bonds: 4,
                rank: 2,
                conditions: 5
            }
        );
        let text = error.at(12).to_string();
        assert!(
            text.contains("point 12") && text.contains("4 bonds") && text.contains("2 of 5"),
            "{text}"
        );
        let none: [(Vector<2>, f64); 0] = [];
        assert!(fit(&none, &[], &conditions, Bound::Free).is_err());
        let twin = [(Vector::<2>::zeros(), 1.0)];
        let error = fit(&twin, &[1.0], &conditions, Bound::Free).unwrap_err();
        assert!(error.to_string().contains("coincident"), "{error}");
    }
}
