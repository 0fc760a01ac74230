//! The linear viscoelastic solid: a Prony series of the shear modulus, an elastic bulk.

use super::prony::{PronySeries, PronyStep};
use super::{Banded, LocalHistory, LocalLaw, LocalResponse};
use crate::tensor::{Tensor, Tensor4, strain};

/// Components of a strain that are remembered: xx, xy, xz, yy, yz, zz.
const COMPONENTS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// The names of the history variables of a point, the strain first, then that of the springs, arm by arm.
macro_rules! of_arms {
    ($($arm:literal)*) => {
        const HISTORY: [&str; COMPONENTS.len() * (1 + PronySeries::ARMS)] = [
            "deviatoric strain xx",
            "deviatoric strain xy",
            "deviatoric strain xz",
            "deviatoric strain yy",
            "deviatoric strain yz",
            "deviatoric strain zz",
            $(
                concat!("deviatoric strain xx of the spring in arm ", $arm),
                concat!("deviatoric strain xy of the spring in arm ", $arm),
                concat!("deviatoric strain xz of the spring in arm ", $arm),
                concat!("deviatoric strain yy of the spring in arm ", $arm),
                concat!("deviatoric strain yz of the spring in arm ", $arm),
                concat!("deviatoric strain zz of the spring in arm ", $arm),
            )*
        ];
    };
}
of_arms!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16);

/// The part of the shear modulus that lasts, below which a solid that has relaxed counts as one that shears without a change of volume: elements with the dilatation of each point would resist it.
/// At a tenth, a Poisson's ratio of 0.3 has become 0.477.
const SHEARS: f64 = 0.1;

/// Generalised Maxwell solid for small strains, `σ = K tr ε I + 2 μ [(1 − Σ λ_i) e + Σ λ_i q_i]` with the deviator `e = dev ε` and `q̇_i = ė − q_i/τ_i` of each arm.
///
/// Source: [SAND2015-7998] eq. (4.12), (4.13), (4.14), (4.15), whose deviatoric extension is here the deviator of the classical strain (\[SimoHughes1998\] chapter 10): the share `λ_i` of the shear modulus relaxes with the time `τ_i`; K and μ are those at once.
/// The update is exact for a strain that is linear over the step ([`PronyStep::follow`]).
///
/// For solids; [`super::Reduced`] makes it a law of bars, plates and long bodies.
#[derive(Clone, Debug)]
pub struct GeneralisedMaxwell {
    elastic: Tensor4<3>,
    bulk: f64,
    shear: f64,
    series: PronySeries,
}

impl GeneralisedMaxwell {
    /// A solid of these Lamé parameters at once \[Pa\], whose shear modulus relaxes by a series.
    pub fn new(lambda: f64, shear: f64, series: PronySeries) -> Self {
        Self {
            elastic: Tensor4::isotropic(lambda, shear),
            bulk: lambda + 2.0 / 3.0 * shear,
            shear,
            series,
        }
    }

    /// Lamé's parameters by which the stress at the end of a step grows with the strain there \[Pa\].
    fn moduli(&self, step: &PronyStep) -> (f64, f64) {
        let shear = self.shear * step.slope();
        (self.bulk - 2.0 / 3.0 * shear, shear)
    }
}

