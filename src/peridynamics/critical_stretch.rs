//! Critical stretch from the fracture energy: the energy that separates a body along a plane, bond by bond.
//!
//! [`plane_energy`] sums over the bonds of the lattice at hand. [`BondEnergy::critical_stretch`] integrates over a continuous family, as papers do: with δ = m h a plane of the lattice then takes 1.25 (1D, m = 2) to 0.83 (2D, m = 2)
//! and 0.95 to 1.09 (m = 3 to 6, 2D and 3D) of the energy that was given.

use std::f64::consts::PI;

use crate::peridynamics::{Influence, Micromodulus};

/// The bonds of a full, continuous family, as far as breaking them costs energy.
///
/// Units: λ \[N/m^(2D+3)\] such that the energy of a bond stretched by `s` is `½ λ r⁴ s²` per volume squared, moduli of `D` dimensions \[Pa\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BondEnergy {
    /// Pairwise bonds: λ = constant · shape.
    Pairwise {
        /// Shape of λ.
        micromodulus: Micromodulus,
        /// Its constant, [`Micromodulus::constant`].
        constant: f64,
    },
    /// Linear peridynamic solid with the bulk modulus of `D` dimensions and the shear modulus.
    Lps {
        /// The influence function ω.
        influence: Influence,
        /// `k = λ + 2μ/D`.
        bulk: f64,
        /// `μ`.
        shear: f64,
    },
}

/// Error of a fracture energy that gives no critical stretch.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FractureError {
    /// Not a positive, finite energy.
    #[error("the fracture energy is {energy}: it must be positive and finite")]
    Energy {
        /// The fracture energy that was given \[J/m²\].
        energy: f64,
    },
    /// A bond that softens never stores enough.
    #[error(
        "no stretch of a bond stores the fracture energy: linear bonds would at {linear:.3e}; give critical-stretch instead, or let bonds soften less"
    )]
    Unreached {
        /// The stretch at which bonds that are linear in their extension would.
        linear: f64,
    },
    /// The state part releases more energy than the bonds take.
    #[error(
        "opening a plane in this material would release energy ({per_square} J/m² at unit stretch): its Poisson ratio is too far below that of bonds that act alone; give critical-stretch instead, or raise the ratio"
    )]
    Releases {
        /// Energy per area and stretch squared \[J/m²\].
        per_square: f64,
    },
}

/// Returns the energy per area and square of the critical stretch, `G0/s_c²`, that two halves of a lattice take when they are pulled apart along a plane between two layers without being strained: the mean over planes normal to each axis.
///
/// Opened by Δ, a bond ξ across the plane is stretched by `Δ ξ_n/r²` and breaks at `Δ = s_c r²/ξ_n`. Its cost is the energy stored just before less that stored just after. With bonds that act alone that is `p r⁴ s_c²` each. Of an LPS the dilatations
/// `Σ ω Δ ξ_n V` of the layers that the bond joins change as well, and as bonds break one after another that is not what it would be if all were stretched alike.
///
/// `bonds`: the whole family of a point by integer offsets with `p` and ω of [`crate::peridynamics::linear_force_state`]; `state`: the modulus `𝓜_1111` of `½ 𝓜 (Σ ω ξ·η V)²`, zero without a state; `deviator`: [`crate::peridynamics::StatePart::deviator`]. Units: spacing \[m\] → \[J/m²\] (J/m in 2D, J in 1D).
pub fn plane_energy<const D: usize>(
    spacing: f64,
    bonds: &[([i32; D], (f64, f64))],
    state: f64,
    deviator: f64,
) -> f64 {
    let mean = (0..D).map(|axis| plane_normal_to(axis, spacing, bonds, state, deviator));
    mean.sum::<f64>() / D as f64
}

/// A bond across the plane.
struct Crossing {
    /// At which it breaks, in spacings and per critical stretch.
    opening: f64,
    /// Layers that it crosses.
    steps: i32,
    /// p (ξ_n)² V² of all its parallels per cell's face.
    pairs: f64,
    /// ω ξ_n V.
    dilatation: f64,
    /// p r² ξ_n V and p r⁴ V.
    deviator: [f64; 2],
}

