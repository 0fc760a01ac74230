//! The stable step of velocity Verlet.
//!
//! A mode with `K w = λ M w` is stepped by `w_{n+1} − 2 w_n + w_{n−1} = −Δt² λ w_n`, which does not grow exponentially if and only if λ is real and `0 ≤ λ ≤ 4/Δt²`.
//! The stable step follows from an upper bound of λ \[1/s²\]. There are two:
//!
//! * **Certified**: `λ ≤ max_a Σ_b |K_ab| / m_a` (Gershgorin), valid for any `K`.
//! * **Sharp**: the largest Ritz value θ of Lanczos (symmetric) or Arnoldi in the inner product of the masses, from a random start. With
//!   `k` products on `n` unknowns `λ ≤ θ/(1 − ε)` fails with a probability of at most `1.648 √n exp(−√ε (2k − 1))` (\[Kuczynski1992\], theorem 3, symmetric);
//!   `ε` is [`MARGIN`], and `k` makes the probability 10⁻⁹. Without symmetry there is no such theorem, and the same margin is kept.
//!
//! A drag, `M ü + C v̄ + K u = f` with `v̄ = (u_n − u_{n−1})/Δt`, has the energy of `M − Δt C/2 − Δt² K/4`: with the bound Γ of [`RateBounds::drag`] the step is stable while `λ Δt² + 2 Γ Δt < 4`.
//!
//! Contact is not in the tangent at rest. The row sums of the certified bound contain a bound of its stiffness; the sharp bound adds [`RateBounds::stiffness`].
//!
//! If `K` is not symmetric, λ may be negative or complex. Such a mode grows at any step, see [`crate::solve::instability_growth`].

use crate::{
    solve::{
        FreeDofs,
        krylov::{add_scaled, dot, norm},
    },
    system::{RateBounds, SemiDiscrete, Symmetry},
};

/// `ε` of the sharp bound `λ ≤ θ/(1 − ε)`, which costs 2 % of the step.
pub const MARGIN: f64 = 0.04;

/// Probability with which the sharp bound of a symmetric model may fail.
const FAILURE: f64 = 1e-9;

/// Products with the stiffness between two tests whether a held step may stay.
const ASKED: usize = 2;

/// Basis vectors of Arnoldi may take this many bytes.
const BASIS_BYTES: usize = 512 << 20;

/// The limits of the time step of a model \[s\].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct StepLimit {
    /// Step that row sums guarantee to be stable.
    pub certified: f64,
    /// The site of the largest row sum over mass.
    pub certified_site: usize,
    /// The limit by the largest Ritz value θ without a margin, `2/√θ` if there are neither contact nor drag: the true limit, or a little above.
    pub estimate: f64,
    /// The step to take: the larger of the certified step and that of the sharp bound.
    pub stable: f64,
    /// Products with the stiffness that it took.
    pub products: usize,
}

/// Refusal of a time step, or of a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StepError {
    /// The step is too large.
    #[error(
        "the time step {requested:e} s is larger than the stable step {stable:e} s of this model (the limit itself is at most {limit:e} s, and the highest mode is largest at site {site}); leave the step out to take the stable one, or make the cells or the spacing around that site larger"
    )]
    TooLarge {
        /// The step asked for \[s\].
        requested: f64,
        /// The stable step \[s\].
        stable: f64,
        /// The limit as estimated \[s\].
        limit: f64,
        /// Site at which the highest mode is largest.
        site: usize,
    },
    /// The step is no step.
    #[error(
        "the time step is {requested}: it must be positive; leave it out to take the stable one"
    )]
    NoStep {
        /// The step asked for \[s\].
        requested: f64,
    },
    /// A site without mass or a row that is no number.
    #[error(
        "the row of site {site} gives no frequency (mass {mass}, sum of the row {sum}): every site needs a positive density and a finite stiffness"
    )]
    Row {
        /// The site.
        site: usize,
        /// Its mass \[kg\].
        mass: f64,
        /// The sum of its row \[N/m\].
        sum: f64,
    },
    /// A mode grows at any step.
    #[error(
        "this model is unstable in time at any step: a mode largest at site {site} grows as exp({rate:e} t), by exp({gain:.1}) over the run (eigenvalue {real:e} + {imaginary:e} i of M⁻¹K, which should be real and positive); {remedy}"
    )]
    Unstable {
        /// σ \[1/s\].
        rate: f64,
        /// `σ` times the duration of the run.
        gain: f64,
        /// Real part of λ.
        real: f64,
        /// Imaginary part of λ.
        imaginary: f64,
        /// Site at which the mode is largest.
        site: usize,
        /// The remedy.
        remedy: String,
    },
    /// Eigenvalues did not come out.
    #[error(
        "the eigenvalues of the model could not be computed; check its materials for extreme contrasts"
    )]
    Eigenvalues,
}

