//! Position-aware influence functions: the smallest changes of ω and σ that give one family, complete or not, the dilatation and the deviatoric energy of elasticity.
//!
//! With `e = ξ·η/|ξ|`, the dilatation `θ = Σ ω |ξ| e V` and the deviatoric extension `ε = e − θ |ξ|/D`, the energy density of a position-aware linear solid is
//! `W = ½ κ θ² + μ Σ σ ε² V`, [SAND2015-7998] eq. (4.5), (4.9), (4.10). Under `u = G x`, with `A = (G + Gᵀ)/2`, it is that of elasticity if
//!
//! ```text
//! Σ ω ξ⊗ξ V = I ,      Σ σ (n·A n − tr A/D)² |ξ|² V = dev A : dev A ,      n = ξ/|ξ| .
//! ```
//!
//! The paper leaves the choice among the solutions to its reference \[37\]; here it is the least change by shares of [`super::bounded_least_norm`], from the influence function of the scene
//! scaled to the family's own weighted volume, which on a complete family is that of the linear peridynamic solid.

use nalgebra::{DMatrix, DVector};

use super::bounded_least_norm::{Bound, least_change};
use crate::{
    peridynamics::{Family, StressFit},
    tensor::{Tensor, Vector},
};

/// The fields under which the deviatoric energy is to be exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CalibrationFields {
    /// Uniaxial strain along each axis and simple shear in each plane of two axes: 6 conditions in 3D, as [SAND2015-7998] section 4.2 has them.
    Axes,
    /// All affine fields: the products of all deviators, 15 conditions in 3D, 3 in 2D.
    Affine,
}

/// ω and σ of one family, one value per bond. Units: \[1/m^(D+2)\].
#[derive(Clone, Debug, PartialEq)]
pub struct PositionAware {
    /// Of the dilatation.
    pub omega: Vec<f64>,
    /// Of the deviatoric energy; not negative.
    pub sigma: Vec<f64>,
}

/// A family whose energy cannot be made that of elasticity.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "its {bonds} bonds meet {} of {conditions} conditions on its {of}; widen the horizon, thicken the body there, or {remedy}",
    if *.bounded { format!("only with negative weights {rank}") } else { format!("only {rank}") }
)]
pub struct NotPositionAware {
    /// Quantity that cannot be exact: `dilatation` or `deviatoric energy`.
    pub of: &'static str,
    /// Bonds with weight.
    pub bonds: usize,
    /// Independent conditions among the bonds.
    pub rank: usize,
    /// Number of conditions.
    pub conditions: usize,
    /// True if weights of any sign would meet them.
    pub bounded: bool,
    /// Remedy beside a wider horizon.
    pub remedy: &'static str,
}

/// Finds ω and σ next to the influence function `base` (one value per bond, not negative, any scale).
///
/// # Errors
/// [`NotPositionAware`] if no ω of any sign gives the dilatation, or no `σ ≥ 0` the deviatoric energy.
pub fn fit<const D: usize>(
    family: &Family<'_, D>,
    base: &[f64],
    fields: CalibrationFields,
) -> Result<PositionAware, NotPositionAware> {
    let whole = WholeFamily::of(family, base, fields, None)?;
    let omega = whole.omega(Odd::Any)?;
    let sigma = whole.sigma(Odd::Any, Bound::AtLeast(0.0))?;
    Ok(PositionAware { omega, sigma })
}