fn plane_normal_to<const D: usize>(
    axis: usize,
    h: f64,
    bonds: &[([i32; D], (f64, f64))],
    state: f64,
    deviator: f64,
) -> f64 {
    let volume = h.powi(D as i32);
    let mut crossing: Vec<Crossing> = bonds
        .iter()
        .filter(|(k, _)| k[axis] > 0)
        .map(|(k, (p, omega))| {
            let square: i32 = k.iter().map(|k| k * k).sum();
            let xi = f64::from(k[axis]) * h;
            let pairs = f64::from(k[axis]) * p * (xi * volume).powi(2);
            let opening = f64::from(square) / f64::from(k[axis]);
            let r2 = f64::from(square) * h * h;
            Crossing {
                opening,
                steps: k[axis],
                pairs,
                dilatation: omega * xi * volume,
                deviator: [p * r2 * xi * volume, p * r2 * r2 * volume],
            }
        })
        .collect();
    crossing.sort_by(|a, b| a.opening.total_cmp(&b.opening));
    let layers = crossing.iter().map(|b| b.steps).max().unwrap_or(0);
    // stored at unit opening, per cell's face, by the bonds that stand
    let stored = |standing: &[Crossing]| {
        let pairs: f64 = standing.iter().map(|b| b.pairs).sum();
        let of_layer = |layer: i32| {
            let across = standing.iter().filter(|b| b.steps >= layer);
            across.map(|b| b.dilatation).sum::<f64>()
        };
        // a layer on either side: twice ½
        let states: f64 = (1..=layers).map(|layer| of_layer(layer).powi(2)).sum();
        let squares = pairs + state * volume * states;
        if deviator == 0.0 {
            return squares;
        }
        // of each layer −2 d θ Σ p r² ξ_n V, and what θ stored in the deviatoric extensions of bonds that are broken
        let products = (1..=layers).map(|layer| {
            let of = |bonds: &[Crossing], k: usize| -> f64 {
                let across = bonds.iter().filter(|b| b.steps >= layer);
                across.map(|b| b.deviator[k]).sum()
            };
            let theta = of_layer(layer);
            let lost = of(&crossing, 1) - of(standing, 1);
            2.0 * deviator * theta * of(standing, 0) + (deviator * theta).powi(2) * lost
        });
        squares - volume * products.sum::<f64>()
    };
    let (mut energy, mut first) = (0.0, 0);
    let mut before = stored(&crossing);
    while first < crossing.len() {
        let opening = crossing[first].opening;
        let alike = crossing[first..]
            .iter()
            .take_while(|b| b.opening <= opening * (1.0 + 1e-12));
        first += alike.count();
        let after = stored(&crossing[first..]);
        energy += (opening * h).powi(2) * (before - after);
        before = after;
    }
    energy / h.powi(D as i32 - 1)
}

/// The critical stretch at which a plane takes the energy `energy`, if it takes `per_square` at a critical stretch of one.
///
/// # Errors
/// [`FractureError`] if the energy is not positive, or if opening the plane releases energy.
pub fn critical_stretch(energy: f64, per_square: f64) -> Result<f64, FractureError> {
    if !(energy.is_finite() && energy > 0.0) {
        return Err(FractureError::Energy { energy });
    }
    if per_square.is_nan() || per_square <= 0.0 {
        return Err(FractureError::Releases { per_square });
    }
    Ok((energy / per_square).sqrt())
}

/// The stretch at which a bond holds what one that is linear in its extension holds at the stretch `linear`; `ratio` is [`crate::peridynamics::ForceState::energy_ratio`].
///
/// # Errors
/// [`FractureError::Unreached`] if a bond that softens never holds as much.
pub fn stretch_of_equal_energy(
    linear: f64,
    ratio: impl Fn(f64) -> f64,
) -> Result<f64, FractureError> {
    /// Halvings of the interval: to the last bit.
    const HALVINGS: usize = 200;
    /// Stretches looked at.
    const LARGEST: f64 = 1e3;
    let held = |s: f64| s * s * ratio(s) - linear * linear;
    if held(linear) == 0.0 {
        return Ok(linear);
    }
    // upwards from below any root, so that the first one is met
    let (mut low, mut high) = (0.0, linear * 1e-3);
    while held(high) < 0.0 {
        low = high;
        high *= 1.05;
        if high > LARGEST.max(linear * 10.0) {
            return Err(FractureError::Unreached { linear });
        }
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        match held(middle) < 0.0 {
            true => low = middle,
            false => high = middle,
        }
    }
    Ok(high)
}

