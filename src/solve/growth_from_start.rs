//! Energy that growing modes add to a motion that starts from a known state and is left to itself.
//!
//! A mode grows from what the motion has of it. With `y = √M u`, `ÿ = −A y` and `A U = U Λ` the coefficients `c = U⁻¹ y` obey `c̈ = −λ c`, so that the growing part of a mode of `s = √(−λ)` is `a exp(s t)`, `a = ½ (c + ċ/s)` at the start.
//! Rounding adds to a whatever the start has: 1e-16 of the motion at every step.

use nalgebra::{Complex, DMatrix};

use crate::{
    solve::{
        instability_growth::{DENSE, dense, free_dofs, stepped_growth_rate},
        krylov::norm,
        stable_step::{Scaled, StepError},
    },
    system::SemiDiscrete,
};

/// Energy of all growing modes after `steps` steps of `step`, over that of the start `(u, v)`; an upper bound, since the modes are added with one sign. None of a model with more unknowns than [`DENSE`], or of a body at rest.
///
/// Shapes: displacement and velocity have one entry per dof. `prescribed` dofs stay where they are.
///
/// # Errors
/// [`StepError::Row`] for a site without mass, [`StepError::Eigenvalues`].
pub fn energy_gained(
    system: &dyn SemiDiscrete,
    prescribed: &[u32],
    (step, steps): (f64, u64),
    (u, v): (&[f64], &[f64]),
) -> Result<Option<f64>, StepError> {
    let mut operator = Scaled::new(system, prescribed)?;
    if operator.free.count() > DENSE {
        return Ok(None);
    }
    let (y, rate) = (operator.scaled(u), operator.scaled(v));
    let mut force = vec![0.0; y.len()];
    operator.apply_into(&y, &mut force);
    let stored: f64 = y.iter().zip(&force).map(|(y, f)| y * f).sum();
    let energy = 0.5 * (stored.abs() + norm(&rate).powi(2));
    if energy == 0.0 {
        return Ok(None);
    }
    let free = free_dofs(&operator);
    let matrix = dense(&mut operator)?;
    let eigen = matrix.eigen().map_err(|_| StepError::Eigenvalues)?;
    let n = free.len();
    let complex = |re: f64, im: f64| Complex::new(re, im);
    let modes = DMatrix::from_fn(n, n, |i, k| {
        let entry = eigen.U()[(i, k)];
        complex(entry.re, entry.im)
    });
    let start = DMatrix::from_fn(n, 2, |i, k| complex([&y, &rate][k][free[i]], 0.0));
    let content = modes.clone().lu().solve(&start);
    let content = content.ok_or(StepError::Eigenvalues)?;
    let values = eigen.S().column_vector();
    let duration = step * steps as f64;
    let mut sum = 0.0;
    for k in 0..n {
        let (re, im) = (values[k].re, values[k].im);
        let growth = stepped_growth_rate(re, im, step) * duration;
        if growth <= LEAST {
            continue;
        }
        let root = complex(-re, -im).sqrt();
        // of either root the one that grows
        let root = if root.re < 0.0 { -root } else { root };
        let own = (content[(k, 0)] + content[(k, 1)] / root).norm() * 0.5;
        let rounding = ROUND_OFF * (steps as f64).sqrt() * (norm(&y) + norm(&rate) / root.norm());
        let size = modes.column(k).norm();
        sum += (own + rounding / size) * size * root.norm() * growth.exp();
    }
    Ok(Some(sum * sum / energy))
}

/// Growth by less than `exp` of this is due to the rounding of double eigenvalues.
const LEAST: f64 = 1e-3;

/// Rounding error that a step adds to a motion, relative to its size.
const ROUND_OFF: f64 = 1e-16;