/// Finds ω and σ of a family of any shape whose partial stress is that of elasticity under affine fields.
///
/// Under a quadratic field the partial stress has, besides, the moments `Σ ω ξ⊗ξ⊗ξ V` and `Σ σ ξ⊗ξ⊗ξ⊗ξ⊗ξ/|ξ|² V`, which a family has that is not symmetric about its point.
///
/// # Errors
/// [`NotPositionAware`] if no weights meet what `stress` asks for.
pub fn fit_stress<const D: usize>(
    family: &Family<'_, D>,
    base: &[f64],
    stress: StressFit,
) -> Result<PositionAware, NotPositionAware> {
    let remedy = "keep the transition zone away from surfaces, or couple by splice";
    let whole = WholeFamily::of(family, base, CalibrationFields::Affine, Some(remedy))?;
    let positive = Bound::AtLeast(0.0);
    if stress == StressFit::Quadratic && whole.has_enough_for_odd() {
        // in space a search for the smallest change that is not negative would take most of the time of a run
        let bound = if D < 3 { positive } else { Bound::Free };
        let omega = whole.omega(Odd::Vanishing).ok();
        let sigma = || whole.sigma(Odd::Vanishing, bound).ok();
        let both = omega.and_then(|omega| Some((omega, sigma()?)));
        if let Some((omega, sigma)) = both.filter(|(_, sigma)| sigma.iter().all(|s| *s >= 0.0)) {
            return Ok(PositionAware { omega, sigma });
        }
    }
    let omega = whole.omega(Odd::Any)?;
    let sigma = match whole.sigma(Odd::Any, positive) {
        Err(_) if stress != StressFit::Positive => whole.sigma(Odd::Any, Bound::Free)?,
        other => other?,
    };
    Ok(PositionAware { omega, sigma })
}

/// Condition on the odd moments of the influence functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Odd {
    Any,
    Vanishing,
}

/// Conditions on moments of even order.
#[derive(Clone, Copy)]
struct Even<'a, const D: usize> {
    /// Contribution of a bond of this direction to a condition, over its share.
    of_direction: &'a dyn Fn(usize, &Vector<D>) -> f64,
    wanted: &'a [f64],
}

/// A family with the influence functions that it would have if it were complete.
struct WholeFamily<'a, const D: usize> {
    family: &'a Family<'a, D>,
    base: &'a [f64],
    fields: CalibrationFields,
    /// Remedy for a family that cannot be fitted, if it is not that of the law.
    remedy: Option<&'static str>,
    directions: Vec<Vector<D>>,
    /// `ω |ξ|² V` of the base.
    shares: Vec<f64>,
    /// The weighted volume.
    m: f64,
}

impl<'a, const D: usize> WholeFamily<'a, D> {
    fn of(
        family: &'a Family<'a, D>,
        base: &'a [f64],
        fields: CalibrationFields,
        remedy: Option<&'static str>,
    ) -> Result<Self, NotPositionAware> {
        let shares: Vec<f64> = (0..base.len())
            .map(|k| base[k] * family.bonds[k].norm_squared() * family.volumes[k])
            .collect();
        let whole = Self {
            family,
            base,
            fields,
            remedy,
            directions: family.bonds.iter().map(|xi| xi / xi.norm()).collect(),
            m: shares.iter().sum(),
            shares,
        };
        if whole.m.is_nan() || whole.m <= 0.0 {
            return Err(whole.refused("dilatation", D * (D + 1) / 2, (0, false)));
        }
        Ok(whole)
    }

    fn bonds(&self) -> usize {
        self.base.iter().filter(|w| **w > 0.0).count()
    }

    fn refused(
        &self,
        of: &'static str,
        conditions: usize,
        (rank, bounded): (usize, bool),
    ) -> NotPositionAware {
        NotPositionAware {
            of,
            bonds: self.bonds(),
            rank,
            conditions,
            bounded,
            remedy: match (self.remedy, self.fields) {
                (Some(remedy), _) => remedy,
                (None, CalibrationFields::Affine) if of == DEVIATOR => {
                    "use calibration-fields = \"axes\", which asks for less, or the law lps"
                }
                _ => "use the law lps",
            },
        }
    }

    /// Returns true if there are bonds enough to expect weights with vanishing odd moments.
    fn has_enough_for_odd(&self) -> bool {
        let conditions = products::<D>(self.fields).len() + multi_indices::<D>(5).len();
        self.bonds() >= 2 * conditions
    }