impl BondEnergy {
    /// The critical stretch `s_c` at which all bonds across a plane, stretched alike while no other bond is, hold the energy `energy` per area.
    ///
    /// With bonds that act alone the energy per area is
    ///
    /// ```text
    /// G0 = s² ∫_0^δ dz ∫_z^δ ½ λ r⁴ A(r, z) dr ,    A = 1 (1D), 2 r acos(z/r) (2D), 2π r² (1 − z/r) (3D)
    ///    = s² { ½ ∫ λ r⁵ dr (1D),  ∫ λ r⁶ dr (2D),  π/2 ∫ λ r⁷ dr (3D) } ,
    /// ```
    ///
    /// which for `λ = c/r³` is the prototype microelastic brittle `s_c² = 10 G0/(π c δ⁵)` in 3D and `4 G0/(c δ⁴)` in 2D \[Silling2005\]. An LPS adds
    /// `2 ∫ ½ K′ θ(z)² dz` with the dilatation `θ(z) = D/m s ∫ ω r² A dr` of a point at distance `z` from the plane and `K′ = k − (D + 2) μ/D`.
    ///
    /// Units: `energy` \[J/m²\] (J/m of crack and unit thickness in 2D, J per unit section in 1D), `horizon` \[m\].
    ///
    /// # Errors
    /// [`FractureError`] if the energy is not positive, or if opening the plane releases energy.
    pub fn critical_stretch<const D: usize>(
        self,
        energy: f64,
        horizon: f64,
    ) -> Result<f64, FractureError> {
        critical_stretch(energy, self.per_square::<D>(horizon))
    }

    /// `G0/s²`.
    fn per_square<const D: usize>(self, horizon: f64) -> f64 {
        let plane = |lambda: &dyn Fn(f64) -> f64| {
            let (factor, power) = [(0.5, 5), (1.0, 6), (0.5 * PI, 7)][D - 1];
            factor * integral(0.0, horizon, |r| lambda(r) * r.powi(power))
        };
        match self {
            Self::Pairwise {
                micromodulus,
                constant,
            } => plane(&|r| constant * micromodulus.shape(r, horizon)),
            Self::Lps {
                influence,
                bulk,
                shear,
            } => {
                let d = D as f64;
                let m = influence.weighted_volume::<D>(horizon);
                let pairs = plane(&|r| {
                    2.0 * d * (d + 2.0) * shear / m * influence.value(r, horizon) / (r * r)
                });
                let dilatation = |z: f64| {
                    d / m
                        * integral(z, horizon, |r| {
                            influence.value(r, horizon) * r * r * cap::<D>(r, z)
                        })
                };
                let state = bulk - (d + 2.0) * shear / d;
                pairs + state * integral(0.0, horizon, |z| dilatation(z).powi(2))
            }
        }
    }
}

/// Measure of the part of a sphere of radius `r` beyond a plane at distance `z`.
fn cap<const D: usize>(r: f64, z: f64) -> f64 {
    match D {
        1 => 1.0,
        2 => 2.0 * r * (z / r).clamp(-1.0, 1.0).acos(),
        _ => 2.0 * PI * r * (r - z),
    }
}

