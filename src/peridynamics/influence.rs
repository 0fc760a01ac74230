//! Influence functions ω(|ξ|) and micromoduli λ(|ξ|), with the constants that tie them to a classical material.

use std::f64::consts::PI;

/// Degree of the polynomial `P_n` of an influence function.
///
/// With `s = r/δ`, `P_n(0) = 1` and, for `n > 0`, `P_n(δ) = 0`; for `n > 1` the derivatives up to order
/// `(n − 1)/2` vanish at both ends.
///
/// Source: [SAND2015-7998] after eq. (5.8).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Degree {
    /// `P_0 = 1`.
    P0,
    /// `P_1 = 1 − s`.
    P1,
    /// `P_3 = 1 − 3 s² + 2 s³`.
    P3,
    /// `P_5 = 1 − 10 s³ + 15 s⁴ − 6 s⁵`.
    P5,
    /// `P_7 = 1 − 35 s⁴ + 84 s⁵ − 70 s⁶ + 20 s⁷`.
    P7,
}

impl Degree {
    /// Every degree, in ascending order.
    pub const ALL: [Self; 5] = [Self::P0, Self::P1, Self::P3, Self::P5, Self::P7];

    /// The degree `n`.
    pub fn order(self) -> u32 {
        match self {
            Self::P0 => 0,
            Self::P1 => 1,
            Self::P3 => 3,
            Self::P5 => 5,
            Self::P7 => 7,
        }
    }

    /// Coefficients of `s⁰, s¹, …, s⁷`.
    fn coefficients(self) -> [f64; 8] {
        match self {
            Self::P0 => [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            Self::P1 => [1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            Self::P3 => [1.0, 0.0, -3.0, 2.0, 0.0, 0.0, 0.0, 0.0],
            Self::P5 => [1.0, 0.0, 0.0, -10.0, 15.0, -6.0, 0.0, 0.0],
            Self::P7 => [1.0, 0.0, 0.0, 0.0, -35.0, 84.0, -70.0, 20.0],
        }
    }

    /// `P_n` at `s = r/δ` in `[0, 1]`.
    fn value(self, s: f64) -> f64 {
        // The form about s = 1 keeps its digits where P_n is small: P_n(s) = 1 − P_n(1 − s) for n ≥ 1.
        if s > 0.5 && self != Self::P0 {
            let t = 1.0 - s;
            let c = self.coefficients();
            return -t * c[1..].iter().rev().fold(0.0, |sum, a| sum * t + a);
        }
        self.coefficients()
            .iter()
            .rev()
            .fold(0.0, |sum, a| sum * s + a)
    }
}

/// Exponent α of the singular factor `1/|ξ|^α` of an influence function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Alpha {
    /// `ω = P_n`.
    Zero,
    /// `ω = P_n / |ξ|`.
    One,
}

impl Alpha {
    /// Both exponents.
    pub const ALL: [Self; 2] = [Self::Zero, Self::One];

    /// The exponent α.
    pub fn exponent(self) -> u32 {
        match self {
            Self::Zero => 0,
            Self::One => 1,
        }
    }
}

/// An influence function ω(|ξ|), zero beyond the horizon δ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Influence {
    /// `ω = P_n(|ξ|) / |ξ|^α`. Source: [SAND2015-7998] eq. (5.8).
    Polynomial {
        /// Degree of `P_n`.
        degree: Degree,
        /// Exponent of the singular factor.
        alpha: Alpha,
    },
    /// `ω = exp(−|ξ|²/δ²)`. Source: [SAND2015-7998] Algorithm 1, line 13.
    Gaussian,
}

/// A typed number that names no influence function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InfluenceError {
    /// The degree is none of 0, 1, 3, 5, 7.
    #[error("influence function: degree n = {degree} is not offered; use 0, 1, 3, 5 or 7")]
    Degree {
        /// The degree that was typed.
        degree: u32,
    },
    /// The exponent is neither 0 nor 1.
    #[error("influence function: exponent alpha = {alpha} is not offered; use 0 or 1")]
    Alpha {
        /// The exponent that was typed.
        alpha: u32,
    },
}