    /// The influence function `scale · base (1 + Δ)` with `Σ rows (shares · scale) (1 + Δ) = wanted`, and vanishing moments of the odd `order`, if it is asked for.
    fn changed(
        &self,
        scale: f64,
        Even {
            of_direction,
            wanted,
        }: Even<'_, D>,
        order: Option<usize>,
        bound: Bound,
    ) -> Result<Vec<f64>, (usize, bool)> {
        let odd = order.map_or_else(Vec::new, multi_indices::<D>);
        let count = wanted.len();
        let rows = DMatrix::from_fn(count + odd.len(), self.base.len(), |c, k| {
            let n = &self.directions[k];
            match c.checked_sub(count) {
                None => of_direction(c, n),
                Some(c) => {
                    let product: f64 = odd[c].iter().map(|&i| n[i]).product();
                    product * self.family.bonds[k].norm() / self.family.horizon
                }
            }
        });
        let wanted = DVector::from_fn(count + odd.len(), |c, _| {
            wanted.get(c).copied().unwrap_or(0.0)
        });
        let whole: Vec<f64> = self.shares.iter().map(|s| scale * s).collect();
        let change = changes(&rows, &whole, wanted, bound)?;
        let least = match bound {
            Bound::Free => f64::NEG_INFINITY,
            Bound::AtLeast(least) => least,
        };
        let values = self.base.iter().zip(change);
        Ok(values
            .map(|(base, change)| scale * base * (1.0 + change).max(least))
            .collect())
    }

    /// ω, of any sign.
    fn omega(&self, odd: Odd) -> Result<Vec<f64>, NotPositionAware> {
        let strains = strains::<D>();
        let of_direction = |c: usize, n: &Vector<D>| n.dot(&(strains[c] * n));
        let wanted: Vec<f64> = strains.iter().map(|a| a.trace()).collect();
        let order = (odd == Odd::Vanishing).then_some(3);
        let scale = D as f64 / self.m;
        let even = Even {
            of_direction: &of_direction,
            wanted: &wanted,
        };
        self.changed(scale, even, order, Bound::Free)
            .map_err(|(rank, _)| self.refused("dilatation", strains.len(), (rank, false)))
    }

    fn sigma(&self, odd: Odd, bound: Bound) -> Result<Vec<f64>, NotPositionAware> {
        let pairs = products::<D>(self.fields);
        let of_direction = |c: usize, n: &Vector<D>| {
            let (a, b) = &pairs[c];
            n.dot(&(a * n)) * n.dot(&(b * n))
        };
        let wanted: Vec<f64> = pairs.iter().map(|(a, b)| a.dot(b)).collect();
        let order = (odd == Odd::Vanishing).then_some(5);
        let d = D as f64;
        let scale = d * (d + 2.0) / (2.0 * self.m);
        let even = Even {
            of_direction: &of_direction,
            wanted: &wanted,
        };
        self.changed(scale, even, order, bound)
            .map_err(|why| self.refused(DEVIATOR, pairs.len(), why))
    }
}

/// The components of a symmetric tensor of this order, by their indices.
fn multi_indices<const D: usize>(order: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    for _ in 0..order {
        let longer = |index: &Vec<usize>| {
            let last = index.last().copied().unwrap_or(0);
            let index = index.clone();
            (last..D).map(move |i| [&index[..], &[i]].concat())
        };
        all = all.iter().flat_map(longer).collect();
    }
    all
}

const DEVIATOR: &str = "deviatoric energy";

/// The relative changes with `Σ_k b_ck d_k (1 + Δ_k) = wanted_c`; the error has the rank, and whether a change without bound would do.
fn changes(
    rows: &DMatrix<f64>,
    shares: &[f64],
    wanted: DVector<f64>,
    bound: Bound,
) -> Result<Vec<f64>, (usize, bool)> {
    let mut missing = wanted;
    for (k, share) in shares.iter().enumerate() {
        missing.axpy(-share, &rows.column(k), 1.0);
    }
    least_change(rows, shares, &missing, bound).map_err(|e| (e.rank, e.unbounded_met))
}

