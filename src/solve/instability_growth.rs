//! Modes that grow: tests if a motion is bounded at any step.
//!
//! A mode with `K w = λ M w` grows as `exp(σ t)`, `σ = |Re √(−λ)|`, unless λ is real and not negative; where `K` is not symmetric that is a question. Steps of Δt add to it near the
//! limit of the step: `σ = 2/Δt |Re arsinh(Δt/2 √(−λ))|`, three times as fast for a weak pair of complex λ at 0.95 of the limit. The rates here are those of the stepped motion.
//!
//! The eigenvalues themselves answer it while the model is small. Beyond, two things are tried. The motion is run from noise: velocity Verlet is the Chebyshev polynomial that is bounded by 1
//! where λ is stable and grows fastest elsewhere, so that no other polynomial of as many products shows an unstable mode more clearly. And all eigenvalues of neighbourhoods of
//! the seam are computed, where the noise stayed longest: a mode that grows by itself lives where rows and columns differ. What either finds is there; that neither finds any is no proof, and the resolution says how much could hide.

use crate::{
    solve::{
        krylov::norm,
        neighbourhood::Neighbourhood,
        stable_step::{Scaled, Space, StepError},
    },
    system::{Ranks, SemiDiscrete, Symmetry},
};

/// Remedy for an unstable partial stress.
pub const REMEDY: &str = "give the material and the divergence an influence function P_n/|xi| with n >= 1 (bond-based: micromodulus triangular), keep the horizon constant in the transition zone, or use coupling.truncated";

/// Remedy for a splice or a blending whose motion grows.
pub const REMEDY_SEAM: &str = "make the run shorter, or use coupling.truncated if the material allows, whose stiffness is symmetric";

/// Unknowns up to which eigenvalues are computed one and all: a second of time.
pub const DENSE: usize = 600;

/// A growth of this factor in a run from noise is no chance: where every mode is bounded the norm keeps within tens of per cent.
const SHOWN: f64 = 4.0;

/// Growth by `exp` of this over a planned run is refused: the energy of the mode doubles.
pub const LARGEST_GAIN: f64 = 0.5 * std::f64::consts::LN_2;

/// Growth rate of the fastest growing mode of a model.
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
    /// The computation behind it.
    pub evidence: Evidence,
}

/// Computation behind a [`Growth`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Evidence {
    /// All eigenvalues of the model.
    Eigenvalues,
    /// A run from noise, and all eigenvalues of so many neighbourhoods of the seam.
    Noise {
        /// Number of neighbourhoods.
        neighbourhoods: usize,
    },
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

/// Growth rate of a mode of eigenvalue λ that is stepped by velocity Verlet, `σ = 2/Δt |Re arsinh(Δt/2 √(−λ))|` \[1/s\]; the rate of the motion itself for a step of zero.
///
/// With `w = Δt/2 √(−λ) = a + i b`, `cosh Re arsinh w = (|w + i| + |w − i|)/2`, written without cancellation \[Hull1997\].
pub fn stepped_growth_rate(real: f64, imaginary: f64, step: f64) -> f64 {
    let half = 0.5 * step;
    let a = half * growth_rate(real, imaginary);
    if half == 0.0 {
        return growth_rate(real, imaginary);
    }
    let size = real.hypot(imaginary);
    // |Im √(−λ)|, likewise without cancellation
    let b = half
        * if real > 0.0 {
            (0.5 * (size + real)).sqrt()
        } else if size > 0.0 {
            (0.5 * imaginary * imaginary / (size - real)).sqrt()
        } else {
            0.0
        };
    let (above, below) = (a.hypot(b + 1.0), a.hypot(b - 1.0));
    let of_below = if b <= 1.0 {
        a * a / (below + 1.0 - b).max(f64::MIN_POSITIVE)
    } else {
        below + (b - 1.0)
    };
    let excess = 0.5 * (a * a / (above + 1.0 + b) + of_below);
    (excess + (excess * (excess + 2.0)).sqrt()).ln_1p() / half
}

