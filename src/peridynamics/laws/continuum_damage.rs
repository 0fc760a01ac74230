//! Continuum damage mechanics of bonds.

use std::sync::Arc;

use super::{BondBased, Constants, NamedLaw, Parameter, Ratio};
use crate::{
    material::{Kinematics, LocalLaw},
    peridynamics::{
        Accelerator, BondEnergy, DeformedFamily, Departure, EnergyDensity, ForceState,
        HistoryLayout, KeptDamage, Law, LinearForceState, Linearity, Micromodulus, Parameters,
        Past, PointStress, Present, departure::DAMAGED_ELEMENTS,
    },
    tensor::{Tensor, Vector},
};

/// Names of the history variables of a bond: without weak planes its damage alone.
const HISTORY: [&str; 2] = ["damage", "micropotential"];

/// Bond-based material whose bonds lose their stiffness by a damage φ of each, from 0 to 1.
///
/// Source: [SAND2015-7998] section 6.2: energy (6.20), force (6.21), failure surface S (6.23), growth (6.26), with the micropotential `w = ½ p |ξ|² e²` of an undamaged bond:
///
/// ```text
/// T⟨ξ⟩ = (1 − φ) p |ξ|² e M ,     W = Σ (1 − φ) w V
/// S = μ • w − κ (1 + η D) ≤ 0 ,     D = Σ φ V/V₀ ,     dφ = μ V₀ dλ ≥ 0 where S = 0 and φ < 1 ,     κ = E ε₀²/(3 V₀)
/// ```
///
/// `V₀ = Σ V` is the volume of the family as it is, and `τ = 1/V₀`. All bonds count in `μ • w`, also those with φ = 1. Damage never falls. Compression counts like tension.
///
/// Uniform `μ = 1/V₀`: `φ = D`, so that the step has the closed form `φ = min(1, max(φ, (μ•w/κ − 1)/η))`, and it dissipates `V₀ κ (ΔD + η Δ(D²)/2)` whatever the path.
/// With weak planes of the normal n, `μ ∝ 1 + (g − 1) (ξ·n)²/|ξ|²`: the step is solved exactly for micropotentials that are linear over it.
#[derive(Clone, Debug)]
pub struct ContinuumDamage<const D: usize> {
    linear: BondBased<D>,
    /// `V₀ κ = E ε₀²/3` \[J/m^D\]: the energy density of the undamaged family at which damage begins.
    onset: f64,
    /// η \[1\].
    hardening: f64,
    /// g \[1\] and n, where g is not 1 and the body has more than one direction.
    weak: Option<(f64, Vector<D>)>,
}

const fn degrees(key: &'static str, about: &'static str) -> Parameter {
    Parameter {
        key,
        about,
        default: Some(0.0),
        least: -360.0,
        most: 360.0,
        usual: 25.0,
        words: &[],
    }
}

impl<const D: usize> NamedLaw<D> for ContinuumDamage<D> {
    const KEY: &'static str = "continuum-damage";
    const ABOUT: &'static str = "Bonds that act alone but for a damage that the mean energy of their family drives, with or without planes of weakness.";
    const RATIO: Ratio = Ratio::Pairwise;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter {
            key: "onset-strain",
            about: "Dilatation ε₀ of a solid at which damage begins; under any strain it begins where the undamaged family stores E ε₀²/3.",
            default: None,
            least: 1e-50,
            most: 1e50,
            usual: 0.01,
            words: &[],
        },
        Parameter {
            key: "damage-hardening",
            about: "η: the energy at which bonds are damaged through is (1 + η) times that of the onset.",
            default: None,
            least: 1e-9,
            most: 1e12,
            usual: 100.0,
            words: &[],
        },
        Parameter {
            key: "weakness",
            about: "How many times as fast bonds along the normal of the weak planes are damaged as those within the planes; 1 for none.",
            default: Some(1.0),
            least: 1.0,
            most: 1e6,
            usual: 4.0,
            words: &[],
        },
        degrees(
            "weak-normal-angle",
            "Angle of that normal from the axis x towards y, in degrees.",
        ),
        degrees(
            "weak-normal-elevation",
            "Angle of that normal out of the plane of x and y, in degrees.",
        ),
    ];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let shear = constants.shear;
        // Young's modulus of bonds that act alone
        let young = match constants.kinematics {
            Kinematics::Bar => 3.0 * shear,
            Kinematics::PlaneStress => 8.0 / 3.0 * shear,
            Kinematics::PlaneStrain | Kinematics::Solid => 2.5 * shear,
        };
        let (angle, elevation) = (values[3].to_radians(), values[4].to_radians());
        let normal = [
            elevation.cos() * angle.cos(),
            elevation.cos() * angle.sin(),
            elevation.sin(),
        ];
        let has_planes = D > 1 && values[2] != 1.0;
        Arc::new(Self {
            linear: BondBased::new(Micromodulus::InverseDistance, shear),
            onset: young * values[0] * values[0] / 3.0,
            hardening: values[1],
            weak: has_planes.then(|| (values[2], Vector::from_column_slice(&normal[..D]))),
        })
    }
}

