//! The linear viscoelastic solid: a Prony series of the shear modulus, an elastic bulk.

use super::prony::{PronySeries, PronyStep};
use super::{LocalLaw, LocalResponse};
use crate::tensor::{Tensor, Tensor4, strain};

/// Components of a strain that are remembered: xx, xy, xz, yy, yz, zz.
const COMPONENTS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// The names of all that a point remembers, the strain first, then that of the springs, arm by arm.
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
/// Source: [SAND2015-7998] eq. (4.12)–(4.15), whose deviatoric extension is here the deviator of the classical strain (\[SimoHughes1998\] chapter 10): the share `λ_i` of the shear modulus relaxes with the time `τ_i`; K and μ are those at once.
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

    fn history(&self) -> &'static [&'static str] {
        &HISTORY[..COMPONENTS.len() * self.series.remembered()]
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