/// `M^{-1/2} K M^{-1/2}` on the free dofs: the eigenvalues of `M⁻¹ K`, and symmetric if `K` is.
pub(super) struct Scaled<'a> {
    pub(super) system: &'a dyn SemiDiscrete,
    pub(super) free: FreeDofs,
    /// `1/√m` of every dof.
    root: Vec<f64>,
    scratch: Vec<f64>,
    pub(super) products: usize,
}

impl<'a> Scaled<'a> {
    pub(super) fn new(system: &'a dyn SemiDiscrete, prescribed: &[u32]) -> Result<Self, StepError> {
        let d = system.block().max(1);
        let mass = system.mass();
        if let Some((site, &mass)) = mass
            .iter()
            .enumerate()
            .find(|(_, m)| !(**m > 0.0 && m.is_finite()))
        {
            let sum = f64::NAN;
            return Err(StepError::Row { site, mass, sum });
        }
        let dofs = mass.len() * d;
        let mut values = vec![None; dofs];
        for &k in prescribed {
            if let Some(value) = values.get_mut(k as usize) {
                *value = Some(0.0);
            }
        }
        Ok(Self {
            system,
            free: FreeDofs::from_prescribed(&values, d),
            root: (0..dofs).map(|k| 1.0 / mass[k / d].sqrt()).collect(),
            scratch: vec![0.0; dofs],
            products: 0,
        })
    }

    pub(super) fn dofs(&self) -> usize {
        self.root.len()
    }

    pub(super) fn apply_into(&mut self, x: &[f64], y: &mut [f64]) {
        for ((s, x), r) in self.scratch.iter_mut().zip(x).zip(&self.root) {
            *s = x * r;
        }
        self.system.tangent_into(&self.scratch, y);
        y.iter_mut().zip(&self.root).for_each(|(y, r)| *y *= r);
        self.free.clear_prescribed(y);
        self.products += 1;
    }

    /// `√M x` on the free dofs, zero elsewhere.
    pub(super) fn scaled(&self, x: &[f64]) -> Vec<f64> {
        let pairs = x.iter().zip(&self.root);
        let mut scaled: Vec<f64> = pairs.map(|(x, r)| x / r).collect();
        self.free.clear_prescribed(&mut scaled);
        scaled
    }

    /// Noise of unit norm on the free dofs, the same in every run.
    pub(super) fn noise(&self) -> Vec<f64> {
        let mut x = normal_numbers(self.dofs());
        self.free.clear_prescribed(&mut x);
        let size = norm(&x);
        if size > 0.0 {
            x.iter_mut().for_each(|x| *x /= size);
        }
        x
    }

    /// Returns the size of a mode at a site, in displacements.
    pub(super) fn size_at(&self, mode: &[f64], site: usize) -> f64 {
        let d = self.system.block().max(1);
        (site * d..(site + 1) * d).fold(0.0, |m: f64, k| m.max((mode[k] * self.root[k]).abs()))
    }

    /// The site where a mode is largest, in displacements.
    pub(super) fn site_of(&self, mode: &[f64]) -> usize {
        let size = |k: usize| (mode[k] * self.root[k]).abs();
        let dof = (0..mode.len()).fold(0, |best, k| if size(k) > size(best) { k } else { best });
        dof / self.system.block().max(1)
    }
}

/// Normally distributed numbers (splitmix64, Box and Muller): the direction of such a vector is uniform, as the bound for Lanczos requires.
fn normal_numbers(count: usize) -> Vec<f64> {
    let mut state = 0x0b0d_11e5_u64;
    let mut uniform = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..count)
        .map(|_| {
            let radius = (-2.0 * (1.0 - uniform()).ln()).sqrt();
            radius * (2.0 * std::f64::consts::PI * uniform()).cos()
        })
        .collect()
}

