//! The position-aware viscoelastic solid (PAVE).

use std::sync::Arc;

use super::maxwell::Arm;
use super::{Constants, NamedLaw, Parameter, PositionAwareSolid, Ratio};
use crate::{
    material::Kinematics,
    peridynamics::{
        BondEnergy, DeformedFamily, EnergyDensity, ForceState, HistoryLayout, Law,
        LinearForceState, Past, Present,
    },
    tensor::Vector,
};

/// Most Maxwell arms: a Prony series has one to three for each decade of time.
const ARMS: usize = 16;

/// What a bond remembers, as much as there are arms, and one; and the keys of the arms after the first.
macro_rules! of_arms {
    ($($arm:literal)*) => {
        const HISTORY: [&str; ARMS + 1] = [
            "deviatoric extension",
            "extension of the spring in arm 1",
            $(concat!("extension of the spring in arm ", $arm),)*
        ];

        const MORE_ARMS: [Parameter; 2 * (ARMS - 1)] = [
            $(
                share(
                    concat!("relaxing-share-", $arm),
                    concat!("The same of arm ", $arm, "."),
                    Some(0.0),
                ),
                time(
                    concat!("relaxation-time-", $arm),
                    concat!("The relaxation time of arm ", $arm, "."),
                    Some(1.0),
                ),
            )*
        ];
    };
}
of_arms!(2 3 4 5 6 7 8 9 10 11 12 13 14 15 16);

/// The keys of all arms behind those of [`PositionAwareSolid`].
const fn parameters(first: Parameter) -> [Parameter; 2 * ARMS + 1] {
    let mut all = [first; 2 * ARMS + 1];
    all[1] = share(
        "relaxing-share",
        "Part λ of the shear modulus that relaxes in the first arm.",
        None,
    );
    all[2] = time("relaxation-time", "Relaxation time τ of that arm.", None);
    let mut k = 0;
    while k < MORE_ARMS.len() {
        all[k + 3] = MORE_ARMS[k];
        k += 1;
    }
    all
}

/// [`PositionAwareSolid`] whose deviatoric response relaxes, by Maxwell arms beside a spring.
///
/// Source: [SAND2015-7998] eq. (4.12)–(4.15), with `q_i = ε − ε^i` the extension of the spring in arm `i` and `μ_i = λ_i μ`:
///
/// ```text
/// T⟨ξ⟩ = [ (κ θ − 1/D Σ t |ξ| V) ω |ξ| + t ] M ,     t = 2 μ σ [(1 − Σ λ_i) ε + Σ λ_i q_i] ,     q̇_i = ε̇ − q_i/τ_i
/// ```
///
/// `q_i` is updated exactly for an ε that is linear over the step. At once the law is [`PositionAwareSolid`].
#[derive(Clone, Debug)]
pub struct PositionAwareViscoelasticSolid<const D: usize> {
    linear: PositionAwareSolid<D>,
    /// λ and τ of each arm.
    arms: Vec<(f64, f64)>,
    /// `1 − Σ λ_i`.
    lasting: f64,
}

const fn share(key: &'static str, about: &'static str, default: Option<f64>) -> Parameter {
    Parameter {
        key,
        about,
        default,
        least: 0.0,
        most: 1.0,
        usual: 0.2,
        words: &[],
    }
}

const fn time(key: &'static str, about: &'static str, default: Option<f64>) -> Parameter {
    Parameter {
        key,
        about,
        default,
        least: 1e-100,
        most: 1e100,
        usual: 0.7,
        words: &[],
    }
}

impl<const D: usize> NamedLaw<D> for PositionAwareViscoelasticSolid<D> {
    const KEY: &'static str = "pave";
    const ABOUT: &'static str = "Position-aware viscoelastic solid: `pals` whose shear modulus relaxes by up to 16 Maxwell arms; the constants are those at once.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = <PositionAwareSolid<D> as NamedLaw<D>>::KINEMATICS;
    const PARAMETERS: &'static [Parameter] =
        &parameters(<PositionAwareSolid<D> as NamedLaw<D>>::PARAMETERS[0]);

    fn conflict(values: &[f64]) -> Option<(&'static str, String)> {
        let shares: f64 = values[1..].iter().step_by(2).sum();
        (shares > 1.0).then(|| {
            (
                "relaxing-share",
                format!("the shares of all arms add up to {shares}, and may come to 1 at most: they are parts of one shear modulus"),
            )
        })
    }

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let typed = values[1..].chunks_exact(2).map(|arm| (arm[0], arm[1]));
        // the first arm is there even if it has no share
        let arms = typed
            .enumerate()
            .filter(|(k, arm)| *k == 0 || arm.0 > 0.0)
            .map(|(_, arm)| arm)
            .collect();
        Arc::new(Self::new(
            PositionAwareSolid::of(constants, values[0]),
            arms,
        ))
    }
}

impl<const D: usize> PositionAwareViscoelasticSolid<D> {
    /// A solid that is `linear` at once, with at most [`ARMS`] arms of a share λ \[1\] and a relaxation time τ \[s\].
    fn new(linear: PositionAwareSolid<D>, arms: Vec<(f64, f64)>) -> Self {
        let lasting = 1.0 - arms.iter().map(|(share, _)| share).sum::<f64>();
        Self {
            linear,
            arms,
            lasting,
        }
    }