impl<const D: usize> Law<D> for ContinuumDamage<D> {
    fn name(&self) -> &'static str {
        "continuum damage"
    }

    fn linearised(&self) -> &dyn LinearForceState<D> {
        &self.linear
    }

    fn force_state(&self) -> Option<&dyn ForceState<D>> {
        Some(self)
    }

    fn accelerator(&self) -> Option<Accelerator> {
        None
    }

    fn local_law(&self) -> Option<Arc<dyn LocalLaw<D>>> {
        None
    }

    fn linearity(&self) -> Linearity {
        Linearity::UntilDamaged
    }

    /// By `V₀ μ•w` of a continuous family. With weak planes of the normal m, and ⟨·⟩ the mean over all directions n,
    /// `⟨(n·ε·n)²⟩ = ((tr ε)² + 2 ε:ε)/(D (D+2))` and `⟨(n·m)² (n·ε·n)²⟩ = ((tr ε)² + 2 ε:ε + 4 tr ε m·ε·m + 8 m·ε²·m)/(D (D+2) (D+4))`.
    fn departure(&self, strain: &Tensor<D>, _time: f64) -> Departure {
        let energy = 0.5 * self.linear.tensor().contract(strain).dot(strain);
        let by_direction = self.weak.map_or(1.0, |(weakness, normal)| {
            let d = D as f64;
            let (trace, along) = (strain.trace(), strain * normal);
            let all = trace * trace + 2.0 * strain.norm_squared();
            let of_planes = all + 4.0 * trace * normal.dot(&along) + 8.0 * along.norm_squared();
            let shape = 1.0 + (weakness - 1.0) / d;
            (1.0 + (weakness - 1.0) * of_planes / (all * (d + 4.0))) / shape
        });
        Departure::AtStrain {
            factor: (energy * by_direction / self.onset).sqrt(),
            begins: "the energy of its bonds damages them",
            in_elements: Some(DAMAGED_ELEMENTS),
        }
    }

    /// Not at a stretch: they break by their damage.
    fn has_breakable_bonds(&self) -> bool {
        false
    }

    fn parameters(&self) -> Parameters<'_, D> {
        Parameters::Typed
    }

    fn bond_energy(&self, _horizon: f64) -> Option<BondEnergy> {
        None
    }
}

/// Micropotential `w = ½ p |ξ|² e²` of an undamaged bond, per volume of its far point.
fn micropotential<const D: usize>(family: &DeformedFamily<'_, D>, k: usize) -> f64 {
    let e = family.extension[k];
    0.5 * family.pair[k] * family.bonds[k].norm_squared() * e * e
}

impl<const D: usize> ContinuumDamage<D> {
    /// [SAND2015-7998] eq. (6.23) with S = 0: the damage D at which a family whose `V₀ μ•w` is `drive` lies on the failure surface; below 0 inside of it, 1 at most.
    fn surface(&self, drive: f64) -> f64 {
        ((drive / self.onset - 1.0) / self.hardening).min(1.0)
    }

    /// `V₀ μ•w` on the failure surface at the damage D.
    fn threshold(&self, damage: f64) -> f64 {
        self.onset * (1.0 + self.hardening * damage)
    }

    /// The damage of bonds that all count alike, `μ = τ = 1/V₀` of [SAND2015-7998] eq. (6.24); returns what it dissipates.
    fn grow_alike(&self, family: &DeformedFamily<'_, D>, present: &mut [f64]) -> f64 {
        let drive = (0..family.len()).map(|k| micropotential(family, k) * family.volumes[k]);
        let damage = self.surface(drive.sum());
        let before = present.first().copied().unwrap_or(1.0);
        if damage <= before {
            return 0.0;
        }
        present.fill(damage);
        (damage - before) * self.threshold(0.5 * (before + damage))
    }

    /// The same with weak planes, by [SAND2015-7998] eq. (6.26) over the step: `present` are φ and w of each bond, with w of the end of the step and φ of its beginning.
    fn grow_by_direction(
        &self,
        family: &DeformedFamily<'_, D>,
        weak: (f64, &Vector<D>),
        past: &[f64],
        present: &mut [f64],
    ) -> f64 {
        let volume: f64 = family.volumes.iter().sum();
        let rates = rates(family, volume, weak);
        let sum = |of: &dyn Fn(usize) -> f64| -> f64 {
            (0..family.len()).map(|k| of(k) * family.volumes[k]).sum()
        };
        let drive = sum(&|k| rates[k] * present[2 * k + 1]);
        let damage = sum(&|k| present[2 * k]) / volume;
        let goal = self.surface(drive);
        if goal <= damage {
            return 0.0;
        }
        let begins = sum(&|k| rates[k] * past[2 * k + 1]);
        let free = (0..family.len()).filter(|&k| present[2 * k] < 1.0);
        let mut growing: Vec<Growing> = free
            .map(|k| {
                let rate = rates[k] * family.volumes[k];
                Growing {
                    through: (1.0 - present[2 * k]) / rates[k],
                    rate: rate / volume,
                    power: [rate * past[2 * k + 1], rate * present[2 * k + 1]],
                }
            })
            .collect();
        growing.sort_unstable_by(|a, b| b.through.total_cmp(&a.through));
        let (lambda, dissipated) = self.follow([damage, goal], [begins, drive], growing);
        for (phi, rate) in present.iter_mut().step_by(2).zip(&rates) {
            // at D = 1 every bond is damaged through, and each that was let go of, whatever is rounded
            let is_through = goal == 1.0 || lambda >= (1.0 - *phi) / rate;
            *phi = if is_through {
                1.0
            } else {
                (*phi + lambda * rate).min(1.0)
            };
        }
        dissipated
    }

