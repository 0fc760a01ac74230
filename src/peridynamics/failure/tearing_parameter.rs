//! Tearing parameter: plastic flow under tension, by which ductile materials fail.

use std::fmt;
use std::sync::Arc;

use super::{
    BondTraits, EndOfStep, FailureCriterion, FailureState, Flow, Reads, StateCriterion, Threshold,
    WholeBody,
};
use crate::parallel;

/// A bond breaks once the mean of the tearing parameters of its ends reaches a number.
#[derive(Debug)]
pub struct TearingParameter;

impl FailureCriterion for TearingParameter {
    fn key(&self) -> &'static str {
        "tearing-parameter"
    }

    fn about(&self) -> &'static str {
        "Tearing parameter at which a bond breaks: the equivalent plastic strain at failure of a bar in tension."
    }

    fn applies_to(&self, law: &BondTraits) -> bool {
        law.flows
    }

    fn threshold(&self, value: f64) -> Threshold {
        Threshold::State(Arc::new(CriticalTearing(value)))
    }
}

/// Tearing parameter at which bonds break.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CriticalTearing(pub f64);

impl fmt::Display for CriticalTearing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the tearing parameter {}", self.0)
    }
}

impl StateCriterion for CriticalTearing {
    fn reads(&self) -> Reads {
        Reads {
            flow: true,
            bonds: false,
        }
    }

    fn begin(&self, body: &WholeBody<'_>) -> Box<dyn FailureState> {
        Box::new(Tearing::new(self.0, body))
    }
}

/// The tearing parameter `P` of every point, averaged over families, and what of it breaks bonds.
///
/// Source: [SAND2015-7998] eq. (6.33), `P = ∫ (max{0, 2 σ₁/(3 (σ₁ − σ̄))})⁴ ε̇_p dt`, with the averages over a family of section 6.3:
///
/// ```text
/// Q = 1/V Σ S′ max{0, 2 σ₁′/(3 (σ₁′ − σ̄′))} V′ ,    R = 1/V Σ ε̇_p′ V′ ,    P = ∫ Q⁴ R dt ,    S = V_m/V_full
/// ```
///
/// A bond breaks where the mean of its ends' P reaches the critical value. As printed, Q lacks the power 4 and the maximum of (6.33), and R the rate. Here V is the volume of the family itself, its centre and the far points of its intact
/// bonds: with that of the full ball the void beyond a surface would count twice, since the surface factor S, the share of the fullest family that a family has, is about it already.
/// Q is taken over points that have flowed: in others the ratio says nothing, and is without bound where the stress is hydrostatic.
struct Tearing {
    /// P at which bonds break.
    critical: f64,
    /// S of each point.
    surface: Vec<f64>,
    /// P of each point at the beginning of the step.
    value: Vec<f64>,
    /// Least P of a point whose bonds may break: with the largest there is at the other end.
    least: f64,
    /// Kept between steps.
    share: Vec<Share>,
}

impl Flow {
    /// Flow between the plastic strains before and after a step; `tension` is asked for of points that have flowed alone.
    pub(crate) fn new([before, strain]: [f64; 2], tension: impl FnOnce() -> f64) -> Self {
        Self {
            strain,
            growth: strain - before,
            tension: match strain > 0.0 {
                true => tension(),
                false => 0.0,
            },
        }
    }
}

/// `max{0, 2 σ₁/(3 (σ₁ − σ̄))}`: 1 in uniaxial tension, 0 where no principal stress is tensile.
pub(crate) fn tension(principal: &[f64; 3]) -> f64 {
    let largest = principal.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mean = principal.iter().sum::<f64>() / 3.0;
    match largest > 0.0 {
        true => 2.0 * largest / (3.0 * (largest - mean)),
        false => 0.0,
    }
}

/// Contribution of a point to the averages of a family.
#[derive(Clone, Copy, Default)]
struct Share {
    volume: f64,
    strained: f64,
    /// Of points that have flowed.
    flowed: f64,
    tensile: f64,
}

impl Share {
    fn of(flow: Flow, volume: f64, surface: f64) -> Self {
        let (flowed, tensile) = match flow.strain > 0.0 {
            true => (volume, volume * surface * flow.tension),
            false => (0.0, 0.0),
        };
        Self {
            volume,
            strained: volume * flow.growth,
            flowed,
            tensile,
        }
    }

    fn add(&mut self, other: &Self) {
        self.volume += other.volume;
        self.strained += other.strained;
        self.flowed += other.flowed;
        self.tensile += other.tensile;
    }
}

impl Tearing {
    fn new(critical: f64, body: &WholeBody<'_>) -> Self {
        let (family_volume, horizon) = (body.family_volume, body.horizon);
        // the fullest family of each lattice
        let mut fullest: Vec<f64> = Vec::new();
        for (i, volume) in family_volume.iter().enumerate() {
            let lattice = horizon.lattice_of(i);
            fullest.resize(fullest.len().max(lattice + 1), 0.0);
            fullest[lattice] = volume.max(fullest[lattice]);
        }
        let volumes = family_volume.iter().enumerate();
        let surface = volumes.map(|(i, volume)| volume / fullest[horizon.lattice_of(i)]);
        Self {
            critical,
            surface: surface.collect(),
            value: vec![0.0; family_volume.len()],
            least: f64::INFINITY,
            share: vec![Share::default(); family_volume.len()],
        }
    }

    /// Finds the least P of a point whose bonds may break.
    fn find_least(&mut self) {
        let most = self.value.iter().copied().fold(0.0, f64::max);
        // with a margin for the rounding of a mean
        self.least = (2.0 * self.critical - most) * (1.0 - 1e-12) - 1e-12 * most;
    }
}

