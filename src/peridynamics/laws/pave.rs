//! The position-aware viscoelastic solid (PAVE).

use std::sync::Arc;

use super::pave_dilatation::Dilatation;
use super::{Constants, NamedLaw, Parameter, PositionAwareSolid, Ratio, relaxing};
use crate::{
    material::{Kinematics, LocalLaw, PronySeries},
    peridynamics::{
        Accelerator, BondEnergy, CauchyStress, DeformedFamily, Departure, EnergyDensity,
        ForceState, HistoryLayout, Law, LinearForceState, Linearity, Parameters, Past, PointStress,
        Present, departure,
    },
    tensor::{Tensor, Vector},
};

/// Names of the history variables of a bond, as many as there are arms, and one.
macro_rules! of_arms {
    ($($arm:literal)*) => {
        const HISTORY: [&str; PronySeries::ARMS + 1] = [
            "deviatoric extension",
            $(concat!("extension of the spring in arm ", $arm),)*
        ];
    };
}
of_arms!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16);

/// The keys of all arms behind that of [`PositionAwareSolid`].
const fn parameters(first: Parameter) -> [Parameter; 1 + relaxing::NUMBERS] {
    let mut all = [first; 1 + relaxing::NUMBERS];
    let mut k = 0;
    while k < relaxing::NUMBERS {
        all[k + 1] = relaxing::PARAMETERS[k];
        k += 1;
    }
    all
}

/// [`PositionAwareSolid`] whose deviatoric response relaxes, by Maxwell arms beside a spring.
///
/// Source: [SAND2015-7998] eq. (4.12), (4.13), (4.14), (4.15), with `q_i = ε − ε^i` the extension of the spring in arm `i` and `μ_i = λ_i μ`.
/// As printed, the right-hand side of (4.13) lacks the factor `1/τ_i`:
///
/// ```text
/// T⟨ξ⟩ = [ (κ θ − 1/D Σ t |ξ| V) ω |ξ| + t ] M ,     t = 2 μ σ [(1 − Σ λ_i) ε + Σ λ_i q_i] ,     q̇_i = ε̇ − q_i/τ_i
/// ```
///
/// `q_i` is updated exactly for an ε that is linear over the step. At once the law is [`PositionAwareSolid`].
/// Differs from the source by: plates and long bodies, where the strain out of the body is part of the deviator of the solid, so that the stress that goes with θ relaxes too (`pave_dilatation.rs`).
///
/// Finite elements of the material follow [`crate::material::GeneralisedMaxwell`], which has the same stress under a uniform strain.
#[derive(Clone, Debug)]
pub struct PositionAwareViscoelasticSolid<const D: usize> {
    linear: PositionAwareSolid<D>,
    series: PronySeries,
    dilatation: Dilatation,
    local: Arc<dyn LocalLaw<D>>,
}

impl<const D: usize> NamedLaw<D> for PositionAwareViscoelasticSolid<D> {
    const KEY: &'static str = "pave";
    const ABOUT: &'static str = "Position-aware viscoelastic solid: `pals` whose shear modulus relaxes by up to 16 Maxwell arms; the constants are those at once.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = <PositionAwareSolid<D> as NamedLaw<D>>::KINEMATICS;
    const PARAMETERS: &'static [Parameter] =
        &parameters(<PositionAwareSolid<D> as NamedLaw<D>>::PARAMETERS[0]);

    fn conflict(values: &[f64]) -> Option<(&'static str, String)> {
        relaxing::conflict(&values[1..])
    }

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let series = relaxing::series(&values[1..]);
        Arc::new(Self::new(constants, values[0], series))
    }
}

