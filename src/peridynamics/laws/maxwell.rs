//! A bond of a spring beside a Maxwell arm: viscoelastic, with one relaxation time.

use std::sync::Arc;

use super::{BondBased, Constants, NamedLaw, Parameter, Ratio};
use crate::{
    material::Kinematics,
    peridynamics::{
        BondEnergy, DeformedFamily, EnergyDensity, ForceState, HistoryLayout, Law,
        LinearForceState, Micromodulus, Past, Present,
    },
    tensor::Vector,
};

/// Standard linear solid, bond by bond: `T = ½ c [(1 − g) s + g q] M`, `q̇ = ṡ − q/τ`.
///
/// Source: [SAND2015-7998] section 4.3 has one arm of it at work in an LPS; here it is the whole force of a bond. At once it is the bond-based material with Young's modulus E, in the end with `(1 − g) E`.
/// `q` is updated exactly for a stretch that is linear over the step.
#[derive(Clone, Debug)]
pub struct Maxwell<const D: usize> {
    linear: BondBased<D>,
    /// The share g of the arm.
    share: f64,
    /// τ \[s\].
    time: f64,
}

impl<const D: usize> NamedLaw<D> for Maxwell<D> {
    const KEY: &'static str = "viscoelastic-bond";
    const ABOUT: &'static str = "Bonds that act alone, each a spring beside one Maxwell arm; the constants are those at once.";
    const RATIO: Ratio = Ratio::Pairwise;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter {
            key: "relaxing-share",
            about: "Part g of the stiffness that relaxes: in the end (1 − g) of it is left.",
            default: None,
            least: 0.0,
            most: 1.0,
            usual: 0.4,
            words: &[],
        },
        Parameter {
            key: "relaxation-time",
            about: "Relaxation time τ of that part.",
            default: None,
            least: 1e-100,
            most: 1e100,
            usual: 0.7,
            words: &[],
        },
    ];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        Arc::new(Self {
            linear: BondBased::new(Micromodulus::InverseDistance, constants.shear),
            share: values[0],
            time: values[1],
        })
    }
}

impl<const D: usize> Law<D> for Maxwell<D> {
    fn name(&self) -> &'static str {
        "viscoelastic bond"
    }

    fn linearised(&self) -> &dyn LinearForceState<D> {
        &self.linear
    }

    fn force_state(&self) -> Option<&dyn ForceState<D>> {
        Some(self)
    }

    fn has_breakable_bonds(&self) -> bool {
        true
    }

    fn bond_energy(&self, horizon: f64) -> Option<BondEnergy> {
        self.linear.bond_energy(horizon)
    }
}

/// A Maxwell arm over a step: its spring's extension `q̇ = ė − q/τ` for an extension e that is linear in time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arm {
    /// `e^−x`, with x the length of the step over τ.
    decay: f64,
    /// The mean of `e^−xθ`, θ from 0 to 1: what of the growth of e is left in q at the end.
    driven: f64,
    /// The mean of what is left at θ.
    rise: f64,
}

impl Arm {
    /// The arm of the relaxation time `time` over a step of the length `step` \[s\].
    pub(super) fn over(step: f64, time: f64) -> Self {
        let x = step / time;
        Self {
            decay: (-x).exp(),
            driven: mean_decay(x),
            rise: mean_rise(x),
        }
    }

    /// q at the end of a step in which e grows by `growth`, from q `before`; and what is dissipated by a unit stiffness: the work `growth · (mean of q)` less what the spring stores.
    pub(super) fn follow(self, before: f64, growth: f64) -> (f64, f64) {
        let q = self.decay * before + self.driven * growth;
        let mean = self.driven * before + self.rise * growth;
        (q, growth * mean - 0.5 * (q * q - before * before))
    }
}

/// `(1 − e^−x)/x`, `1` at zero.
fn mean_decay(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x }
}

/// `∫₀¹ (1 − e^−xθ)/x dθ = (1 − (1 − e^−x)/x)/x`, `1/2` at zero.
fn mean_rise(x: f64) -> f64 {
    // below this the difference loses what the series leaves out
    const SERIES: f64 = 1e-3;
    if x < SERIES {
        0.5 - x / 6.0 + x * x / 24.0
    } else {
        (1.0 - mean_decay(x)) / x
    }
}

impl<const D: usize> ForceState<D> for Maxwell<D> {
    fn history(&self) -> HistoryLayout {
        HistoryLayout {
            point: &[],
            bond: &["stretch", "stretch of the spring in the arm"],
            damage: None,
        }
    }

    fn respond(
        &self,
        family: &DeformedFamily<'_, D>,
        step: f64,
        past: Past<'_>,
        present: Present<'_>,
        force: &mut [Vector<D>],
    ) -> EnergyDensity {
        let arm = Arm::over(step, self.time);
        let mut energy = EnergyDensity::default();
        let bonds = past
            .bonds
            .chunks_exact(2)
            .zip(present.bonds.chunks_exact_mut(2));
        for (k, (past, present)) in bonds.enumerate() {
            let r = family.bonds[k].norm();
            let s = family.extension[k] / r;
            let (q, spent) = arm.follow(past[1], s - past[0]);
            present.copy_from_slice(&[s, q]);
            // p r³ = c/2 per bond and volume
            let half = family.pair[k] * r * r * r;
            force[k] = family.direction[k] * (half * ((1.0 - self.share) * s + self.share * q));
            let weight = half * r * family.volumes[k];
            energy.stored += 0.5 * weight * ((1.0 - self.share) * s * s + self.share * q * q);
            energy.dissipated += weight * self.share * spent;
        }
        energy
    }

    fn is_objective(&self) -> bool {
        true
    }

    fn energy_ratio(&self, _s: f64) -> f64 {
        1.0
    }
}