impl Influence {
    /// The influence function of eq. (5.8) with degree `n` and exponent `alpha` given as numbers.
    ///
    /// # Errors
    /// [`InfluenceError`] unless `n` is 0, 1, 3, 5 or 7 and `alpha` is 0 or 1.
    pub fn polynomial(n: u32, alpha: u32) -> Result<Self, InfluenceError> {
        let degree = Degree::ALL
            .into_iter()
            .find(|d| d.order() == n)
            .ok_or(InfluenceError::Degree { degree: n })?;
        let alpha = Alpha::ALL
            .into_iter()
            .find(|a| a.exponent() == alpha)
            .ok_or(InfluenceError::Alpha { alpha })?;
        Ok(Self::Polynomial { degree, alpha })
    }

    /// `ω(r)` of a bond of length `r > 0` in a family of horizon `delta`.
    ///
    /// A bond that touches the horizon counts as inside whatever rounding made of its length, so `r/δ` is
    /// cut at 1 rather than tested against it; membership is decided by the family.
    /// Units: r, δ \[m\] → ω [m^(−α)].
    pub fn value(self, r: f64, delta: f64) -> f64 {
        let s = (r / delta).min(1.0);
        match self {
            Self::Polynomial { degree, alpha } => match alpha {
                Alpha::Zero => degree.value(s),
                Alpha::One => degree.value(s) / r,
            },
            Self::Gaussian => (-s * s).exp(),
        }
    }

    /// `∫_0^δ ω(r) r^p dr`, in closed form, for `p ≥ 1`.
    ///
    /// Units: δ \[m\] → [m^(p + 1 − α)].
    pub fn radial_moment(self, p: u32, delta: f64) -> f64 {
        match self {
            Self::Polynomial { degree, alpha } => {
                let q = p - alpha.exponent();
                polynomial_moment(degree, q) * delta.powi(q as i32 + 1)
            }
            Self::Gaussian => gaussian_moment(p) * delta.powi(p as i32 + 1),
        }
    }

    /// Weighted volume of a full, continuous family, `m = ∫ ω(|ξ|) |ξ|² dV`.
    ///
    /// Source: [SAND2015-7998] eq. (5.12) in 1D, (5.18) in 3D; the same integral in 2D.
    /// Units: δ \[m\] → m [m^(D + 2 − α)].
    pub fn weighted_volume<const D: usize>(self, delta: f64) -> f64 {
        sphere_measure::<D>() * self.radial_moment(D as u32 + 1, delta)
    }
}

/// The shape of a micromodulus λ(|ξ|) of the linearised bond-based material, up to its constant `c`:
/// force density `∫ λ(|ξ|) ξ ⊗ ξ (u(x + ξ) − u(x)) dV`.
///
/// Source: [SAND2015-7998] eq. (3.1). \[Bobaru2009\] writes `λ = c(|ξ|)/|ξ|³` (section 2.1); its names stand in
/// the variants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Micromodulus {
    /// `λ = c`, the same for every bond.
    Uniform,
    /// `λ = c / |ξ|²`: in 1D the force is `c η`, a constant spring stiffness `C` per bond (\[Bobaru2009\] eq. (22), whose
    /// `c(|ξ|)` of eq. (19) it calls "inverted triangular"). Equal to [`Micromodulus::Influence`] with n = 0, α = 0.
    Constant,
    /// `λ = c / |ξ|³`: the slit plate of [SAND2015-7998] section 3.4; the prototype microelastic brittle law, "constant"
    /// in \[Bobaru2009\], since the force is `c` times the bond's stretch.
    InverseDistance,
    /// `λ = c (1 − |ξ|/δ) / |ξ|³`: "triangular" in \[Bobaru2009\] eq. (16).
    Triangular,
    /// `λ = c ω(|ξ|) / |ξ|²`. Source: [SAND2015-7998] eq. (5.13a).
    Influence(Influence),
}