impl<const D: usize> PositionAwareViscoelasticSolid<D> {
    /// A solid of these constants at once, by the place of its word among `calibration-fields`.
    fn new(constants: Constants, fields: f64, series: PronySeries) -> Self {
        let linear = PositionAwareSolid::of(constants, fields);
        Self {
            dilatation: Dilatation::new(&constants, linear.bulk()),
            linear,
            local: relaxing::local(&constants, series.clone()),
            series,
        }
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

    fn accelerator(&self) -> Option<Accelerator> {
        None
    }

    fn local_law(&self) -> Option<Arc<dyn LocalLaw<D>>> {
        Some(Arc::clone(&self.local))
    }

    fn linearity(&self) -> Linearity {
        Linearity::AtRest
    }

    fn departure(&self, strain: &Tensor<D>, time: f64) -> Departure {
        departure::of_local_law(&*self.local, strain, time)
    }

    fn has_breakable_bonds(&self) -> bool {
        true
    }

    fn parameters(&self) -> Parameters<'_, D> {
        Parameters::Typed
    }

    fn bond_energy(&self, horizon: f64) -> Option<BondEnergy> {
        self.linear.bond_energy(horizon)
    }
}

impl<const D: usize> ForceState<D> for PositionAwareViscoelasticSolid<D> {
    fn history(&self) -> HistoryLayout {
        HistoryLayout {
            point: self.dilatation.history(&self.series),
            bond: &HISTORY[..self.series.remembered()],
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
        let series = self.series.over(step);
        let (mean_stress, mut energy) =
            (self.dilatation).respond(theta, &series, past.point, present.point);
        let mut product = 0.0;
        let kept = self.series.remembered();
        let bonds = past.bonds.chunks_exact(kept);
        let bonds = bonds.zip(present.bonds.chunks_exact_mut(kept));
        for (k, ((past, present), force)) in bonds.zip(force.iter_mut()).enumerate() {
            let r = family.bonds[k].norm();
            let epsilon = family.extension[k] - theta * r / d;
            let found = series.follow(epsilon, |i| past[i], |i, x| present[i] = x);
            // 2 μ σ = p |ξ|²
            let modulus = family.pair[k] * r * r;
            let volume = family.volumes[k];
            let t = modulus * found.strain;
            energy.stored += modulus * found.stored * volume;
            energy.dissipated += modulus * found.dissipated * volume;
            product += t * r * volume;
            *force = family.direction[k] * t;
        }
        let pressure = mean_stress - product / d;
        for (k, force) in force.iter_mut().enumerate() {
            let through = pressure * family.omega[k] * family.bonds[k].norm();
            *force += family.direction[k] * through;
        }
        energy
    }

    /// The virial, and across a long body what its elastic volume leaves of the trace.
    fn stress(
        &self,
        family: &DeformedFamily<'_, D>,
        _past: Past<'_>,
        force: &[Vector<D>],
    ) -> CauchyStress<D> {
        let tensor = family.virial_stress(force);
        let theta = PositionAwareSolid::dilatation(family);
        let trace = self.dilatation.stress_trace(theta);
        CauchyStress {
            tensor,
            across: trace.map(|trace| trace / family.volume_ratio() - tensor.trace()),
        }
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
mod tests {
    use super::*;
    use crate::peridynamics::Influence;

    #[test]
    fn without_a_share_it_is_the_linear_solid() {
        let constants = Constants {
            lambda: 1.7,
            shear: 1.3,
            influence: Influence::Gaussian,
            micromodulus: crate::peridynamics::Micromodulus::InverseDistance,
            kinematics: Kinematics::Solid,
            density: 1.0,
            is_heated: false,
        };
        let linear = PositionAwareSolid::<3>::of(constants, 0.0);
        let series = PronySeries::new(vec![(0.0, 0.7)]);
        let relaxing = PositionAwareViscoelasticSolid::<3>::new(constants, 0.0, series);
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
            kinematics: crate::peridynamics::bond_force::BondKinematics::Exact,
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
        let (found, spent) = respond(&relaxing, 18);
        // products are rounded in another order
        let largest = force.iter().fold(0.0f64, |m, f| m.max(f.amax()));
        for (found, force) in found.iter().zip(&force) {
            assert!((found - force).amax() < 1e-15 * largest);
        }
        assert!((spent.stored / energy.stored - 1.0).abs() < 1e-15);
        assert!(energy.stored > 0.0 && spent.dissipated == 0.0);
    }
}
