//! A modulus that relaxes by Maxwell arms beside a spring: a Prony series, and its arms over a step.

/// A Prony series: the share `λ_i` of a modulus relaxes with the time `τ_i`, each in a Maxwell arm of its own, and the rest `1 − Σ λ_i` lasts.
///
/// Under a strain e that is held it leaves `1 − Σ λ_i + Σ λ_i exp(−t/τ_i)` of the modulus. With `q_i` the strain of the spring in arm i, [SAND2015-7998] eq. (4.12), (4.14):
///
/// ```text
/// (1 − Σ λ_i) e + Σ λ_i q_i ,     q̇_i = ė − q_i/τ_i
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PronySeries {
    /// λ and τ \[s\] of each arm.
    arms: Vec<(f64, f64)>,
    /// `1 − Σ λ_i`.
    lasting: f64,
}

impl PronySeries {
    /// Most arms: a series has one to three for each decade of time.
    pub const ARMS: usize = 16;

    /// A series of arms with a share λ \[1\] and a relaxation time τ \[s\].
    ///
    /// # Panics
    /// If there are more than [`PronySeries::ARMS`].
    pub fn new(arms: Vec<(f64, f64)>) -> Self {
        assert!(arms.len() <= Self::ARMS, "{} arms", arms.len());
        let lasting = 1.0 - arms.iter().map(|(share, _)| share).sum::<f64>();
        Self { arms, lasting }
    }

    /// Returns the number of values by which a strain is remembered: itself, and that of the spring in each arm.
    pub fn remembered(&self) -> usize {
        1 + self.arms.len()
    }

    /// The part of the modulus that never relaxes, `1 − Σ λ_i` \[1\].
    pub fn lasting(&self) -> f64 {
        self.lasting
    }

    /// The series over a step of the length `step` \[s\].
    pub fn over(&self, step: f64) -> PronyStep {
        let mut arms = [(0.0, Arm::over(0.0, 1.0)); Self::ARMS];
        for (arm, (share, time)) in arms.iter_mut().zip(&self.arms) {
            *arm = (*share, Arm::over(step, *time));
        }
        PronyStep {
            arms,
            count: self.arms.len(),
            lasting: self.lasting,
        }
    }
}

/// A [`PronySeries`] over one step, in which strains grow linearly.
#[derive(Clone, Copy, Debug)]
pub struct PronyStep {
    arms: [(f64, Arm); PronySeries::ARMS],
    count: usize,
    lasting: f64,
}

/// Response of a series to a strain at the end of a step, for a unit modulus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// `(1 − Σ λ_i) e + Σ λ_i q_i`.
    pub strain: f64,
    /// `½ (1 − Σ λ_i) e² + ½ Σ λ_i q_i²`.
    pub stored: f64,
    /// Dissipated within the step, `Σ λ_i ∫ q_i²/τ_i dt`; never negative.
    pub dissipated: f64,
}

impl PronyStep {
    /// Follows a strain to `e` at the end of the step. `past` gives what was remembered at its beginning, the strain at 0 and that of the spring in arm i at i; `keep` receives the same at its end.
    pub fn follow(
        &self,
        e: f64,
        past: impl Fn(usize) -> f64,
        mut keep: impl FnMut(usize, f64),
    ) -> Carried {
        let growth = e - past(0);
        keep(0, e);
        let mut sum = Carried {
            strain: self.lasting * e,
            stored: 0.5 * self.lasting * e * e,
            dissipated: 0.0,
        };
        for (i, (share, arm)) in self.arms[..self.count].iter().enumerate() {
            let (q, spent) = arm.follow(past(1 + i), growth);
            keep(1 + i, q);
            sum.strain += share * q;
            sum.stored += 0.5 * share * q * q;
            sum.dissipated += share * spent;
        }
        sum
    }

    /// `∂/∂e` of the strain that is carried: `1 − Σ λ_i + Σ λ_i (1 − exp(−Δt/τ_i)) τ_i/Δt`.
    pub fn slope(&self) -> f64 {
        let arms = self.arms[..self.count].iter();
        arms.fold(self.lasting, |sum, (share, arm)| sum + share * arm.driven)
    }
}

/// A Maxwell arm over a step, [SAND2015-7998] eq. (4.13): its spring's strain `q̇ = ė − q/τ` for a strain e that is linear in time.
#[derive(Clone, Copy, Debug)]
pub struct Arm {
    /// `e^−x`, with x the length of the step over τ.
    decay: f64,
    /// The mean of `e^−xθ`, θ from 0 to 1: what of the growth of e is left in q at the end.
    driven: f64,
    /// `∫ q²/τ dt = before² spent[0] + before growth spent[1] + growth² spent[2]`.
    spent: [f64; 3],
}

impl Arm {
    /// The arm of the relaxation time `time` over a step of the length `step` \[s\].
    pub fn over(step: f64, time: f64) -> Self {
        let x = step / time;
        let driven = mean_decay(x);
        Self {
            decay: (-x).exp(),
            driven,
            // q = before e^−xθ + growth (1 − e^−xθ)/x, squared, times x
            spent: [
                -0.5 * (-2.0 * x).exp_m1(),
                -(-x).exp_m1() * driven,
                square_of_growth(x),
            ],
        }
    }