impl Micromodulus {
    /// `λ(r)/c` of a bond of length `r > 0` in a family of horizon `delta`.
    pub fn shape(self, r: f64, delta: f64) -> f64 {
        match self {
            Self::Uniform => 1.0,
            Self::Constant => 1.0 / (r * r),
            Self::InverseDistance => 1.0 / (r * r * r),
            Self::Triangular => Degree::P1.value((r / delta).min(1.0)) / (r * r * r),
            Self::Influence(omega) => omega.value(r, delta) / (r * r),
        }
    }

    /// `∫_0^δ (λ(r)/c) r^(D+3) dr`, in closed form.
    ///
    /// Source: the radial integral of [SAND2015-7998] eq. (3.7).
    fn radial_integral<const D: usize>(self, delta: f64) -> f64 {
        let d = D as u32;
        let power = |p: u32| delta.powi(p as i32 + 1) / f64::from(p + 1);
        match self {
            Self::Uniform => power(d + 3),
            Self::Constant => power(d + 1),
            Self::InverseDistance => power(d),
            Self::Triangular => polynomial_moment(Degree::P1, d) * delta.powi(d as i32 + 1),
            Self::Influence(omega) => omega.radial_moment(d + 1, delta),
        }
    }

    /// The constant `c` for which a full, continuous family has `½ ∫ λ ξ⊗ξ⊗ξ⊗ξ dV = C` with `C_1111 = c1111`.
    ///
    /// A bond-based material has `C_1111 = 3 C_1122`; of Young's modulus `E` it is `E` in 1D, `9E/8` in plane
    /// stress (ν = 1/3) and `6E/5` in plane strain and 3D (ν = 1/4).
    ///
    /// Source: [SAND2015-7998] eq. (3.6), (3.7) with `Λ = C_1111`.
    /// Units: δ \[m\], c1111 \[Pa\] → c such that `λ = c · shape` is in [Pa/m^(D+4)].
    pub fn constant<const D: usize>(self, delta: f64, c1111: f64) -> f64 {
        let d = D as f64;
        let angular = sphere_measure::<D>() * 3.0 / (d * (d + 2.0));
        2.0 * c1111 / (angular * self.radial_integral::<D>(delta))
    }
}

/// Measure of the unit sphere in `D` dimensions: 2 points, circumference 2π, area 4π.
fn sphere_measure<const D: usize>() -> f64 {
    match D {
        1 => 2.0,
        2 => 2.0 * PI,
        _ => 4.0 * PI,
    }
}

/// `∫_0^1 P_n(s) s^q ds`.
fn polynomial_moment(degree: Degree, q: u32) -> f64 {
    (0u32..)
        .zip(degree.coefficients())
        .map(|(k, a)| a / f64::from(q + k + 1))
        .sum()
}

