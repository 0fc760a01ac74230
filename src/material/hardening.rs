//! Growth of the yield stress of a ductile material with the equivalent plastic strain, and with its rate.

/// Most steps of the search for the plastic flow.
const ITERATIONS: usize = 200;

/// Johnson–Cook: `σ_y = (A + B αⁿ) (1 + C ln max(α̇/ε̇₀, 1)) (1 − T*ᵐ)`, `T* = (T − T_r)/(T_m − T_r)`, at a given temperature T (\[JohnsonCook1983\]).
///
/// Stresses in Pa, temperatures in one unit, ε̇₀ in 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JohnsonCook {
    /// A: the yield stress at the reference rate and temperature.
    pub yield_stress: f64,
    /// B.
    pub modulus: f64,
    /// n.
    pub exponent: f64,
    /// C: growth with the logarithm of the rate.
    pub rate_coefficient: f64,
    /// ε̇₀; slower flow is no weaker.
    pub reference_rate: f64,
    /// `1 − T*ᵐ`, from [`JohnsonCook::softening`].
    pub softening: f64,
}

impl JohnsonCook {
    /// `1 − T*ᵐ`: 1 up to the reference temperature, 0 from that of melting on.
    pub fn softening(temperature: f64, reference: f64, melting: f64, exponent: f64) -> f64 {
        let homologous = ((temperature - reference) / (melting - reference)).clamp(0.0, 1.0);
        1.0 - homologous.powf(exponent)
    }

    fn of_rate(&self, rate: f64) -> f64 {
        1.0 + self.rate_coefficient * (rate / self.reference_rate).max(1.0).ln()
    }
}

/// Isotropic hardening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hardening {
    /// Linear and saturating (Voce): `σ_y = σ_0 + H α + Q (1 − exp(−b α))`.
    Voce {
        /// σ_0 \[Pa\].
        yield_stress: f64,
        /// H \[Pa\].
        modulus: f64,
        /// Q \[Pa\].
        saturation: f64,
        /// b \[1\].
        rate: f64,
    },
    /// Johnson–Cook.
    JohnsonCook(JohnsonCook),
}

impl Hardening {
    /// The yield stress \[Pa\] and its slope in the flow `flow`, by which α grew within a step of the length `step` \[s\] to `alpha`.
    pub(super) fn yield_stress(&self, alpha: f64, flow: f64, step: f64) -> (f64, f64) {
        match *self {
            Self::Voce {
                yield_stress,
                modulus,
                saturation,
                rate,
            } => {
                let left = (-rate * alpha).exp();
                (
                    yield_stress + modulus * alpha + saturation * (1.0 - left),
                    modulus + saturation * rate * left,
                )
            }
            Self::JohnsonCook(law) => {
                let hard = law.modulus * alpha.powf(law.exponent);
                let steep = match alpha > 0.0 {
                    true => law.exponent * hard / alpha,
                    false => 0.0,
                };
                let (fast, per_flow) = match flow / step > law.reference_rate {
                    true => (law.of_rate(flow / step), law.rate_coefficient / flow),
                    false => (1.0, 0.0),
                };
                let still = law.yield_stress + hard;
                (
                    still * fast * law.softening,
                    (steep * fast + still * per_flow) * law.softening,
                )
            }
        }
    }

    /// The flow Δα of a step: `equivalent − stiffness Δα = σ_y(before + Δα)`, zero within the yield surface. Nothing flows at once where flow takes time.
    pub fn flow(&self, equivalent: f64, stiffness: f64, before: f64, step: f64) -> f64 {
        let (bound, steep) = self.yield_stress(before, 0.0, step);
        let excess = equivalent - bound;
        if excess <= 0.0 {
            return 0.0;
        }
        match *self {
            Self::Voce {
                modulus,
                saturation: 0.0,
                ..
            } => return excess / (stiffness + modulus),
            Self::JohnsonCook(_) if step <= 0.0 => return 0.0,
            _ => {}
        }
        // the residual falls with the flow: Newton's method between bounds, from the slope at the start, if there is one
        let (mut low, mut high) = (0.0, excess / stiffness);
        let mut flow = match steep > 0.0 {
            true => excess / (stiffness + steep),
            false => 0.5 * high,
        };
        for _ in 0..ITERATIONS {
            let (bound, slope) = self.yield_stress(before + flow, flow, step);
            let residual = equivalent - stiffness * flow - bound;
            match residual > 0.0 {
                true => low = flow,
                false => high = flow,
            }
            let by_slope = flow + residual / (stiffness + slope);
            // the residual is a difference of stresses that are rounded
            if residual.abs() <= 2.0 * f64::EPSILON * equivalent {
                return by_slope;
            }
            let next = match by_slope > low && by_slope < high {
                true => by_slope,
                false => 0.5 * (low + high),
            };
            if (next - flow).abs() <= 1e-16 * next || next <= low || next >= high {
                return next;
            }
            flow = next;
        }
        flow
    }

    /// Energy stored by hardening \[J/m^D\]; that of Johnson–Cook is all dissipated.
    pub fn stored(&self, alpha: f64) -> f64 {
        match *self {
            Self::Voce {
                modulus,
                saturation,
                rate,
                ..
            } => {
                let saturated = match rate > 0.0 {
                    true => saturation * (alpha + (-rate * alpha).exp_m1() / rate),
                    false => 0.0,
                };
                0.5 * modulus * alpha * alpha + saturated
            }
            Self::JohnsonCook(_) => 0.0,
        }
    }