/// Computes the growth rate of the model's motion, for a run of `steps` steps of size `step` (zero: the motion without steps, of a small model); `prescribed` lists the dofs that are not free.
///
/// Up to [`DENSE`] unknowns all eigenvalues are computed. Beyond, a tenth of the steps is run from noise (at least 200 and at most 4000), and the eigenvalues of one to four neighbourhoods of the seam are computed if the model has no symmetry.
///
/// Collective, of processes: the first of `ranks` computes eigenvalues and tells them to all.
///
/// # Errors
/// [`StepError::Row`] for a site without mass, [`StepError::Eigenvalues`].
pub fn growth(
    system: &dyn SemiDiscrete,
    prescribed: &[u32],
    step: f64,
    steps: u64,
    ranks: Option<&dyn Ranks>,
) -> Result<Growth, StepError> {
    let mut operator = Scaled::new(system, prescribed)?;
    // one change of threads instead of several per product
    rayon::scope(|_| {
        let unknowns = operator.free.count();
        if unknowns <= DENSE {
            return Ok(growth_by_eigenvalues(&mut operator, step, ranks)?.0);
        }
        let products = (steps / 10).clamp(200, 4000);
        let (mut found, left) = growth_from_noise(&mut operator, step, products)?;
        if system.symmetry() == Symmetry::Unsymmetric && found.rate == 0.0 {
            let most = (steps as f64 * unknowns as f64 / WORK_PER_NEIGHBOURHOOD).clamp(1.0, 4.0);
            let near = NearSeam {
                prescribed,
                step,
                products,
                most: most as usize,
                ranks,
            };
            near.look(&mut operator, &left, &mut found)?;
        }
        Ok(found)
    })
}

/// Steps times unknowns of a run that pays for the eigenvalues of a neighbourhood with some 5 % of its own time.
const WORK_PER_NEIGHBOURHOOD: f64 = 1.3e8;

/// Search for growth in the neighbourhoods of the seam.
struct NearSeam<'a> {
    prescribed: &'a [u32],
    step: f64,
    /// Steps of the whole model that show whether a mode of a neighbourhood grows in it.
    products: u64,
    /// Neighbourhoods, at most.
    most: usize,
    ranks: Option<&'a dyn Ranks>,
}

impl NearSeam<'_> {
    /// Looks for growth near the seam, first where the run from noise has `left` the largest displacements.
    ///
    /// A mode of a part that is held at its edges is none of the whole: waves that would leave come back, and it may grow faster. So the whole model is run from it, and the rate is what that shows.
    fn look(
        &self,
        operator: &mut Scaled<'_>,
        left: &[f64],
        found: &mut Growth,
    ) -> Result<(), StepError> {
        let system = operator.system;
        let d = system.block().max(1);
        let mut candidates = system.seam_sites();
        let size = |site: u32| operator.size_at(left, site as usize);
        candidates.retain(|&s| size(s) > 0.0);
        candidates.sort_by(|&a, &b| size(b).total_cmp(&size(a)).then(a.cmp(&b)));
        let mut neighbourhoods = 0;
        let mut fastest: Option<(Growth, Vec<f64>)> = None;
        while neighbourhoods < self.most {
            let Some(&seed) = candidates.first() else {
                break;
            };
            let Some(near) = Neighbourhood::of(system, seed, self.prescribed, DENSE / d) else {
                break;
            };
            candidates.retain(|s| !near.contains(*s));
            neighbourhoods += 1;
            let mut part = Scaled::new(&near.motion, &near.held)?;
            let (local, mode) = growth_by_eigenvalues(&mut part, self.step, self.ranks)?;
            if local.rate <= fastest.as_ref().map_or(0.0, |(f, _)| f.rate) {
                continue;
            }
            let mut whole = vec![0.0; operator.dofs()];
            for (mode, &site) in mode.chunks_exact(d).zip(&near.sites) {
                whole[site as usize * d..][..d].copy_from_slice(mode);
            }
            let site = near.sites[local.site] as usize;
            fastest = Some((Growth { site, ..local }, whole));
        }
        if let Some((local, mode)) = fastest {
            let rate = rate_from(operator, mode, self.step, self.products);
            if rate > CONFIRMED * local.rate {
                found.rate = rate.min(local.rate);
                found.eigenvalue = local.eigenvalue;
                found.site = local.site;
            }
        }
        found.products = operator.products;
        found.evidence = Evidence::Noise { neighbourhoods };
        Ok(())
    }
}