    /// Damage from where it is to where S = 0, bond after bond that is through (last first in `growing`), while `V₀ μ•w` grows evenly: λ, and what is dissipated.
    fn follow(
        &self,
        [mut damage, goal]: [f64; 2],
        [begins, ends]: [f64; 2],
        mut growing: Vec<Growing>,
    ) -> (f64, f64) {
        let (mut lambda, mut dissipated) = (0.0, 0.0);
        while let Some(through) = growing.last().map(|next| next.through) {
            let rate: f64 = growing.iter().map(|bond| bond.rate).sum();
            let power = |end: usize| growing.iter().map(|bond| bond.power[end]).sum::<f64>();
            let rest = (goal - damage) / rate;
            let advance = rest.min(through - lambda).max(0.0);
            // where on the way this happens, in the middle of it: micropotentials are linear there
            let at = self.threshold(damage + 0.5 * advance * rate) - begins;
            let share = match ends > begins {
                true => (at / (ends - begins)).clamp(0.0, 1.0),
                false => 1.0,
            };
            dissipated += advance * (power(0) * (1.0 - share) + power(1) * share);
            damage += advance * rate;
            if rest <= advance {
                lambda += advance;
                break;
            }
            lambda = through;
            growing.pop();
            while growing.last().is_some_and(|next| next.through <= lambda) {
                growing.pop();
            }
        }
        (lambda, dissipated)
    }
}

/// A bond with φ < 1.
struct Growing {
    /// λ at which φ is 1.
    through: f64,
    /// Derivative of D with respect to λ due to this bond.
    rate: f64,
    /// Derivative of the dissipated energy with respect to λ due to this bond, with w of the beginning and of the end of the step.
    power: [f64; 2],
}

/// `V₀ μ` of each bond, with `Σ μ V = 1`.
fn rates<const D: usize>(
    family: &DeformedFamily<'_, D>,
    volume: f64,
    (weakness, normal): (f64, &Vector<D>),
) -> Vec<f64> {
    let shape =
        |xi: &Vector<D>| 1.0 + (weakness - 1.0) * xi.dot(normal).powi(2) / xi.norm_squared();
    let shapes: Vec<f64> = family.bonds.iter().map(shape).collect();
    let each = shapes.iter().zip(family.volumes);
    let sum: f64 = each.map(|(shape, v)| shape * v).sum();
    shapes.iter().map(|shape| shape * volume / sum).collect()
}

impl<const D: usize> ForceState<D> for ContinuumDamage<D> {
    fn history(&self) -> HistoryLayout {
        let kept = if self.weak.is_some() { 2 } else { 1 };
        HistoryLayout {
            point: &[],
            bond: &HISTORY[..kept],
            damage: Some(KeptDamage::Bond(0)),
        }
    }

    fn respond(
        &self,
        family: &DeformedFamily<'_, D>,
        _step: f64,
        past: Past<'_>,
        present: Present<'_>,
        force: &mut [Vector<D>],
    ) -> EnergyDensity {
        let kept = self.history().bond.len();
        present.bonds.copy_from_slice(past.bonds);
        if kept == 2 {
            for k in 0..family.len() {
                present.bonds[2 * k + 1] = micropotential(family, k);
            }
        }
        let mut energy = EnergyDensity::default();
        if !family.keeps_damage {
            energy.dissipated = match &self.weak {
                None => self.grow_alike(family, present.bonds),
                Some((g, n)) => self.grow_by_direction(family, (*g, n), past.bonds, present.bonds),
            };
        }
        for (k, force) in force.iter_mut().enumerate() {
            let left = 1.0 - present.bonds[kept * k];
            let e = family.extension[k];
            let t = left * family.pair[k] * family.bonds[k].norm_squared() * e;
            *force = family.direction[k] * t;
            energy.stored += 0.5 * t * e * family.volumes[k];
        }
        energy
    }

    fn correspondence(&self, _material: Option<u16>) -> Option<PointStress<'_, D>> {
        None
    }

    fn is_objective(&self) -> bool {
        true
    }

    fn energy_ratio(&self, _s: f64) -> f64 {
        1.0
    }
}

#[cfg(test)]
#[path = "continuum_damage_tests.rs"]
mod tests;
