//! The solution in closed form: an integral over wave numbers.

use std::f64::consts::PI;

/// Width of the micromodulus over that of the initial displacement.
pub const LAMBDA: f64 = 0.75;

/// `C(ζ̂ − ζ)`, section 3.
pub fn micromodulus(distance: f64, lambda: f64) -> f64 {
    4.0 * (-(distance / lambda).powi(2)).exp() / (lambda.powi(3) * PI.sqrt())
}

/// `η(ζ, 0)`.
pub fn initial(zeta: f64) -> f64 {
    (-zeta * zeta).exp()
}

pub(super) fn integrand(omega: f64, zeta: f64, tau: f64, lambda: f64) -> f64 {
    // 1 − exp(−ω²λ²) without cancellation
    let root = (-(-(omega * lambda).powi(2)).exp_m1()).sqrt();
    2.0 / PI.sqrt()
        * (-omega * omega).exp()
        * (2.0 * omega * zeta).cos()
        * (2.0 * tau / lambda * root).cos()
}

/// The exact displacement, \[EmmrichWeckner2007\] eq. (3.1).
///
/// The integrand is an even entire function of ω below `exp(−ω²)`, so that the trapezoidal rule converges faster than any power of its step.
pub fn exact(zeta: f64, tau: f64, lambda: f64) -> f64 {
    // aliases of the step h lie 2π/h away in ζ; the integrand is 1e-22 at ω = 7
    let h = PI / (zeta.abs() + tau + 16.0);
    let count = (7.0 / h).ceil() as usize;
    let tail: f64 = (1..=count)
        .map(|k| integrand(k as f64 * h, zeta, tau, lambda))
        .sum();
    h * (0.5 * integrand(0.0, zeta, tau, lambda) + tail)
}

/// The same by adaptive Gauss–Kronrod quadrature (7 and 15 points), to an absolute tolerance.
pub fn exact_adaptive(zeta: f64, tau: f64, lambda: f64, tolerance: f64) -> f64 {
    let f = |omega: f64| integrand(omega, zeta, tau, lambda);
    let mut parts = vec![(0.0, 7.0)];
    let mut sum = 0.0;
    while let Some((a, b)) = parts.pop() {
        let (kronrod, difference) = gauss_kronrod(&f, a, b);
        if difference <= tolerance * (b - a) / 7.0 || b - a < 1e-6 {
            sum += kronrod;
        } else {
            let middle = 0.5 * (a + b);
            parts.push((a, middle));
            parts.push((middle, b));
        }
    }
    sum
}

pub(super) fn gauss_kronrod(f: &dyn Fn(f64) -> f64, a: f64, b: f64) -> (f64, f64) {
    const NODES: [f64; 8] = [
        0.991_455_371_120_812_6,
        0.949_107_912_342_758_5,
        0.864_864_423_359_769_1,
        0.741_531_185_599_394_4,
        0.586_087_235_467_691_1,
        0.405_845_151_377_397_2,
        0.207_784_955_007_898_47,
        0.0,
    ];
    const KRONROD: [f64; 8] = [
        0.022_935_322_010_529_22,
        0.063_092_092_629_978_55,
        0.104_790_010_322_250_18,
        0.140_653_259_715_525_92,
        0.169_004_726_639_267_9,
        0.190_350_578_064_785_4,
        0.204_432_940_075_298_9,
        0.209_482_141_084_727_83,
    ];
    const GAUSS: [f64; 4] = [
        0.129_484_966_168_869_7,
        0.279_705_391_489_276_64,
        0.381_830_050_505_118_9,
        0.417_959_183_673_469_4,
    ];
    let (centre, half) = (0.5 * (a + b), 0.5 * (b - a));
    let (mut kronrod, mut gauss) = (0.0, 0.0);
    for i in 0..8 {
        let pair = if i == 7 {
            f(centre)
        } else {
            f(centre - half * NODES[i]) + f(centre + half * NODES[i])
        };
        kronrod += KRONROD[i] * pair;
        if i % 2 == 1 {
            gauss += GAUSS[i / 2] * pair;
        }
    }
    (half * kronrod, half * (kronrod - gauss).abs())
}

/// `f(λ)`: elastic energy over that of classical elasticity for the same initial displacement.
pub fn energy_ratio(lambda: f64) -> f64 {
    let square = lambda * lambda;
    4.0 / square * (1.0 - (2.0 / (2.0 + square)).sqrt())
}
