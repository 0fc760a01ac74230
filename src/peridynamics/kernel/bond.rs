//! One bond, from numbers that cannot cancel.
//!
//! With `t = (2 ξ·η + η·η)/r²` the deformed length is `r √(1 + t)`, and all that a force needs is
//! `ψ(t) = (1 − (1 + t)^(−1/2))/t`: `1 − r/|ξ+η| = t ψ`, `(|ξ+η| − r)/r = t (1 − (1 + t) ψ)`.

/// `|t|` up to which [`SERIES`] is used.
pub(super) const SERIES_RANGE: f64 = 1.0 / 256.0;

/// Taylor coefficients of `ψ(t) = 1/2 − 3/8 t + 5/16 t² − …` (binomial series); up to [`SERIES_RANGE`] the first term left out, `6435/32768 t⁷`, is 2.7e-18.
pub(super) const SERIES: [f64; 7] = [
    1.0 / 2.0,
    -3.0 / 8.0,
    5.0 / 16.0,
    -35.0 / 128.0,
    63.0 / 256.0,
    -231.0 / 1024.0,
    429.0 / 2048.0,
];

/// Bonds are taken to be at least this short, squared and relative: two points on one spot have no direction, but must give no NaN.
pub(super) const SHORTEST: f64 = 1e-30;

/// `ψ(t) = (1 − (1 + t)^(−1/2))/t`, to the last bit but one.
#[inline(always)]
pub(super) fn psi(t: f64) -> f64 {
    if t.abs() < SERIES_RANGE {
        let mut p = SERIES[6];
        for k in (0..6).rev() {
            p = p.mul_add(t, SERIES[k]);
        }
        p
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
    }
}
