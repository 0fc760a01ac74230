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
    peridynamics::Family,
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
    /// What cannot be exact: `dilatation` or `deviatoric energy`.
    pub of: &'static str,
    /// Bonds with weight.
    pub bonds: usize,
    /// Independent conditions among the bonds.
    pub rank: usize,
    /// Number of conditions.
    pub conditions: usize,
    /// Whether weights of any sign would meet them.
    pub bounded: bool,
    /// What helps beside a wider horizon.
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
    let d = D as f64;
    let count = base.iter().filter(|w| **w > 0.0).count();
    let shares: Vec<f64> = (0..base.len())
        .map(|k| base[k] * family.bonds[k].norm_squared() * family.volumes[k])
        .collect();
    let m: f64 = shares.iter().sum();
    let refused = |of, conditions, rank, bounded| NotPositionAware {
        of,
        bonds: count,
        rank,
        conditions,
        bounded,
        remedy: match fields {
            CalibrationFields::Affine if of == DEVIATOR => {
                "use calibration-fields = \"axes\", which asks for less, or the law lps"
            }
            _ => "use the law lps",
        },
    };
    if m.is_nan() || m <= 0.0 {
        return Err(refused("dilatation", D * (D + 1) / 2, 0, false));
    }
    let directions: Vec<Vector<D>> = family.bonds.iter().map(|xi| xi / xi.norm()).collect();

    let strains = strains::<D>();
    let of_direction = |a: &Tensor<D>, n: &Vector<D>| n.dot(&(a * n));
    let rows = DMatrix::from_fn(strains.len(), base.len(), |c, k| {
        of_direction(&strains[c], &directions[k])
    });
    let wanted = DVector::from_fn(strains.len(), |c, _| strains[c].trace());
    // the values of a complete family
    let whole: Vec<f64> = shares.iter().map(|s| d / m * s).collect();
    let change = changes(&rows, &whole, wanted, Bound::Free)
        .map_err(|(rank, _)| refused("dilatation", strains.len(), rank, false))?;
    let omega = (0..base.len())
        .map(|k| d / m * base[k] * (1.0 + change[k]))
        .collect();

    let pairs = products::<D>(fields);
    let rows = DMatrix::from_fn(pairs.len(), base.len(), |c, k| {
        let (a, b) = &pairs[c];
        of_direction(a, &directions[k]) * of_direction(b, &directions[k])
    });
    let wanted = DVector::from_fn(pairs.len(), |c, _| pairs[c].0.dot(&pairs[c].1));
    let whole: Vec<f64> = shares
        .iter()
        .map(|s| d * (d + 2.0) / (2.0 * m) * s)
        .collect();
    let change = changes(&rows, &whole, wanted, Bound::AtLeast(0.0))
        .map_err(|(rank, bounded)| refused(DEVIATOR, pairs.len(), rank, bounded))?;
    let sigma = (0..base.len())
        .map(|k| d * (d + 2.0) / (2.0 * m) * base[k] * (1.0 + change[k]).max(0.0))
        .collect();
    Ok(PositionAware { omega, sigma })
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