/// `∫_a^b f`: Gauss–Legendre of three points on pieces that shrink towards both ends, where square roots and `1/r` sit.
fn integral(a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
    const PIECES: usize = 96;
    const NODE: f64 = 0.774_596_669_241_483_4;
    // x = a + (b − a) (3 t² − 2 t³) has a vanishing slope at both ends
    let at = |t: f64| a + (b - a) * t * t * (3.0 - 2.0 * t);
    let slope = |t: f64| 6.0 * (b - a) * t * (1.0 - t);
    let half = 0.5 / PIECES as f64;
    (0..PIECES)
        .map(|piece| {
            let middle = (2 * piece + 1) as f64 * half;
            [(-NODE, 5.0), (0.0, 8.0), (NODE, 5.0)]
                .iter()
                .map(|(x, w)| {
                    let t = middle + x * half;
                    w / 9.0 * half * slope(t) * f(at(t))
                })
                .sum::<f64>()
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peridynamics::influence::{Alpha, Degree};

    #[test]
    fn the_prototype_material_has_the_closed_forms() {
        let (delta, g0, c1111) = (0.37, 5.2, 3.1e9);
        let law = |constant| BondEnergy::Pairwise {
            micromodulus: Micromodulus::InverseDistance,
            constant,
        };
        let c = Micromodulus::InverseDistance.constant::<3>(delta, c1111);
        let s = law(c).critical_stretch::<3>(g0, delta).unwrap();
        let exact = (10.0 * g0 / (PI * c * delta.powi(5))).sqrt();
        assert!((s / exact - 1.0).abs() < 1e-9, "{s} {exact}");
        // with k = 5/9 C_1111 at ν = 1/4, s_c = √(5 G0 / (9 k δ))
        let k = 5.0 / 9.0 * c1111;
        assert!((s / (5.0 * g0 / (9.0 * k * delta)).sqrt() - 1.0).abs() < 1e-9);
        let c = Micromodulus::InverseDistance.constant::<2>(delta, c1111);
        let s = law(c).critical_stretch::<2>(g0, delta).unwrap();
        // plane stress, E = 8/9 C_1111: s_c = √(4 π G0 / (9 E δ))
        let exact = (4.0 * PI * g0 / (9.0 * c1111 * 8.0 / 9.0 * delta)).sqrt();
        assert!((s / exact - 1.0).abs() < 1e-9, "{s} {exact}");
        let c = Micromodulus::InverseDistance.constant::<1>(delta, c1111);
        let s = law(c).critical_stretch::<1>(g0, delta).unwrap();
        // G0 = s² c δ³/6 and c = 2 C/δ²
        let exact = (3.0 * g0 / (c1111 * delta)).sqrt();
        assert!((s / exact - 1.0).abs() < 1e-9, "{s} {exact}");
    }

    #[test]
    fn a_plane_of_a_fine_lattice_takes_what_the_integral_says() {
        // 1D, λ = c/r³: Σ n · ½ c n h · h² against c δ³/6
        for m in [2_i32, 3, 6, 200] {
            let (h, c) = (0.01, 3.0);
            let bonds: Vec<_> = (-m..=m)
                .filter(|k| *k != 0)
                .map(|k| ([k], (0.5 * c / (f64::from(k.abs()) * h).powi(3), 0.0)))
                .collect();
            let delta = f64::from(m) * h;
            let continuum = BondEnergy::Pairwise {
                micromodulus: Micromodulus::InverseDistance,
                constant: c,
            };
            let found = plane_energy::<1>(h, &bonds, 0.0, 0.0);
            let ratio = found / continuum.per_square::<1>(delta);
            let exact = f64::from((m + 1) * (2 * m + 1)) / f64::from(2 * m * m);
            assert!((ratio - exact).abs() < 1e-9, "{m}: {ratio} {exact}");
        }
    }

    #[test]
    fn a_plane_of_two_bonds_with_a_state_is_as_by_hand() {
        // 1D, neighbours at h and 2 h, p and ω alike one, h = 1: a plane is crossed by one short and two long bonds. Opened by Δ: pairs Δ² (1 + 2·4), dilatations 1 + 2 next to the plane, 2 behind it
        let bonds = [-2, -1, 1, 2].map(|k| ([k], (1.0, 1.0)));
        let state = 0.3;
        let before = 9.0 + state * (9.0 + 4.0);
        // the short one breaks at Δ = s, the long ones at 2 s
        let after = 8.0 + state * (4.0 + 4.0);
        let exact = (before - after) + 4.0 * after;
        let found = plane_energy::<1>(1.0, &bonds, state, 0.0);
        assert!((found - exact).abs() < 1e-14, "{found} {exact}");
    }

    #[test]
    fn an_lps_at_the_pairwise_ratio_breaks_like_bonds_that_act_alone() {
        let (delta, g0, mu) = (0.2, 1.0, 7.0);
        for degree in [Degree::P0, Degree::P1, Degree::P3] {
            let influence = Influence::Polynomial {
                degree,
                alpha: Alpha::One,
            };
            let lps = BondEnergy::Lps {
                influence,
                bulk: mu * 5.0 / 3.0,
                shear: mu,
            };
            let micromodulus = Micromodulus::Influence(influence);
            let pairs = BondEnergy::Pairwise {
                micromodulus,
                constant: micromodulus.constant::<3>(delta, 3.0 * mu),
            };
            let (a, b) = (
                lps.critical_stretch::<3>(g0, delta).unwrap(),
                pairs.critical_stretch::<3>(g0, delta).unwrap(),
            );
            assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn the_dilatation_of_an_lps_counts() {
        // ω = 1/r in 3D: θ(z) = s (3/2 − 2ζ + ζ⁴/2), so G0 = s² δ (3 μ + K′ ∫ θ²/s² dζ), the last integral 0.57778
        let (delta, mu, bulk) = (0.4, 2.0, 9.0);
        let lps = BondEnergy::Lps {
            influence: Influence::Polynomial {
                degree: Degree::P0,
                alpha: Alpha::One,
            },
            bulk,
            shear: mu,
        };
        let s = lps.critical_stretch::<3>(1.0, delta).unwrap();
        let square = 2.25 + 4.0 / 3.0 + 0.25 / 9.0 - 3.0 + 0.3 - 1.0 / 3.0;
        let exact = (1.0 / (delta * (3.0 * mu + (bulk - 5.0 / 3.0 * mu) * square))).sqrt();
        assert!((s / exact - 1.0).abs() < 1e-8, "{s} {exact}");
        assert!(lps.critical_stretch::<3>(-1.0, delta).is_err());
        let auxetic = BondEnergy::Lps {
            influence: Influence::Gaussian,
            bulk: -100.0,
            shear: mu,
        };
        assert!(matches!(
            auxetic.critical_stretch::<3>(1.0, delta),
            Err(FractureError::Releases { .. })
        ));
    }
}