    /// q at the end of a step in which e grows by `growth`, from q `before`; and what is dissipated by a unit stiffness, `∫ q²/τ dt`: a sum of squares, so that round-off does not make it negative.
    pub fn follow(self, before: f64, growth: f64) -> (f64, f64) {
        let q = self.decay * before + self.driven * growth;
        let [first, mixed, last] = self.spent;
        let spent = before * before * first + before * growth * mixed + growth * growth * last;
        (q, spent)
    }
}

/// `(1 − e^−x)/x`, `1` at zero.
fn mean_decay(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x }
}

/// `∫₀¹ (1 − e^−xθ)²/x dθ = (1 − 2 m(x) + m(2x))/x` with m of [`mean_decay`]; `x/3` to first order.
fn square_of_growth(x: f64) -> f64 {
    // below this the difference loses digits, and ten terms of the series leave out less than round-off
    const SERIES: f64 = 0.05;
    if x >= SERIES {
        return (1.0 - 2.0 * mean_decay(x) + mean_decay(2.0 * x)) / x;
    }
    // (1 − e^−s)² = Σ_{k ≥ 2} (2^k − 2) (−s)^k/k!, integrated term by term
    let (mut power, mut sum) = (-1.0, 0.0);
    for k in 2..12 {
        power *= -x / f64::from(k);
        sum += power * (2f64.powi(k) - 2.0) / f64::from(k + 1);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `q̇ = growth − x q` and `∫ x q² dθ` over a step, by Runge–Kutta's method of fourth order in many parts.
    fn integrated(x: f64, before: f64, growth: f64) -> (f64, f64) {
        let parts = 4000;
        let h = 1.0 / f64::from(parts);
        let rate = |q: f64| (growth - x * q, x * q * q);
        let (mut q, mut spent) = (before, 0.0);
        for _ in 0..parts {
            let a = rate(q);
            let b = rate(q + 0.5 * h * a.0);
            let c = rate(q + 0.5 * h * b.0);
            let d = rate(q + h * c.0);
            q += h / 6.0 * (a.0 + 2.0 * (b.0 + c.0) + d.0);
            spent += h / 6.0 * (a.1 + 2.0 * (b.1 + c.1) + d.1);
        }
        (q, spent)
    }

    #[test]
    fn an_arm_follows_its_differential_equation_and_dissipates_what_its_dashpot_does() {
        for x in [1e-9, 1e-4, 0.01, 0.049, 0.051, 1.0, 10.0] {
            for (before, growth) in [(0.0, 1.0), (1.0, 0.0), (0.7, 0.4), (0.9, -1.3)] {
                let (q, spent) = Arm::over(3.0 * x, 3.0).follow(before, growth);
                let (exact, lost) = integrated(x, before, growth);
                assert!((q - exact).abs() < 1e-11, "{x} {before}: {q} {exact}");
                let off = spent / lost - 1.0;
                assert!(off.abs() < 1e-10, "{x} {before} {growth}: {spent} {lost}");
            }
        }
    }

    #[test]
    fn nothing_is_gained_however_short_the_step() {
        for x in [0.0, 1e-300, 1e-17, 1e-12, 1e-6, 1e-2, 1.0, 1e3, 1e300] {
            for k in 0..400 {
                let growth = -2.0 * f64::from(k) / 200.0;
                let (_, spent) = Arm::over(x, 1.0).follow(1.0, growth);
                assert!(spent >= 0.0 && spent.is_finite(), "{x} {growth}: {spent}");
                assert!((spent > 0.0) == (x > 1e-310), "{x} {growth}: {spent}");
            }
        }
    }

    #[test]
    fn a_series_carries_what_lasts_and_what_has_not_relaxed() {
        let series = PronySeries::new(vec![(0.3, 0.5), (0.2, 4.0)]);
        let mut past = vec![0.0; series.remembered()];
        let mut lost = 0.0;
        // at once, then held, in steps of any length
        for (step, t) in [(0.0, 0.0), (0.1, 0.1), (1.0, 1.1), (7.0, 8.1)] {
            let mut present = past.clone();
            let found = series
                .over(step)
                .follow(2.0, |k| past[k], |k, x| present[k] = x);
            past = present;
            lost += found.dissipated;
            let left =
                |rate: f64| 0.5 + 0.3 * (-rate * t / 0.5).exp() + 0.2 * (-rate * t / 4.0).exp();
            assert!((found.strain - 2.0 * left(1.0)).abs() < 1e-14);
            assert!((found.stored - 2.0 * left(2.0)).abs() < 1e-14);
            // what was stored at once is there or gone
            assert!((found.stored + lost - 2.0).abs() < 1e-14);
        }
        let rise = |x: f64| (1.0 - (-x).exp()) / x;
        let slope = 0.5 + 0.3 * rise(2.0) + 0.2 * rise(0.25);
        assert!((series.over(1.0).slope() - slope).abs() < 1e-15);
    }
}