/// The limits of the time step of a system at rest; `prescribed` lists the dofs that are not free.
///
/// # Errors
/// [`StepError::Row`] for a site without mass or a row that is not finite, [`StepError::Eigenvalues`].
pub fn stable_step(system: &dyn SemiDiscrete, prescribed: &[u32]) -> Result<StepLimit, StepError> {
    // one change of threads instead of several per product
    Ok(rayon::scope(|_| limits(system, prescribed, None))?.0)
}

/// A step in use that may stay after a change of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// The step \[s\].
    pub step: f64,
    /// Largest fraction of the stable step that it may be.
    pub fraction: f64,
}

/// As [`stable_step`], but stops as soon as a held step is known to be stable: a step at a fraction of the limit leaves a wider margin, which takes fewer products.
///
/// After every few products the step is compared with the bound that they give, which fails with the probability of that of [`stable_step`] at each of about ten tests, and with its fraction of the stable step as they estimate it. If it may stay, [`StepLimit::stable`] is that bound.
/// Unsymmetric models take all products. Returns the limits, and true if the step may stay.
///
/// # Errors
/// As [`stable_step`].
pub fn stable_step_beyond(
    system: &dyn SemiDiscrete,
    prescribed: &[u32],
    held: Held,
) -> Result<(StepLimit, bool), StepError> {
    rayon::scope(|_| limits(system, prescribed, Some(held)))
}

fn limits(
    system: &dyn SemiDiscrete,
    prescribed: &[u32],
    held: Option<Held>,
) -> Result<(StepLimit, bool), StepError> {
    let mut operator = Scaled::new(system, prescribed)?;
    let d = system.block().max(1);
    let (mut largest, mut certified_site) = (0.0, 0);
    for (k, &sum) in system.row_sums().iter().enumerate() {
        let (site, mass) = (k / d, system.mass()[k / d]);
        if !sum.is_finite() {
            return Err(StepError::Row { site, mass, sum });
        }
        if operator.free.is_free(site, k % d) && sum / mass > largest {
            (largest, certified_site) = (sum / mass, site);
        }
    }
    let RateBounds {
        stiffness: hidden,
        drag,
    } = system.rate_bounds();
    // with the velocity half a step before a drag is stable while λ Δt² + 2 Γ Δt < 4
    let step_of = |square: f64| match drag > 0.0 {
        true => 4.0 / (drag + (drag * drag + 4.0 * square).sqrt()),
        false => 2.0 / square.sqrt(),
    };
    let certified = step_of(largest);
    // eigenvalues of a sum are at most the sum of the largest ones
    let bound = |theta: f64, margin: f64| step_of(theta / (1.0 - margin) + hidden);
    let unknowns = operator.free.count();
    let is_symmetric = system.symmetry() == Symmetry::Symmetric;
    let may_stay = |theta: f64, products: usize| {
        held.filter(|_| is_symmetric).is_some_and(|held| {
            let margin = margin_of(unknowns, products);
            margin < 1.0
                && held.step <= bound(theta, margin) * (1.0 - 1e-9)
                && held.step <= bound(theta, MARGIN) * held.fraction
        })
    };
    let theta = highest(&mut operator, Want::Value, &may_stay)?.0.max(0.0);
    let estimate = bound(theta, 0.0);
    let stays_early = may_stay(theta, operator.products);
    let sharp = match stays_early {
        true => bound(theta, margin_of(unknowns, operator.products).max(MARGIN)),
        false => bound(theta, MARGIN),
    };
    let limit = StepLimit {
        certified,
        certified_site,
        // a Ritz value may exceed the bound on eigenvalues by rounding
        estimate: estimate.max(certified),
        // where the row sum equals the eigenvalue, rounding must not decide
        stable: certified.max(sharp) * (1.0 - 1e-9),
        products: operator.products,
    };
    let stays = held.is_some_and(|h| h.step <= limit.stable * h.fraction * (1.0 + 1e-9));
    Ok((limit, stays || stays_early))
}