/// The part of the rate of a neighbourhood that the whole model has to show. Strips and plates of `bondline verify meshes` show 0.5 to 1 of it, less where waves carry the mode away.
const CONFIRMED: f64 = 0.25;

/// The rate at which a motion grows that starts from a mode, by its size in the second and in the last quarter of so many steps; at most that, where the mode is mixed with others.
fn rate_from(operator: &mut Scaled<'_>, start: Vec<f64>, step: f64, steps: u64) -> f64 {
    let mut last = start;
    let begun = norm(&last);
    let mut y = vec![0.0; operator.dofs()];
    operator.apply_into(&last, &mut y);
    let pairs = last.iter().zip(&y);
    let mut x: Vec<f64> = pairs.map(|(x, y)| x - 0.5 * step * step * y).collect();
    let (mut early, mut late) = (0.0_f64, 0.0_f64);
    for taken in 2..=steps {
        operator.apply_into(&x, &mut y);
        for ((last, x), y) in last.iter_mut().zip(&x).zip(&y) {
            *last = 2.0 * x - *last - step * step * y;
        }
        std::mem::swap(&mut last, &mut x);
        let size = norm(&x);
        if !size.is_finite() || size > 1e12 * begun {
            return (2.0 * size.min(f64::MAX) / begun).ln() / (taken as f64 * step);
        }
        match 4 * taken / steps {
            1 => early = early.max(size),
            3.. => late = late.max(size),
            _ => {}
        }
    }
    if early > 0.0 && late > early {
        // a mode that starts at rest grows as cosh(σt): late / early = cosh(2a) / cosh(a) with a = σT/2
        let ratio = late / early;
        let cosh = 0.25 * (ratio + (ratio * ratio + 8.0).sqrt());
        cosh.max(1.0).acosh() / (0.5 * steps as f64 * step)
    } else {
        0.0
    }
}

/// All eigenvalues of a small model, real and imaginary parts \[1/s²\].
///
/// # Errors
/// [`StepError::Row`] for a site without mass, [`StepError::Eigenvalues`].
pub fn eigenvalues(
    system: &dyn SemiDiscrete,
    prescribed: &[u32],
) -> Result<Vec<[f64; 2]>, StepError> {
    let mut operator = Scaled::new(system, prescribed)?;
    dense(&mut operator)?
        .eigenvalues()
        .map(|values| values.iter().map(|s| [s.re, s.im]).collect())
        .map_err(|_| StepError::Eigenvalues)
}

