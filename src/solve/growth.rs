//! Whether a motion is bounded at any step: modes that grow.
//!
//! A mode with `K w = λ M w` grows as `exp(σ t)`, `σ = |Re √(−λ)|`, unless λ is real and not negative; where `K` is not symmetric that is a question.
//! The eigenvalues themselves answer it while the model is small. Beyond, the motion is run from noise: velocity Verlet is the Chebyshev polynomial that is bounded by 1
//! where λ is stable and grows fastest elsewhere, so that no other polynomial of as many products shows an unstable mode more clearly.

use crate::{
    solve::{
        krylov::norm,
        stable_step::{Scaled, Space, StepError},
    },
    system::{Dynamic, Symmetry},
};

/// Unknowns up to which eigenvalues are computed one and all: a second of time.
pub const DENSE: usize = 600;

/// A growth of this factor in a run from noise is no chance: where every mode is bounded the norm keeps within tens of per cent.
const SHOWN: f64 = 4.0;

/// Growth by `exp` of this over a planned run is refused.
pub const LARGEST_GAIN: f64 = 0.5;

/// How fast the fastest growing mode of a model grows.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Growth {
    /// σ of the fastest growing mode \[1/s\]; 0 if none was found.
    pub rate: f64,
    /// Slower growth than this would not have been seen \[1/s\].
    pub resolution: f64,
    /// Its eigenvalue λ, real and imaginary part \[1/s²\].
    pub eigenvalue: [f64; 2],
    /// The site where it is largest.
    pub site: usize,
    /// Products with the stiffness that it took.
    pub products: usize,
}

/// `σ = |Re √(−λ)|`.
pub fn growth_rate(real: f64, imaginary: f64) -> f64 {
    let size = real.hypot(imaginary);
    // without cancellation where λ is nearly real and positive
    let twice = if real > 0.0 {
        imaginary * imaginary / (size + real)
    } else {
        size - real
    };
    (0.5 * twice).sqrt()
}

/// How fast the model's motion grows, for a run of `steps` steps of size `step`; `prescribed` lists the dofs that are not free.
///
/// Up to [`DENSE`] unknowns all eigenvalues are computed; beyond, a tenth of the steps is run from noise (at least 200 and at most 4000).
///
/// # Errors
/// [`StepError::Row`] for a site without mass, [`StepError::Eigenvalues`].
pub fn growth(
    system: &dyn Dynamic,
    prescribed: &[u32],
    step: f64,
    steps: u64,
) -> Result<Growth, StepError> {
    let mut operator = Scaled::new(system, prescribed)?;
    // one change of threads instead of several per product
    rayon::scope(|_| {
        if operator.free.count() <= DENSE {
            growth_by_eigenvalues(&mut operator)
        } else {
            growth_from_noise(&mut operator, step, (steps / 10).clamp(200, 4000))
        }
    })
}

/// All eigenvalues of a small model, real and imaginary parts \[1/s²\].
///
/// # Errors
/// [`StepError::Row`] for a site without mass, [`StepError::Eigenvalues`].
pub fn eigenvalues(system: &dyn Dynamic, prescribed: &[u32]) -> Result<Vec<[f64; 2]>, StepError> {
    let mut operator = Scaled::new(system, prescribed)?;
    dense(&mut operator)?
        .eigenvalues()
        .map(|values| values.iter().map(|s| [s.re, s.im]).collect())
        .map_err(|_| StepError::Eigenvalues)
}

/// The operator on its free dofs.
fn dense(operator: &mut Scaled<'_>) -> Result<faer::Mat<f64>, StepError> {
    let free = free_dofs(operator);
    let (mut x, mut y) = (vec![0.0; operator.dofs()], vec![0.0; operator.dofs()]);
    let mut matrix = faer::Mat::zeros(free.len(), free.len());
    for (j, &k) in free.iter().enumerate() {
        x[k] = 1.0;
        operator.apply_into(&x, &mut y);
        x[k] = 0.0;
        for (i, &k) in free.iter().enumerate() {
            matrix[(i, j)] = y[k];
        }
    }
    if operator.system.symmetry() == Symmetry::Symmetric {
        // to round-off it is, and then eigenvalues are real
        matrix = faer::Mat::from_fn(free.len(), free.len(), |i, j| {
            0.5 * (matrix[(i, j)] + matrix[(j, i)])
        });
    }
    Ok(matrix)
}