/// `∫_0^1 exp(−s²) s^q ds` by the recursion that integration by parts gives.
fn gaussian_moment(q: u32) -> f64 {
    /// `√π/2 · erf(1)`.
    const ZEROTH: f64 = 0.746_824_132_812_427;
    let e = (-1.0f64).exp();
    match q {
        0 => ZEROTH,
        1 => 0.5 * (1.0 - e),
        _ => 0.5 * (f64::from(q - 1) * gaussian_moment(q - 2) - e),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn influences() -> Vec<Influence> {
        let mut all = vec![Influence::Gaussian];
        for degree in Degree::ALL {
            for alpha in Alpha::ALL {
                all.push(Influence::Polynomial { degree, alpha });
            }
        }
        all
    }

    fn micromoduli() -> Vec<Micromodulus> {
        let mut all = vec![
            Micromodulus::Uniform,
            Micromodulus::Constant,
            Micromodulus::InverseDistance,
            Micromodulus::Triangular,
        ];
        all.extend(influences().into_iter().map(Micromodulus::Influence));
        all
    }

    /// Ten-point Gauss-Legendre on `pieces` equal pieces of `[a, b]`.
    fn integrate(a: f64, b: f64, pieces: usize, f: impl Fn(f64) -> f64) -> f64 {
        const X: [f64; 5] = [
            0.148_874_338_981_631_2,
            0.433_395_394_129_247_2,
            0.679_409_568_299_024_4,
            0.865_063_366_688_984_5,
            0.973_906_528_517_171_7,
        ];
        const W: [f64; 5] = [
            0.295_524_224_714_752_87,
            0.269_266_719_309_996_35,
            0.219_086_362_515_982_04,
            0.149_451_349_150_580_6,
            0.066_671_344_308_688_14,
        ];
        let h = (b - a) / pieces as f64;
        let mut sum = 0.0;
        for p in 0..pieces {
            let centre = a + (p as f64 + 0.5) * h;
            for (x, w) in X.iter().zip(W) {
                sum += 0.5 * h * w * (f(centre - 0.5 * h * x) + f(centre + 0.5 * h * x));
            }
        }
        sum
    }

    /// `½ ∫ λ ξ_1⁴ dV` and `½ ∫ λ ξ_1² ξ_2² dV` by quadrature in polar coordinates.
    fn moments<const D: usize>(shape: Micromodulus, delta: f64) -> (f64, f64) {
        let radial = integrate(0.0, delta, 8, |r| {
            shape.shape(r, delta) * r.powi(D as i32 + 3)
        });
        let (a, b) = match D {
            1 => (2.0, 0.0),
            2 => (
                integrate(0.0, 2.0 * PI, 8, |t| t.cos().powi(4)),
                integrate(0.0, 2.0 * PI, 8, |t| (t.cos() * t.sin()).powi(2)),
            ),
            _ => (
                integrate(0.0, PI, 8, |t| 2.0 * PI * t.cos().powi(4) * t.sin()),
                integrate(0.0, PI, 8, |t| {
                    PI * t.cos().powi(2) * t.sin().powi(2) * t.sin()
                }),
            ),
        };
        (0.5 * radial * a, 0.5 * radial * b)
    }

    #[test]
    fn polynomials_are_flat_at_both_ends_and_fall() {
        for degree in Degree::ALL {
            let n = degree.order();
            assert_eq!(degree.value(0.0), 1.0);
            if n == 0 {
                assert_eq!(degree.value(1.0), 1.0);
                continue;
            }
            assert_eq!(degree.value(1.0), 0.0);
            // A zero of order k + 1 at an end, k = (n − 1)/2 vanishing derivatives, shows as a power law.
            let k = (n - 1) / 2;
            let e = 1e-3;
            for departure in [1.0 - degree.value(e), degree.value(1.0 - e)] {
                let order = departure.ln() / e.ln();
                assert!(departure > 0.0 && (order - f64::from(k + 1)).abs() < 0.6);
            }
            for i in 1..=100 {
                let (a, b) = (f64::from(i - 1) / 100.0, f64::from(i) / 100.0);
                assert!(degree.value(b) <= degree.value(a));
            }
            // The two forms agree where they meet.
            assert!((degree.value(0.5) - 0.5).abs() < 1e-15);
            assert!((degree.value(0.5 + 1e-12) - 0.5).abs() < 1e-11);
        }
    }

    #[test]
    fn values_of_the_typed_forms() {
        let delta = 0.2;
        let w = |n, a| Influence::polynomial(n, a).unwrap().value(0.05, delta);
        assert_eq!(w(0, 0), 1.0);
        assert_eq!(w(0, 1), 20.0);
        assert!((w(1, 0) - 0.75).abs() < 1e-15);
        assert!((w(3, 1) - 20.0 * 0.84375).abs() < 1e-13);
        assert!((w(5, 0) - 0.896_484_375).abs() < 1e-15);
        assert!((w(7, 0) - 0.929_443_359_375).abs() < 1e-14);
        assert!((Influence::Gaussian.value(0.1, delta) - (-0.25f64).exp()).abs() < 1e-15);
        // Rounding past the horizon neither cuts a bond nor turns its weight negative.
        assert_eq!(
            Influence::polynomial(0, 0)
                .unwrap()
                .value(delta * (1.0 + 1e-15), delta),
            1.0
        );
        assert_eq!(
            Influence::polynomial(3, 0)
                .unwrap()
                .value(delta * (1.0 + 1e-15), delta),
            0.0
        );
    }

    #[test]
    fn other_numbers_are_refused_by_name() {
        let message = Influence::polynomial(2, 0).unwrap_err().to_string();
        assert!(message.contains("n = 2") && message.contains("0, 1, 3, 5 or 7"));
        assert_eq!(
            Influence::polynomial(3, 2),
            Err(InfluenceError::Alpha { alpha: 2 })
        );
    }

    #[test]
    fn constants_give_the_typed_tensor() {
        let (delta, e) = (0.3, 7.0);
        for shape in micromoduli() {
            let c = shape.constant::<1>(delta, e);
            let (m, _) = moments::<1>(shape, delta);
            assert!((c * m / e - 1.0).abs() < 1e-12, "{shape:?}");
            // Plane stress at ν = 1/3: C_1111 = E/(1 − ν²), C_1122 = ν C_1111.
            let c = shape.constant::<2>(delta, 9.0 * e / 8.0);
            let (a, b) = moments::<2>(shape, delta);
            assert!(
                (c * a / (e / (1.0 - 1.0 / 9.0)) - 1.0).abs() < 1e-12,
                "{shape:?}"
            );
            assert!(
                (c * b / (e / 3.0 / (1.0 - 1.0 / 9.0)) - 1.0).abs() < 1e-12,
                "{shape:?}"
            );
            // Three dimensions at ν = 1/4: C_1122 = E ν/((1 + ν)(1 − 2ν)).
            let c = shape.constant::<3>(delta, 6.0 * e / 5.0);
            let (a, b) = moments::<3>(shape, delta);
            assert!((c * a / (1.2 * e) - 1.0).abs() < 1e-12, "{shape:?}");
            assert!(
                (c * b / (e * 0.25 / (1.25 * 0.5)) - 1.0).abs() < 1e-12,
                "{shape:?}"
            );
        }
    }

    #[test]
    fn constants_of_the_papers() {
        let (delta, e) = (0.05, 1.0);
        // [SAND2015-7998] section 3.4.
        let c = Micromodulus::InverseDistance.constant::<2>(delta, 9.0 * e / 8.0);
        assert!((c / (9.0 * e / (PI * delta.powi(3))) - 1.0).abs() < 1e-14);
        // [SAND2015-7998] eq. (5.11) and (5.15): c = 2K/m in 1D, c = 6E/m in 2D.
        for omega in influences() {
            let shape = Micromodulus::Influence(omega);
            let c = shape.constant::<1>(delta, e) * omega.weighted_volume::<1>(delta);
            assert!((c / (2.0 * e) - 1.0).abs() < 1e-13);
            let c = shape.constant::<2>(delta, 9.0 * e / 8.0) * omega.weighted_volume::<2>(delta);
            assert!((c / (6.0 * e) - 1.0).abs() < 1e-13);
        }
        // [Bobaru2009] section 2.1: constant, triangular and inverted triangular, 2, 6 and 3 E/(δ² A).
        for (shape, factor) in [
            (Micromodulus::InverseDistance, 2.0),
            (Micromodulus::Triangular, 6.0),
        ] {
            let c = shape.constant::<1>(delta, e);
            assert!((c * delta.powi(2) / (factor * e) - 1.0).abs() < 1e-13);
        }
        let c = Micromodulus::Constant.constant::<1>(delta, e);
        assert!((c * delta.powi(3) / (3.0 * e) - 1.0).abs() < 1e-13);
    }
}