/// The operator on its free dofs, as a matrix.
pub(super) fn dense(operator: &mut Scaled<'_>) -> Result<faer::Mat<f64>, StepError> {
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

/// The numbers of the free dofs, ascending.
pub(super) fn free_dofs(operator: &Scaled<'_>) -> Vec<usize> {
    let d = operator.system.block().max(1);
    (0..operator.dofs())
        .filter(|k| operator.free.is_free(k / d, k % d))
        .collect()
}

/// The fastest growing mode of a matrix.
struct Fastest {
    /// The largest size of any eigenvalue \[1/s²\].
    largest: f64,
    /// Its eigenvalue, real and imaginary part \[1/s²\].
    value: [f64; 2],
    /// Its vector, real and imaginary parts.
    vector: Vec<[f64; 2]>,
}

impl Fastest {
    /// Of a motion by steps of `step`; none if the eigenvalues are not found.
    fn of(matrix: &faer::Mat<f64>, step: f64) -> Option<Self> {
        let eigen = matrix.eigen().ok()?;
        let values = eigen.S().column_vector();
        let count = matrix.nrows();
        let rate = |k: usize| stepped_growth_rate(values[k].re, values[k].im, step);
        let best = (0..count).fold(0, |best, k| if rate(k) > rate(best) { k } else { best });
        let vector = (0..count).map(|i| eigen.U()[(i, best)]);
        Some(Self {
            largest: (0..count).fold(0.0, |m, k| values[k].re.hypot(values[k].im).max(m)),
            value: match count {
                0 => [0.0; 2],
                _ => [values[best].re, values[best].im],
            },
            vector: vector.map(|c| [c.re, c.im]).collect(),
        })
    }

    fn words(&self) -> Vec<u64> {
        let numbers = [self.largest, self.value[0], self.value[1]];
        let all = numbers.iter().chain(self.vector.as_flattened());
        all.map(|x| x.to_bits()).collect()
    }

    /// Reads the result of [`Fastest::words`]; none of no words.
    fn from_words(words: &[u64]) -> Option<Self> {
        let numbers: Vec<f64> = words.iter().map(|&w| f64::from_bits(w)).collect();
        let (&[largest, re, im], vector) = numbers.split_first_chunk()?;
        let (pairs, _) = vector.as_chunks();
        Some(Self {
            largest,
            value: [re, im],
            vector: pairs.to_vec(),
        })
    }
}

/// The fastest growing mode of a small model by all of its eigenvalues, and the real part of its vector in the scaled displacements of the operator; zero if none grows.
fn growth_by_eigenvalues(
    operator: &mut Scaled<'_>,
    step: f64,
    ranks: Option<&dyn Ranks>,
) -> Result<(Growth, Vec<f64>), StepError> {
    let free = free_dofs(operator);
    let matrix = dense(operator)?;
    let fastest = match ranks {
        None => Fastest::of(&matrix, step),
        Some(ranks) => {
            let found = (ranks.rank() == 0).then(|| Fastest::of(&matrix, step));
            let words = found.flatten().map_or(Vec::new(), |f| f.words());
            Fastest::from_words(&ranks.gather_words(&words)[0])
        }
    };
    let fastest = fastest.ok_or(StepError::Eigenvalues)?;
    // zero comes out as round-off of the largest, and its square root is what counts
    let resolution = (1e-13 * fastest.largest).sqrt();
    let rate = stepped_growth_rate(fastest.value[0], fastest.value[1], step);
    let mut found = Growth {
        rate: 0.0,
        resolution,
        eigenvalue: [0.0; 2],
        site: 0,
        products: operator.products,
        evidence: Evidence::Eigenvalues,
    };
    let mut real = vec![0.0; operator.dofs()];
    if rate > resolution {
        let mut mode = vec![0.0; operator.dofs()];
        for (&k, [re, im]) in free.iter().zip(fastest.vector) {
            mode[k] = re.hypot(im);
            real[k] = re;
        }
        found.rate = rate;
        found.eigenvalue = fastest.value;
        found.site = operator.site_of(&mode);
    }
    Ok((found, real))
}

/// Growth as a run from noise shows it, and the final state of the noise.
fn growth_from_noise(
    operator: &mut Scaled<'_>,
    step: f64,
    steps: u64,
) -> Result<(Growth, Vec<f64>), StepError> {
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
        evidence: Evidence::Noise { neighbourhoods: 0 },
    };
    if late > SHOWN * early || !late.is_finite() {
        // what has grown is nearly alone in x, and a small space tells its eigenvalue
        let site = operator.site_of(&x);
        let space = Space::new(operator, x.clone(), 12);
        let rate = |[re, im]: [f64; 2]| stepped_growth_rate(re, im, step);
        let ([re, im], _) = space.extreme(rate)?;
        found = Growth {
            rate: rate([re, im]),
            eigenvalue: [re, im],
            site,
            products: operator.products,
            ..found
        };
    }
    Ok((found, x))
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
#[path = "instability_growth_tests.rs"]
mod tests;
