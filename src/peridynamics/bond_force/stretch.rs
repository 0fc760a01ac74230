//! One bond, from numbers that cannot cancel.
//!
//! With `t = (2 ξ·η + η·η)/r²` the deformed length is `r √(1 + t)`, and all that a force needs is
//! `ψ(t) = (1 − (1 + t)^(−1/2))/t = 1/(√(1 + t) (1 + √(1 + t)))`: `1 − r/|ξ+η| = t ψ`, `(|ξ+η| − r)/r = t (1 − (1 + t) ψ)`.

/// `|t|` up to which [`SERIES`] is used.
pub(super) const SERIES_RANGE: f64 = 1.0 / 256.0;

/// `ψ(t) = 1/2 − 3/8 t + 5/16 t² − …` by the polynomial of degree 5 that interpolates it at the Chebyshev nodes of `|t| ≤` [`SERIES_RANGE`]; off by at most 2.3e-17.
pub(super) const PSI: [f64; 6] = [
    0.5,
    -0.375,
    0.3124999999725654,
    -0.2734374999742801,
    0.24609854452148686,
    -0.22559043236480483,
];

/// `χ(t) = (√(1 + t) − 1)/t = 1/2 − t/8 + t²/16 − …` likewise; off by at most 1.8e-18.
pub(super) const CHI: [f64; 6] = [
    0.5,
    -0.125,
    0.06249999999788965,
    -0.039062499998285344,
    0.027344118808026167,
    -0.02050811215668201,
];

/// Bonds are taken to be at least this short, squared and relative: two points on one spot have no direction, but must give no NaN.
pub(super) const SHORTEST: f64 = 1e-30;

/// `ψ(t) = (1 − (1 + t)^(−1/2))/t`, to the last bit but one.
#[inline(always)]
pub(in crate::peridynamics) fn psi(t: f64) -> f64 {
    if t.abs() <= SERIES_RANGE {
        // not fused: without the right target that is a call, five of them a bond (20 ns instead of 6)
        PSI[..5].iter().rev().fold(PSI[5], |p, c| p * t + c)
    } else {
        let s = (1.0 + t).max(SHORTEST).sqrt();
        1.0 / ((1.0 + s) * s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn psi_has_fifteen_digits() {
        for k in -4000..4000 {
            let t = 1e-5 * f64::from(k) * (1.0 + 1e-3 * f64::from(k % 7));
            // the exact form holds everywhere, also at 0
            let s = (1.0 + t).sqrt();
            let exact = 1.0 / (s * (1.0 + s));
            assert!((psi(t) - exact).abs() < 3e-16, "{t} {}", psi(t) - exact);
        }
        assert_eq!(psi(0.0), 0.5);
        for k in -100..=100 {
            let t = SERIES_RANGE * f64::from(k) / 100.0;
            let chi = CHI.iter().rev().fold(0.0, |p, c| p * t + c);
            assert!((chi - 1.0 / (1.0 + (1.0 + t).sqrt())).abs() < 2e-16);
        }
    }
}