/// Unit strains along each axis, then shears of the engineering strain 1.
fn strains<const D: usize>() -> Vec<Tensor<D>> {
    let unit = |i: usize, j: usize| {
        let mut a = Tensor::zeros();
        a[(i, j)] += 0.5;
        a[(j, i)] += 0.5;
        a
    };
    let shears = (0..D).flat_map(|i| (i + 1..D).map(move |j| (i, j)));
    (0..D)
        .map(|i| unit(i, i))
        .chain(shears.map(|(i, j)| unit(i, j)))
        .collect()
}

/// Deviators whose products with each other the deviatoric energy is to have.
fn products<const D: usize>(fields: CalibrationFields) -> Vec<(Tensor<D>, Tensor<D>)> {
    let deviator = |a: Tensor<D>| a - Tensor::identity() * (a.trace() / D as f64);
    let mut all: Vec<Tensor<D>> = strains::<D>().into_iter().map(deviator).collect();
    match fields {
        CalibrationFields::Axes => all.into_iter().map(|a| (a, a)).collect(),
        CalibrationFields::Affine => {
            // the deviators of the axes add up to zero
            all.remove(D - 1);
            let pairs = (0..all.len()).flat_map(|a| (a..all.len()).map(move |b| (a, b)));
            pairs.map(|(a, b)| (all[a], all[b])).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bonds of point `at` of a cube of `n` points a side, horizon 3.
    fn cube(n: i32, at: [i32; 3]) -> Vec<Vector<3>> {
        let all = (0..n * n * n).map(|k| [k % n, k / n % n, k / n / n]);
        all.map(|k| Vector::<3>::from_fn(|i, _| f64::from(k[i] - at[i])))
            .filter(|xi| xi.norm() > 0.0 && xi.norm() <= 3.0)
            .collect()
    }

    fn fitted(
        bonds: &[Vector<3>],
        fields: CalibrationFields,
    ) -> Result<PositionAware, NotPositionAware> {
        let (volumes, base) = (vec![0.7; bonds.len()], vec![2.0; bonds.len()]);
        let family = Family {
            bonds,
            volumes: &volumes,
            factors: &base,
            horizon: 3.0,
            bond_horizons: &[],
            materials: None,
        };
        fit(&family, &base, fields)
    }

    /// `W` with κ = 2, μ = 3 under the strain `a`, by the sums that define it, and that of elasticity.
    fn energies(bonds: &[Vector<3>], weights: &PositionAware, a: &Tensor<3>) -> [f64; 2] {
        let e = |xi: &Vector<3>| xi.dot(&(a * xi)) / xi.norm();
        let sum = |f: &dyn Fn(usize) -> f64| (0..bonds.len()).map(|k| f(k) * 0.7).sum::<f64>();
        let theta = sum(&|k| weights.omega[k] * bonds[k].norm() * e(&bonds[k]));
        let square = |k: usize| (e(&bonds[k]) - theta * bonds[k].norm() / 3.0).powi(2);
        let found = theta * theta + 3.0 * sum(&|k| weights.sigma[k] * square(k));
        let dev = a - Tensor::identity() * (a.trace() / 3.0);
        [found, a.trace().powi(2) + 3.0 * dev.dot(&dev)]
    }

    #[test]
    fn six_fields_store_the_energy_of_elasticity_at_faces_edges_and_corners() {
        for at in [
            [3, 3, 3],
            [0, 3, 3],
            [0, 0, 3],
            [0, 0, 0],
            [1, 0, 2],
            [6, 1, 5],
        ] {
            let bonds = cube(7, at);
            let weights = fitted(&bonds, CalibrationFields::Axes).unwrap();
            assert!(weights.sigma.iter().all(|s| *s >= 0.0), "{at:?}");
            for a in strains::<3>().iter().chain([&Tensor::identity()]) {
                let [found, exact] = energies(&bonds, &weights, a);
                assert!(
                    (found / exact - 1.0).abs() < 1e-12,
                    "{at:?} {a}: {found} {exact}"
                );
            }
        }
    }

    #[test]
    fn all_affine_fields_store_it_at_faces_and_edges_and_corners_are_refused_with_the_reason() {
        let bent = Tensor::<3>::new(1.0, 0.3, -0.2, 0.3, -0.4, 0.7, -0.2, 0.7, 0.5);
        for at in [[3, 3, 3], [0, 3, 3]] {
            let bonds = cube(7, at);
            let weights = fitted(&bonds, CalibrationFields::Affine).unwrap();
            let [found, exact] = energies(&bonds, &weights, &bent);
            assert!(
                (found / exact - 1.0).abs() < 1e-12,
                "{at:?}: {found} {exact}"
            );
        }
        let error = fitted(&cube(7, [0, 0, 0]), CalibrationFields::Affine).unwrap_err();
        assert!(error.bounded && error.conditions == 15, "{error}");
        let text = error.to_string();
        assert!(
            text.contains("negative weights") && text.contains("axes"),
            "{text}"
        );
    }

    /// A place inside a lattice cell near an edge of the cube, as a Gauss point is, with a wide horizon.
    fn around_gauss_point(at: [f64; 3]) -> Vec<Vector<3>> {
        let all = (0..343).map(|k| [k % 7, k / 7 % 7, k / 49]);
        all.map(|k| Vector::<3>::from_fn(|i, _| f64::from(k[i]) - at[i]))
            .filter(|xi| xi.norm() <= 4.0)
            .collect()
    }

    #[test]
    fn the_partial_stress_of_any_family_is_exact_and_without_odd_moments_where_they_are_asked_for()
    {
        for (at, odd_vanish) in [([3.2, 2.8, 3.3], true), ([0.3, 3.2, 2.8], false)] {
            let bonds = around_gauss_point(at);
            let (volumes, base) = (vec![0.7; bonds.len()], vec![2.0; bonds.len()]);
            let family = Family {
                bonds: &bonds,
                volumes: &volumes,
                factors: &base,
                horizon: 4.0,
                bond_horizons: &[],
                materials: None,
            };
            for stress in [StressFit::Affine, StressFit::Quadratic] {
                let weights = fit_stress(&family, &base, stress).unwrap();
                let bent = Tensor::<3>::new(1.0, 0.3, -0.2, 0.3, -0.4, 0.7, -0.2, 0.7, 0.5);
                let [found, exact] = energies(&bonds, &weights, &bent);
                assert!((found / exact - 1.0).abs() < 1e-12, "{at:?} {stress:?}");
                let moments = [0, 1, 2].map(|i| {
                    let sum = |f: &dyn Fn(usize) -> f64| (0..bonds.len()).map(f).sum::<f64>();
                    let cube = |k: usize| bonds[k][0] * bonds[k][1] * bonds[k][i];
                    let along = |k: usize| (bonds[k][2] / bonds[k].norm()).powi(2);
                    let of_omega = sum(&|k| weights.omega[k] * 0.7 * cube(k));
                    let of_sigma = sum(&|k| weights.sigma[k] * 0.7 * cube(k) * along(k));
                    f64::max(of_omega.abs(), of_sigma.abs())
                });
                let largest = moments.into_iter().fold(0.0, f64::max);
                let vanish = odd_vanish && stress == StressFit::Quadratic;
                assert_eq!(largest < 1e-12, vanish, "{at:?} {stress:?}: {largest:e}");
            }
        }
    }

    #[test]
    fn a_plane_of_points_has_no_dilatation_in_space() {
        let mut bonds = cube(7, [3, 3, 3]);
        bonds.retain(|xi| xi.z == 0.0);
        let error = fitted(&bonds, CalibrationFields::Axes).unwrap_err();
        assert_eq!(
            (error.of, error.rank, error.conditions),
            ("dilatation", 3, 6)
        );
    }
}