    /// Energy dissipated by a flow within a step of the length `step` \[s\] that ends at `alpha` \[J/m^D\].
    pub fn dissipated(&self, alpha: f64, flow: f64, step: f64) -> f64 {
        match *self {
            Self::Voce { yield_stress, .. } => yield_stress * flow,
            Self::JohnsonCook(_) if flow <= 0.0 => 0.0,
            Self::JohnsonCook(_) => self.yield_stress(alpha, flow, step).0 * flow,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{J2, LocalLaw};
    use super::*;
    use crate::tensor::Tensor;

    const YOUNG: f64 = 2e5;
    const SHEAR: f64 = YOUNG / 2.6;

    /// A bar that is strained step by step: stress, α, energies stored and dissipated.
    fn bar(law: Hardening, strains: &[f64], step: f64) -> (f64, f64, f64, f64) {
        let law = J2::<1>::with_hardening(YOUNG - 2.0 * SHEAR, SHEAR, law);
        let (mut past, mut lost, mut last) = (vec![0.0; 2], 0.0, None);
        for &e in strains {
            let mut present = past.clone();
            let found = law.respond(&Tensor::<1>::new(e), step, &past, &mut present);
            past = present;
            lost += found.dissipated;
            last = Some(found);
        }
        let last = last.expect("strains");
        (last.stress[0], past[1], last.stored, lost)
    }

    #[test]
    fn voce_hardening_has_its_closed_form() {
        let (yield_stress, modulus, saturation, rate) = (250.0, 900.0, 120.0, 60.0);
        let law = Hardening::Voce {
            yield_stress,
            modulus,
            saturation,
            rate,
        };
        // of α follow stress and strain: ε = σ/E + α
        for alpha in [1e-6, 1e-3, 0.03, 0.4f64] {
            let stress =
                yield_stress + modulus * alpha + saturation * (1.0 - (-rate * alpha).exp());
            let strain = stress / YOUNG + alpha;
            for path in [vec![strain], vec![0.3 * strain, 0.8 * strain, strain]] {
                let (found, flowed, stored, lost) = bar(law, &path, 1.0);
                assert!((found - stress).abs() < 1e-11 * stress, "{found} {stress}");
                assert!((flowed - alpha).abs() < 1e-12 * alpha.max(1e-3));
                // the work, ∫ σ dε = σ²/2E + ∫ σ_y dα
                let work = stress * stress / (2.0 * YOUNG)
                    + (yield_stress + saturation) * alpha
                    + 0.5 * modulus * alpha * alpha
                    - saturation * (1.0 - (-rate * alpha).exp()) / rate;
                assert!((stored + lost - work).abs() < 1e-10 * work);
            }
        }
    }

    #[test]
    fn johnson_cook_hardening_has_its_closed_form() {
        let softening = JohnsonCook::softening(500.0, 293.0, 1793.0, 1.03);
        assert!((softening - (1.0 - (207.0f64 / 1500.0).powf(1.03))).abs() < 1e-15);
        let law = JohnsonCook {
            yield_stress: 792.0,
            modulus: 510.0,
            exponent: 0.26,
            rate_coefficient: 0.014,
            reference_rate: 1.0,
            softening,
        };
        // one step of Δt: α̇ = α/Δt, fast and slower than the reference rate
        for (alpha, step) in [(1e-9, 1e-3), (1e-4, 1e-3), (0.05, 1e-3), (0.05, 100.0f64)] {
            let factor = 1.0 + 0.014 * (alpha / step).max(1.0).ln();
            let stress = (792.0 + 510.0 * alpha.powf(0.26)) * factor * softening;
            let strain = stress / YOUNG + alpha;
            let (found, flowed, _, lost) = bar(Hardening::JohnsonCook(law), &[strain], step);
            assert!((found - stress).abs() < 1e-11 * stress, "{found} {stress}");
            assert!((flowed - alpha).abs() < 1e-13, "{flowed} {alpha}");
            assert!((lost - stress * flowed).abs() < 1e-10 * stress);
        }
        // many steps at one rate of flow: that of the strain, but for the elastic part
        let rate = 1e3;
        let strains: Vec<f64> = (1..=4000).map(|k| 0.2 * f64::from(k) / 4000.0).collect();
        let (found, alpha, ..) = bar(Hardening::JohnsonCook(law), &strains, 0.2 / 4000.0 / rate);
        let expected = (792.0 + 510.0 * alpha.powf(0.26)) * (1.0 + 0.014 * rate.ln()) * softening;
        // the flow is slower than the strain by dσ/dε/E
        assert!(
            (found - expected).abs() < 1e-4 * expected,
            "{found} {expected}"
        );
    }

    #[test]
    fn nothing_flows_in_no_time() {
        let law = Hardening::JohnsonCook(JohnsonCook {
            yield_stress: 100.0,
            modulus: 0.0,
            exponent: 1.0,
            rate_coefficient: 0.1,
            reference_rate: 1.0,
            softening: 1.0,
        });
        assert_eq!(law.flow(500.0, YOUNG, 0.1, 0.0), 0.0);
    }
}