/// `2/√θ` after a few products \[s\], without contact and drag: a rough estimate, above the limit.
pub(super) fn rough_limit(
    system: &dyn SemiDiscrete,
    prescribed: &[u32],
    products: usize,
) -> Result<f64, StepError> {
    rayon::scope(|_| {
        let mut operator = Scaled::new(system, prescribed)?;
        let count = products.min(operator.free.count());
        if count == 0 {
            return Ok(f64::INFINITY);
        }
        let (theta, _) = lanczos(&mut operator, count, Want::Value, &|_, _| false)?;
        Ok(2.0 / theta.max(0.0).sqrt())
    })
}

impl StepLimit {
    /// The step to take: the stable one, or a smaller one that is asked for.
    ///
    /// # Errors
    /// [`StepError::TooLarge`] for a larger one, [`StepError::NoStep`] for one that is not positive.
    pub fn admit(
        &self,
        requested: Option<f64>,
        system: &dyn SemiDiscrete,
        prescribed: &[u32],
    ) -> Result<f64, StepError> {
        let Some(requested) = requested else {
            return Ok(self.stable);
        };
        if !(requested > 0.0 && requested.is_finite()) {
            return Err(StepError::NoStep { requested });
        }
        if requested <= self.stable {
            return Ok(requested);
        }
        let mut operator = Scaled::new(system, prescribed)?;
        let mode = highest(&mut operator, Want::Mode, &|_, _| false)?.1;
        Err(StepError::TooLarge {
            requested,
            stable: self.stable,
            limit: self.estimate,
            site: operator.site_of(&mode),
        })
    }
}

/// Number of products with which the sharp bound of a symmetric model fails with the probability [`FAILURE`].
fn products_for(unknowns: usize) -> usize {
    let needed = (1.648 * (unknowns.max(1) as f64).sqrt() / FAILURE).ln() / MARGIN.sqrt();
    (0.5 * (needed + 1.0)).ceil() as usize
}

/// The margin with which the sharp bound of a symmetric model fails with the probability [`FAILURE`] after so many products.
fn margin_of(unknowns: usize, products: usize) -> f64 {
    let needed = (1.648 * (unknowns.max(1) as f64).sqrt() / FAILURE).ln();
    (needed / (2.0 * products as f64 - 1.0)).powi(2)
}

/// Part of the highest mode that is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Want {
    Value,
    Mode,
}

/// The largest Ritz value, of an unsymmetric model in absolute value, and its vector if that is wanted; of a symmetric model with fewer products if `is_enough` returns true.
fn highest(
    operator: &mut Scaled<'_>,
    want: Want,
    is_enough: &dyn Fn(f64, usize) -> bool,
) -> Result<(f64, Vec<f64>), StepError> {
    let count = products_for(operator.free.count()).min(operator.free.count());
    if count == 0 {
        return Ok((0.0, vec![0.0; operator.dofs()]));
    }
    match operator.system.symmetry() {
        Symmetry::Symmetric => lanczos(operator, count, want, is_enough),
        // in one go, or in as many cycles as memory asks for
        _ => {
            let cycle = count.min((BASIS_BYTES / (operator.dofs() * size_of::<f64>())).max(20));
            let mut start = operator.noise();
            let mut best = (0.0, Vec::new());
            for _ in 0..count.div_ceil(cycle).max(1) * if cycle < count { 2 } else { 1 } {
                let space = Space::new(operator, start, cycle);
                let ([re, im], mode) = space.extreme(|[re, im]| re.hypot(im))?;
                best = (re.hypot(im), mode.clone());
                start = mode;
            }
            Ok(best)
        }
    }
}