    /// `(1 − Σ λ_i) ε + Σ λ_i q_i` of what a bond remembers.
    fn carried(&self, bond: &[f64]) -> f64 {
        let arms = self.arms.iter().zip(&bond[1..]);
        arms.fold(self.lasting * bond[0], |sum, ((share, _), q)| {
            sum + share * q
        })
    }
}

impl<const D: usize> Law<D> for PositionAwareViscoelasticSolid<D> {
    fn name(&self) -> &'static str {
        "position-aware viscoelastic solid"
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

impl<const D: usize> ForceState<D> for PositionAwareViscoelasticSolid<D> {
    fn history(&self) -> HistoryLayout {
        HistoryLayout {
            point: &[],
            bond: &HISTORY[..=self.arms.len()],
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
        let d = D as f64;
        let theta = PositionAwareSolid::dilatation(family);
        let kept = 1 + self.arms.len();
        let mut energy = EnergyDensity {
            stored: 0.5 * self.linear.bulk() * theta * theta,
            dissipated: 0.0,
        };
        let mut product = 0.0;
        let mut arms = [(0.0, Arm::over(0.0, 1.0)); ARMS];
        for (arm, (share, time)) in arms.iter_mut().zip(&self.arms) {
            *arm = (*share, Arm::over(step, *time));
        }
        let bonds = past.bonds.chunks_exact(kept);
        let bonds = bonds.zip(present.bonds.chunks_exact_mut(kept));
        for (k, (past, present)) in bonds.enumerate() {
            let r = family.bonds[k].norm();
            let epsilon = family.extension[k] - theta * r / d;
            let growth = epsilon - past[0];
            // 2 μ σ = p |ξ|²
            let modulus = family.pair[k] * r * r;
            let volume = family.volumes[k];
            energy.stored += 0.5 * (modulus * (self.lasting * epsilon)) * epsilon * volume;
            present[0] = epsilon;
            for (i, (share, arm)) in arms[..self.arms.len()].iter().enumerate() {
                let (q, spent) = arm.follow(past[1 + i], growth);
                present[1 + i] = q;
                energy.stored += 0.5 * modulus * share * q * q * volume;
                energy.dissipated += modulus * share * spent * volume;
            }
            product += modulus * self.carried(present) * r * volume;
        }
        let pressure = self.linear.bulk() * theta - product / d;
        let bonds = present.bonds.chunks_exact(kept);
        for (k, (force, present)) in force.iter_mut().zip(bonds).enumerate() {
            let r = family.bonds[k].norm();
            let t = family.pair[k] * r * r * self.carried(present);
            *force = family.direction[k] * (pressure * family.omega[k] * r + t);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peridynamics::Influence;

    #[test]
    fn without_a_share_it_has_the_bits_of_the_linear_solid() {
        let constants = Constants {
            lambda: 1.7,
            shear: 1.3,
            influence: Influence::Gaussian,
            kinematics: Kinematics::Solid,
            density: 1.0,
        };
        let linear = PositionAwareSolid::<3>::of(constants, 0.0);
        let relaxing = PositionAwareViscoelasticSolid::new(linear.clone(), vec![(0.0, 0.7)]);
        let number = |k: usize, j: usize| ((7 * k + 3 * j + 1) as f64).sin();
        let bonds: Vec<Vector<3>> = (0..9)
            .map(|k| Vector::from_fn(|j, _| number(k, j)))
            .collect();
        let list = |j: usize| -> Vec<f64> { (0..9).map(|k| 0.2 + number(k, j).abs()).collect() };
        let (volumes, pair, omega) = (list(4), list(5), list(6));
        let extension: Vec<f64> = (0..9).map(|k| 0.1 * number(k, 7)).collect();
        let direction: Vec<Vector<3>> = bonds.iter().map(|xi| xi.normalize()).collect();
        let family = DeformedFamily {
            bonds: &bonds,
            volumes: &volumes,
            pair: &pair,
            omega: &omega,
            state: None,
            difference: &bonds,
            extension: &extension,
            direction: &direction,
            is_whole: true,
            damage: 0.0,
            carried: None,
            keeps_damage: false,
            material: 0,
            kinematics: crate::peridynamics::bond_force::Kinematics::Exact,
        };
        let respond = |law: &dyn ForceState<3>, numbers: usize| {
            let past = vec![0.0; numbers];
            let (mut present, mut force) = (past.clone(), vec![Vector::<3>::zeros(); 9]);
            let past = Past {
                point: &[],
                bonds: &past,
            };
            let present = Present {
                point: &mut [],
                bonds: &mut present,
                principal_stress: None,
            };
            let energy = law.respond(&family, 0.3, past, present, &mut force);
            (force, energy)
        };
        let (force, energy) = respond(&linear, 0);
        assert_eq!(respond(&relaxing, 18), (force, energy));
        assert!(energy.stored > 0.0);
    }
}