fn free_dofs(operator: &Scaled<'_>) -> Vec<usize> {
    let d = operator.system.block().max(1);
    (0..operator.dofs())
        .filter(|k| operator.free.is_free(k / d, k % d))
        .collect()
}

fn growth_by_eigenvalues(operator: &mut Scaled<'_>) -> Result<Growth, StepError> {
    let free = free_dofs(operator);
    let matrix = dense(operator)?;
    let eigen = matrix.eigen().map_err(|_| StepError::Eigenvalues)?;
    let values = eigen.S().column_vector();
    let largest = (0..free.len()).fold(0.0_f64, |m, k| m.max(values[k].re.hypot(values[k].im)));
    // zero comes out as round-off of the largest, and its square root is what counts
    let resolution = (1e-13 * largest).sqrt();
    let rate = |k: usize| growth_rate(values[k].re, values[k].im);
    let best = (0..free.len()).fold(0, |best, k| if rate(k) > rate(best) { k } else { best });
    let mut found = Growth {
        rate: 0.0,
        resolution,
        eigenvalue: [0.0; 2],
        site: 0,
        products: operator.products,
    };
    if !free.is_empty() && rate(best) > resolution {
        let mut mode = vec![0.0; operator.dofs()];
        for (i, &k) in free.iter().enumerate() {
            let c = eigen.U()[(i, best)];
            mode[k] = c.re.hypot(c.im);
        }
        found.rate = rate(best);
        found.eigenvalue = [values[best].re, values[best].im];
        found.site = operator.site_of(&mode);
    }
    Ok(found)
}

fn growth_from_noise(
    operator: &mut Scaled<'_>,
    step: f64,
    steps: u64,
) -> Result<Growth, StepError> {
    // x_k = T_k(1 − Δt² λ/2) x_0
    let mut last = operator.noise();
    let mut y = vec![0.0; operator.dofs()];
    operator.apply_into(&last, &mut y);
    let mut x: Vec<f64> = last
        .iter()
        .zip(&y)
        .map(|(x, y)| x - 0.5 * step * step * y)
        .collect();
    let mut early: f64 = 1.0;
    let mut late: f64 = 0.0;
    let mut taken = 1;
    while taken < steps {
        operator.apply_into(&x, &mut y);
        for ((last, x), y) in last.iter_mut().zip(&x).zip(&y) {
            *last = 2.0 * x - *last - step * step * y;
        }
        std::mem::swap(&mut last, &mut x);
        taken += 1;
        if taken % 10 == 0 || taken == steps {
            let size = norm(&x);
            if 4 * taken <= steps {
                early = early.max(size);
            } else if 4 * taken >= 3 * steps {
                late = late.max(size);
            }
            // growth that is beyond doubt needs no more steps
            if size > 1e8 || !size.is_finite() {
                late = size;
                break;
            }
        }
    }
    let duration = taken as f64 * step;
    let unknowns = operator.free.count() as f64;
    let mut found = Growth {
        rate: 0.0,
        resolution: (SHOWN * unknowns.sqrt()).ln() / duration,
        eigenvalue: [0.0; 2],
        site: 0,
        products: operator.products,
    };
    if late > SHOWN * early || !late.is_finite() {
        // what has grown is nearly alone in x, and a small space tells its eigenvalue
        let site = operator.site_of(&x);
        let space = Space::new(operator, x, 12);
        let ([re, im], _) = space.extreme(|[re, im]| growth_rate(re, im))?;
        found = Growth {
            rate: growth_rate(re, im),
            eigenvalue: [re, im],
            site,
            products: operator.products,
            ..found
        };
    }
    Ok(found)
}

impl Growth {
    /// Refuses a model whose motion grows by more than `exp(`[`LARGEST_GAIN`]`)` over `duration` \[s\].
    ///
    /// # Errors
    /// [`StepError::Unstable`] with `remedy`.
    pub fn admit(&self, duration: f64, remedy: &str) -> Result<(), StepError> {
        let gain = self.rate * duration;
        if gain <= LARGEST_GAIN {
            return Ok(());
        }
        Err(StepError::Unstable {
            rate: self.rate,
            gain,
            real: self.eigenvalue[0],
            imaginary: self.eigenvalue[1],
            site: self.site,
            remedy: remedy.to_owned(),
        })
    }
}

#[cfg(test)]
#[path = "growth_tests.rs"]
mod tests;