/// Lanczos with three vectors; the recurrence is run a second time for the Ritz vector, if that is wanted.
///
/// The vectors lose their orthogonality once a Ritz value has converged. This repeats the value and leaves the others correct; reorthogonalisation would
/// cost more than the products. It ends before `count` products if `is_enough`, called every [`ASKED`] of them with the largest Ritz value and their number, returns true.
fn lanczos(
    operator: &mut Scaled<'_>,
    count: usize,
    want: Want,
    is_enough: &dyn Fn(f64, usize) -> bool,
) -> Result<(f64, Vec<f64>), StepError> {
    let (mut diagonal, mut off): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut coefficients: Vec<f64> = Vec::new();
    let mut theta = 0.0;
    let mut mode = vec![0.0; operator.dofs()];
    for pass in 0..if want == Want::Mode { 2 } else { 1 } {
        let mut last = vec![0.0; operator.dofs()];
        let mut q = operator.noise();
        let mut w = vec![0.0; operator.dofs()];
        for k in 0..count {
            if pass == 1 {
                if k == coefficients.len() {
                    break;
                }
                add_scaled(coefficients[k], &q, &mut mode);
            }
            operator.apply_into(&q, &mut w);
            let a = dot(&q, &w);
            add_scaled(-a, &q, &mut w);
            if k > 0 {
                add_scaled(-off[k - 1], &last, &mut w);
            }
            let b = norm(&w);
            if pass == 0 {
                diagonal.push(a);
                if b <= 1e-12 * a.abs() {
                    break;
                }
                off.push(b);
                let done = diagonal.len();
                if done.is_multiple_of(ASKED)
                    && done < count
                    && is_enough(ritz(&diagonal, &off)?.0, done)
                {
                    break;
                }
            }
            std::mem::swap(&mut last, &mut q);
            q.iter_mut().zip(&w).for_each(|(q, w)| *q = w / b);
        }
        if pass == 0 {
            (theta, coefficients) = ritz(&diagonal, &off)?;
        }
    }
    Ok((theta, mode))
}

/// The largest eigenvalue of a symmetric tridiagonal matrix, with its vector.
fn ritz(diagonal: &[f64], off: &[f64]) -> Result<(f64, Vec<f64>), StepError> {
    let n = diagonal.len();
    let small = faer::Mat::from_fn(n, n, |i, j| match i.abs_diff(j) {
        0 => diagonal[i],
        1 => off[i.min(j)],
        _ => 0.0,
    });
    let eigen = small
        .self_adjoint_eigen(faer::Side::Lower)
        .map_err(|_| StepError::Eigenvalues)?;
    let theta = eigen.S().column_vector()[n - 1];
    Ok((theta, (0..n).map(|i| eigen.U()[(i, n - 1)]).collect()))
}

/// A Krylov space with its orthonormal basis and the operator in it.
pub(super) struct Space {
    basis: Vec<Vec<f64>>,
    /// Columns of the Hessenberg matrix.
    columns: Vec<Vec<f64>>,
}

impl Space {
    pub(super) fn new(operator: &mut Scaled<'_>, start: Vec<f64>, count: usize) -> Space {
        let mut w = vec![0.0; operator.dofs()];
        let size = norm(&start);
        let mut space = Space {
            basis: vec![start.iter().map(|x| x / size).collect()],
            columns: Vec::new(),
        };
        for k in 0..count {
            operator.apply_into(&space.basis[k], &mut w);
            let before = norm(&w);
            let mut column = vec![0.0; k + 1];
            for _ in 0..2 {
                for (h, q) in column.iter_mut().zip(&space.basis) {
                    let c = dot(q, &w);
                    *h += c;
                    add_scaled(-c, q, &mut w);
                }
            }
            let size = norm(&w);
            column.push(size);
            space.columns.push(column);
            if size <= 1e-12 * before || k + 1 == count {
                break;
            }
            space.basis.push(w.iter().map(|x| x / size).collect());
        }
        space
    }

    /// The Ritz value for which `rank` is largest, and the real part of its vector.
    pub(super) fn extreme(
        &self,
        rank: impl Fn([f64; 2]) -> f64,
    ) -> Result<([f64; 2], Vec<f64>), StepError> {
        let n = self.columns.len();
        let small = faer::Mat::from_fn(n, n, |i, j| self.columns[j].get(i).copied().unwrap_or(0.0));
        let eigen = small.eigen().map_err(|_| StepError::Eigenvalues)?;
        let values: Vec<[f64; 2]> = (0..n)
            .map(|k| {
                let s = eigen.S().column_vector()[k];
                [s.re, s.im]
            })
            .collect();
        let best = (0..n).fold(0, |best, k| {
            if rank(values[k]) > rank(values[best]) {
                k
            } else {
                best
            }
        });
        let mut mode = vec![0.0; self.basis[0].len()];
        for (k, q) in self.basis.iter().enumerate() {
            add_scaled(eigen.U()[(k, best)].re, q, &mut mode);
        }
        Ok((values[best], mode))
    }
}

#[cfg(test)]
#[path = "stable_step_tests.rs"]
pub(super) mod tests;
