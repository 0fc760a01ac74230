//! The manufactured problems (5.9), (5.13) and (5.19): `u = (x², 0, 0)` under a constant body force, displacements given in a boundary layer.

use std::time::{Duration, Instant};

use super::{
    norms::Errors,
    stencil::{Constants, Stencil, StencilOperator},
};
use bondline::{
    peridynamics::{Influence, PartialVolume, PartialVolumeError},
    progress::Silent,
    solve::krylov::{self, Identity, KrylovError, KrylovParams},
};

/// Horizon of all three problems.
pub const HORIZON: f64 = 0.04;

/// Relative residual of the error's equation; the error itself is what is solved for, so that its own digits count.
pub const TOLERANCE: f64 = 1e-9;

/// Weighted volume that the constants are made with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WeightedVolume {
    /// The integral (5.12), (5.18), as the text has it.
    Integral,
    /// Its sum over the lattice, as codes compute it.
    Sum,
}

/// One discretisation of a problem: which one, by the dimension `D`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Discretisation {
    /// Points along each edge of the unit cube; `h = 1/N`.
    pub points: usize,
    /// Quadrature weights.
    pub algorithm: PartialVolume,
    /// Influence function.
    pub influence: Influence,
    /// Weighted volume of the constants.
    pub weighted_volume: WeightedVolume,
}

/// Results of a discretisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Errors in the inner domain.
    pub errors: Errors,
    /// `b − A u` of the exact solution, the same at every inner point, over `|b|`.
    pub residual: f64,
    /// Iterations of conjugate gradients.
    pub iterations: usize,
    /// Inner points.
    pub points: usize,
    /// Directed bonds of the inner points.
    pub bonds: usize,
    /// Time of it all.
    pub time: Duration,
}