impl FailureState for Tearing {
    fn advance(&mut self, step: &EndOfStep<'_>) {
        let EndOfStep {
            families,
            volume,
            is_intact,
            flow,
            ..
        } = *step;
        // what each point adds to the sums of the families that it is in; a point without a family has no flow of its own
        let surface = &self.surface;
        let share_of = |j: usize, share: &mut Share| {
            let flows = surface[j] > 0.0 && !families.of(j).is_empty();
            *share = match flows {
                true => Share::of(flow(j), volume[j], surface[j]),
                false => Share::default(),
            };
        };
        parallel::for_each_mut(&mut self.share, 64, share_of);
        let shares = &self.share;
        if shares.iter().all(|share| share.strained == 0.0) {
            return;
        }
        let grow = |i: usize, value: &mut f64| {
            let family = families.of(i);
            if family.is_empty() {
                return;
            }
            let mut sum = shares[i];
            let start = families.offsets[i];
            for (k, &j) in family.iter().enumerate() {
                if is_intact[start + k] {
                    sum.add(&shares[j as usize]);
                }
            }
            if sum.strained > 0.0 {
                *value += (sum.tensile / sum.flowed).powi(4) * sum.strained / sum.volume;
            }
        };
        parallel::for_each_mut(&mut self.value, 64, grow);
        self.find_least();
    }

    fn may_break(&self, point: usize) -> bool {
        self.value[point] >= self.least
    }

    fn breaks(&self, [i, j]: [usize; 2], _bond: usize) -> bool {
        0.5 * (self.value[i] + self.value[j]) >= self.critical
    }

    fn history(&self) -> &[f64] {
        &self.value
    }

    fn restore(&mut self, history: &[f64]) {
        self.value.copy_from_slice(history);
        self.find_least();
    }

    fn fields(&self) -> Vec<(&'static str, Vec<f64>)> {
        vec![("tearing parameter", self.value.clone())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peridynamics::{Families, Horizon};

    #[test]
    fn tension_is_one_in_a_bar_and_grows_with_the_triaxiality() {
        // deviator of uniaxial tension under a pressure: σ₁ = σ̄ + 2 σ_e/3 with σ̄ = T σ_e, so (1 + 3 T/2) · 2/3 ...
        for triaxiality in [0.0, 1.0 / 3.0, 1.0, 4.0 / 3.0, 2.0] {
            let equivalent = 250.0;
            let mean: f64 = triaxiality * equivalent;
            let principal = [
                mean - equivalent / 3.0,
                mean + 2.0 / 3.0 * equivalent,
                mean - equivalent / 3.0,
            ];
            let expected = 2.0 / 3.0 * (1.0 + 1.5 * triaxiality);
            assert!((tension(&principal) - expected).abs() < 1e-14);
        }
        assert_eq!(tension(&[-3.0, -1.0, -1.0]), 0.0);
        assert_eq!(tension(&[0.0; 3]), 0.0);
    }

    /// A row of points, each with its neighbours up to two away.
    fn row(points: usize) -> Families {
        let near = |i: usize| {
            let all = i.saturating_sub(2)..=(i + 2).min(points - 1);
            all.filter(move |j| *j != i).map(|j| j as u32)
        };
        let mut families = Families {
            offsets: vec![0],
            neighbours: Vec::new(),
        };
        for i in 0..points {
            families.neighbours.extend(near(i));
            families.offsets.push(families.neighbours.len());
        }
        families
    }

    #[test]
    fn averages_are_taken_apart_over_points_that_flow() {
        let families = row(7);
        let volume = [1.0, 1.0, 2.0, 1.0, 1.0, 1.0, 1.0];
        let whole: Vec<f64> = (0..7)
            .map(|i| {
                let far = families.of(i).iter().map(|j| volume[*j as usize]);
                volume[i] + far.sum::<f64>()
            })
            .collect();
        let body = WholeBody {
            family_volume: &whole,
            horizon: &Horizon::Uniform(2.0),
            families: &families,
            reverse: &[],
        };
        let mut tearing = Tearing::new(0.2, &body);
        let flowing = |strain: f64, growth: f64, tension: f64| Flow {
            strain,
            growth,
            tension,
        };
        // point 4 has never flowed: its ratio does not count, its rate of zero does
        let flow = [0.0, 0.1, 0.2, 0.3, 0.0, 0.4, 0.0];
        // the bond of points 3 and 5 is broken
        let bond = |i: usize, j: u32| {
            families.offsets[i] + families.of(i).iter().position(|k| *k == j).unwrap()
        };
        let broken = [bond(3, 5), bond(5, 3)];
        let mut is_intact = vec![true; families.neighbours.len()];
        for bond in broken {
            is_intact[bond] = false;
        }
        tearing.advance(&EndOfStep {
            families: &families,
            volume: &volume,
            is_intact: &is_intact,
            flow: &|i| {
                let tension = if flow[i] > 0.0 { 1.0 + flow[i] } else { 1e300 };
                flowing(flow[i], 0.5 * flow[i], tension)
            },
            bonds: &|_, _| {},
        });
        let surface = |i: usize| whole[i] / 6.0;
        let q = (surface(1) * 1.1 + 2.0 * surface(2) * 1.2 + surface(3) * 1.3) / 4.0;
        let r = (0.1 + 2.0 * 0.2 + 0.3 + 0.0) * 0.5 / 5.0;
        let expected = q.powi(4) * r;
        let found = tearing.history()[3];
        assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        assert!(!tearing.breaks([2, 3], 0));
        tearing.restore(&[0.0, 0.0, 0.15, 0.25, 0.1, 0.0, 0.0]);
        assert!(tearing.breaks([2, 3], 0) && !tearing.breaks([3, 4], 0));
        assert!(tearing.may_break(2) && tearing.may_break(3) && !tearing.may_break(0));
    }
}