impl LocalLaw<3> for GeneralisedMaxwell {
    fn tangent(&self) -> &Tensor4<3> {
        &self.elastic
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn is_objective(&self) -> bool {
        false
    }

    fn history(&self) -> LocalHistory {
        LocalHistory::of(&HISTORY[..COMPONENTS.len() * self.series.remembered()])
    }

    fn flows_at_constant_volume(&self) -> bool {
        self.series.lasting() < SHEARS
    }

    fn algorithmic_tangent(&self, _gradient: &Tensor<3>, step: f64, _past: &[f64]) -> Tensor4<3> {
        let (lambda, shear) = self.moduli(&self.series.over(step));
        Tensor4::isotropic(lambda, shear)
    }

    fn has_symmetric_tangent(&self) -> bool {
        true
    }

    fn in_band(&self, _width: f64) -> Option<Banded<3>> {
        None
    }

    fn respond(
        &self,
        gradient: &Tensor<3>,
        step: f64,
        past: &[f64],
        present: &mut [f64],
    ) -> LocalResponse<3> {
        let total = strain(gradient);
        let dilatation = total.trace();
        let series = self.series.over(step);
        let mut stress = Tensor::identity() * (self.bulk * dilatation);
        let mut stored = 0.5 * self.bulk * dilatation * dilatation;
        let mut dissipated = 0.0;
        for (c, (i, j)) in COMPONENTS.into_iter().enumerate() {
            let (mean, counted) = match i == j {
                true => (dilatation / 3.0, 1.0),
                false => (0.0, 2.0),
            };
            let place = |k: usize| k * COMPONENTS.len() + c;
            let found = series.follow(
                total[(i, j)] - mean,
                |k| past[place(k)],
                |k, x| present[place(k)] = x,
            );
            let carried = 2.0 * self.shear * found.strain;
            stress[(i, j)] += carried;
            if i != j {
                stress[(j, i)] += carried;
            }
            stored += 2.0 * self.shear * counted * found.stored;
            dissipated += 2.0 * self.shear * counted * found.dissipated;
        }
        LocalResponse {
            stress,
            across: 0.0,
            volume_ratio: 1.0,
            stored,
            dissipated,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Kinematics, Reduced};
    use std::sync::Arc;

    const LAME: (f64, f64) = (600.0, 400.0);

    fn solid(arms: &[(f64, f64)]) -> GeneralisedMaxwell {
        GeneralisedMaxwell::new(LAME.0, LAME.1, PronySeries::new(arms.to_vec()))
    }

    /// Responses to gradients one after another, each after a step of its own length.
    fn along<const D: usize>(
        law: &dyn LocalLaw<D>,
        path: &[(f64, Tensor<D>)],
    ) -> Vec<LocalResponse<D>> {
        let mut past = vec![0.0; law.history().len()];
        let mut found = Vec::new();
        for (step, gradient) in path {
            let mut present = past.clone();
            found.push(law.respond(gradient, *step, &past, &mut present));
            past = present;
        }
        found
    }

    #[test]
    fn a_solid_that_is_sheared_at_a_rate_has_its_closed_form_and_its_bulk_is_elastic() {
        let (share, time, rate) = (0.6, 0.4, 0.02);
        let law = solid(&[(share, time)]);
        let grown = |t: f64| {
            let mut g = Tensor::<3>::identity() * (0.01 * t);
            g[(0, 2)] = rate * t;
            g
        };
        // steps of 0.01 to 10 relaxation times
        let steps = [0.004, 0.3, 4.0];
        let mut t = 0.0;
        let path: Vec<_> = steps
            .iter()
            .map(|step| {
                t += step;
                (*step, grown(t))
            })
            .collect();
        let mut t = 0.0;
        for (step, found) in steps.iter().zip(along(&law, &path)) {
            t += step;
            let shear =
                LAME.1 * rate * ((1.0 - share) * t + share * time * (1.0 - (-t / time).exp()));
            assert!((found.stress[(0, 2)] - shear).abs() < 1e-13 * LAME.1);
            assert_eq!(found.stress[(0, 2)], found.stress[(2, 0)]);
            let pressure = (LAME.0 + 2.0 / 3.0 * LAME.1) * 0.03 * t;
            for i in 0..3 {
                assert!((found.stress[(i, i)] - pressure).abs() < 1e-12 * LAME.0);
            }
        }
    }

    #[test]
    fn work_is_stored_or_dissipated_in_any_body_and_nothing_is_gained() {
        fn balances<const D: usize>(kinematics: Kinematics) {
            let law = Reduced::<D>::new(Arc::new(solid(&[(0.3, 0.4), (0.5, 3.0)])), kinematics);
            let at = |t: f64| {
                Tensor::<D>::from_fn(|i, j| 0.01 * ((1.0 + i as f64) * t + 2.0 * j as f64).sin())
            };
            let missing = |parts: usize| {
                let h = 6.0 / parts as f64;
                let path: Vec<_> = (1..=parts)
                    .map(|n| (h, at(h * n as f64) - at(0.0)))
                    .collect();
                let found = along(&law, &path);
                let (mut work, mut lost) = (0.0, 0.0);
                let (mut stress, mut gradient) = (Tensor::zeros(), Tensor::zeros());
                for (answer, (_, next)) in found.iter().zip(&path) {
                    work += 0.5 * (answer.stress + stress).dot(&(next - gradient));
                    lost += answer.dissipated;
                    assert!(answer.dissipated >= 0.0);
                    (stress, gradient) = (answer.stress, *next);
                }
                (found[parts - 1].stored + lost) / work - 1.0
            };
            // the trapezoidal rule for the work
            let (coarse, fine) = (missing(100), missing(200));
            assert!(fine.abs() < 5e-4, "{kinematics:?}: {fine:e}");
            assert!(
                (coarse / fine - 4.0).abs() < 0.1,
                "{kinematics:?}: {coarse:e} {fine:e}"
            );
        }
        balances::<1>(Kinematics::Bar);
        balances::<2>(Kinematics::PlaneStress);
        balances::<2>(Kinematics::PlaneStrain);
        balances::<3>(Kinematics::Solid);
    }

    #[test]
    fn a_plate_that_is_back_where_it_began_is_stressed_by_what_it_remembers() {
        let law = Reduced::<2>::new(Arc::new(solid(&[(0.5, 1.0)])), Kinematics::PlaneStress);
        let drawn = Tensor::<2>::new(0.01, 0.0, 0.0, 0.0);
        let path = [
            (0.0, drawn),
            (1.0, drawn),
            (0.0, Tensor::zeros()),
            (0.0, drawn * 1e-16),
            (60.0, Tensor::zeros()),
        ];
        let found = along(&law, &path);
        let [held, back, hardly, later] = [1, 2, 3, 4].map(|k: usize| found[k].stress[(0, 0)]);
        assert!(held > 0.0 && back < -1e-3 * held, "{held} {back}");
        assert!((hardly / back - 1.0).abs() < 1e-12, "{hardly} {back}");
        // it forgets, up to what has come of the sides in one long step
        assert!(later.abs() < 0.1 * back.abs(), "{later} {back}");
    }
}