/// Failure of a discretisation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProblemError {
    /// No family.
    #[error(transparent)]
    Family(#[from] PartialVolumeError),
    /// No solution.
    #[error(transparent)]
    Solve(#[from] KrylovError),
    /// The boundary layers leave nothing.
    #[error("manufactured problem: {points} points along an edge leave no inner point; use more")]
    NoInside {
        /// Points along an edge.
        points: usize,
    },
}

/// Body force along x of the problem of that dimension.
///
/// Source: [SAND2015-7998] sections 5.3 to 5.5 with K = 1; E = 1; K = 1, G = 1/2.
pub fn body_force<const D: usize>() -> f64 {
    match D {
        1 => -2.0,
        2 => -9.0 / 4.0,
        _ => -10.0 / 3.0,
    }
}

/// Constants of the operator. Source: eq. (5.11), (5.15), (5.19a).
fn constants<const D: usize>(m: f64) -> Constants {
    let (bulk, shear) = (1.0, 0.5);
    match D {
        1 => Constants {
            bond: 2.0 / m,
            dilatation: 0.0,
        },
        2 => Constants {
            bond: 6.0 / m,
            dilatation: 0.0,
        },
        _ => Constants {
            bond: 30.0 * shear / m,
            dilatation: (3.0 * bulk - 5.0 * shear) / m * 3.0 / m,
        },
    }
}

/// Points along an edge that lie in the boundary layer at its lower end: of width δ, in 3D 2δ, its far face included.
pub fn layer<const D: usize>(points: usize) -> usize {
    let width = if D == 3 { 2.0 * HORIZON } else { HORIZON };
    // points k = 0, 1, … lie at (k + ½) h; one on the layer's far face, up to rounding, belongs to it
    (width * points as f64 + 0.5 + 1e-9).floor() as usize
}

/// `b − A u` of the exact solution at an inner point, over `|b|`: what the quadrature alone gets wrong, without a solution.
///
/// # Errors
/// [`ProblemError::Family`].
pub fn residual<const D: usize>(d: &Discretisation) -> Result<f64, ProblemError> {
    let (_, _, residual) = discrete::<D>(d)?;
    Ok(residual / body_force::<D>().abs())
}

/// The stencil, the operator's constants and `b − A u` of the exact solution.
fn discrete<const D: usize>(
    d: &Discretisation,
) -> Result<(Stencil<D>, Constants, f64), ProblemError> {
    let h = 1.0 / d.points as f64;
    let stencil = Stencil::<D>::new(d.algorithm, d.influence, HORIZON, h)?;
    let square = |xi: &[f64; D]| xi.iter().map(|c| c * c).sum::<f64>();
    let m = match d.weighted_volume {
        WeightedVolume::Integral => d.influence.weighted_volume::<D>(HORIZON),
        WeightedVolume::Sum => stencil.sum(|xi| square(&xi)),
    };
    let constants = constants::<D>(m);
    let fourth = stencil.sum(|xi| xi[0].powi(4) / square(&xi));
    let second = stencil.sum(|xi| xi[0] * xi[0]);
    let force = constants.bond * fourth + 2.0 * constants.dilatation * second * second;
    Ok((stencil, constants, body_force::<D>() + force))
}

/// Solves the problem of dimension `D`.
///
/// The exact solution is quadratic, so that the discrete operator's residual on it is the same constant at every inner point (families are whole). The
/// error solves `A e = r` with `e = 0` in the layer, and is solved for directly.
///
/// Differs from the text by: lattice points half a spacing beyond the body, which families of the third and fourth algorithm in 3D reach for their
/// dilatation, are there with `u = g`.
///
/// # Errors
/// [`ProblemError`].
pub fn solve<const D: usize>(d: &Discretisation) -> Result<Outcome, ProblemError> {
    let start = Instant::now();
    let h = 1.0 / d.points as f64;
    let (stencil, constants, residual) = discrete::<D>(d)?;
    let first = layer::<D>(d.points);
    let inner = d.points.saturating_sub(2 * first);
    if inner == 0 {
        return Err(ProblemError::NoInside { points: d.points });
    }
    let b = body_force::<D>();
    let operator = StencilOperator::new(&stencil, constants, inner);
    let points = inner.pow(D as u32);
    let mut rhs = vec![0.0; operator.unknowns()];
    rhs[..points].fill(1.0);
    let params = KrylovParams {
        tolerance: TOLERANCE,
        ..KrylovParams::default()
    };
    let (mut error, info) =
        krylov::conjugate_gradients(&operator, &Identity, &rhs, &params, &Silent)?;
    error.iter_mut().for_each(|e| *e *= residual);
    Ok(Outcome {
        errors: Errors::of_square::<D>(&error, inner, (first as f64 + 0.5) * h, h),
        residual: residual / b.abs(),
        iterations: info.iterations,
        points,
        bonds: points * stencil.bonds.len(),
        time: start.elapsed(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    fn discretisation(points: usize, algorithm: PartialVolume, n: u32) -> Discretisation {
        Discretisation {
            points,
            algorithm,
            influence: Influence::polynomial(n, 0).unwrap(),
            weighted_volume: WeightedVolume::Integral,
        }
    }

    #[test]
    fn the_bar_agrees_with_a_dense_solution_for_the_displacement() {
        // assembled bond by bond, solved for u itself, with g in the layer
        let points = 83;
        let h = 1.0 / points as f64;
        let x = |i: i64| (i as f64 + 0.5) * h;
        let inner: Vec<i64> = (0..points as i64)
            .filter(|&i| x(i) > HORIZON && x(i) < 1.0 - HORIZON)
            .collect();
        let n = inner.len();
        // P1: m = 2 δ³ (1/3 − 1/4)
        let c = 2.0 / (2.0 * HORIZON.powi(3) / 12.0);
        let mut k = DMatrix::<f64>::zeros(n, n);
        let mut f = DVector::<f64>::from_element(n, -2.0);
        for (row, &i) in inner.iter().enumerate() {
            for j in i - 4..=i + 4 {
                let r = (x(j) - x(i)).abs();
                if j == i || r > HORIZON {
                    continue;
                }
                let w = c * (1.0 - r / HORIZON) * h;
                k[(row, row)] += w;
                match inner.iter().position(|&q| q == j) {
                    Some(column) => k[(row, column)] -= w,
                    None => f[row] += w * x(j) * x(j),
                }
            }
        }
        let u = k.lu().solve(&f).unwrap();
        let nodal: f64 = inner
            .iter()
            .zip(u.iter())
            .map(|(&i, u)| h * (u - x(i) * x(i)).powi(2))
            .sum::<f64>()
            .sqrt();
        let outcome = solve::<1>(&discretisation(points, PartialVolume::Full, 1)).unwrap();
        assert_eq!(outcome.points, n);
        assert!((outcome.errors.nodal / nodal - 1.0).abs() < 1e-8);
    }

    #[test]
    fn boundary_layers_have_the_width_of_the_text() {
        for points in 75..=150usize {
            let h = 1.0 / points as f64;
            let within = |width: f64| {
                (0..points)
                    .filter(|&k| (k as f64 + 0.5) * h <= width)
                    .count()
            };
            assert_eq!(layer::<1>(points), within(0.04));
            assert_eq!(layer::<3>(points), within(0.08));
        }
        let none = solve::<2>(&discretisation(25, PartialVolume::Full, 0));
        assert!(none.is_ok());
        let none = solve::<3>(&discretisation(1, PartialVolume::Full, 0)).unwrap_err();
        assert!(none.to_string().contains("horizon / spacing"));
    }

    #[test]
    fn with_the_lattice_s_own_weighted_volume_the_bar_is_exact() {
        let mut d = discretisation(91, PartialVolume::PdLammps, 0);
        d.weighted_volume = WeightedVolume::Sum;
        assert!(solve::<1>(&d).unwrap().errors.largest < 1e-12);
    }

    #[test]
    fn residuals_vanish_as_the_quadrature_gets_exact() {
        // consistency of c, a, b and the body force in every dimension
        let residual = |n| {
            let d = discretisation(n, PartialVolume::Full, 7);
            [
                solve::<1>(&d).unwrap().residual.abs(),
                solve::<2>(&d).unwrap().residual.abs(),
            ]
        };
        for (coarse, fine) in residual(80).into_iter().zip(residual(320)) {
            assert!(fine < 1e-4 && fine < 0.1 * coarse, "{coarse:e} {fine:e}");
        }
        let h = HORIZON / 14.0;
        let influence = Influence::polynomial(7, 0).unwrap();
        let stencil = Stencil::<3>::new(PartialVolume::Full, influence, HORIZON, h).unwrap();
        let c = constants::<3>(influence.weighted_volume::<3>(HORIZON));
        let fourth = stencil.sum(|x| x[0].powi(4) / x.iter().map(|c| c * c).sum::<f64>());
        let second = stencil.sum(|x| x[0] * x[0]);
        let force = c.bond * fourth + 2.0 * c.dilatation * second * second;
        assert!((force / -body_force::<3>() - 1.0).abs() < 1e-3, "{force}");
    }
}
