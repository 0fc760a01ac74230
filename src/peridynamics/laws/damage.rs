//! Correspondence whose classical stress is that of scalar damage.

use std::sync::Arc;

use super::{
    Constants, LocalCorrespondence, NamedLaw, Parameter, Ratio, correspondence::STABILISATION,
};
use crate::{
    material::{EquivalentStrain, Kinematics, ScalarDamage, ScalarDamageSettings, SofteningCurve},
    peridynamics::Law,
};

/// [`LocalCorrespondence`] with the stress of [`ScalarDamage`].
///
/// Source: [SAND2015-7998] section 6.2.6: `W(Y, φ) = W_local(F̄, D)`, `D = τ • φ`, `T⟨ξ⟩ = ω σ(F̄, D) K⁻¹ ξ` (6.32), with `W_local = (1 − D) ψ₀` and `S_local = 0` the curve `D(κ)`.
/// With `τ = 1/V` the damage of the bonds of a family is uniform, `φ⟨ξ⟩ = D`, so that the point's D is all that is remembered.
#[derive(Clone, Copy, Debug)]
pub struct DamageCorrespondence<const D: usize>;

impl<const D: usize> NamedLaw<D> for DamageCorrespondence<D> {
    const KEY: &'static str = "damage-correspondence";
    const ABOUT: &'static str = "Isotropic scalar damage with a tensile strength and a fracture energy, within crack bands: that of its cell in a finite element, that of the lattice at points.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter {
            key: "tensile-strength",
            about: "Largest stress in uniaxial tension.",
            default: None,
            least: 1e-100,
            most: 1e100,
            usual: 0.1,
            words: &[],
        },
        Parameter {
            key: "fracture-energy",
            about: "Energy per area that a crack takes until it is open.",
            default: None,
            least: 1e-100,
            most: 1e100,
            usual: 0.01,
            words: &[],
        },
        Parameter::words(
            "softening",
            "How the stress falls with the strain beyond the strength: exponentially, or along a line.",
            &["exponential", "linear"],
        ),
        Parameter::words(
            "equivalent-strain",
            "The measure of the strain that damages: extensions alone (\"mazars\"), or the energy of the undamaged material, in compression too.",
            &["mazars", "energy"],
        ),
        STABILISATION,
        LocalCorrespondence::<D>::CONTROL,
    ];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let solid = ScalarDamage::new(ScalarDamageSettings {
            lambda: constants.solid_lambda(),
            shear: constants.shear,
            strength: values[0],
            energy: values[1],
            curve: match values[2] == 1.0 {
                true => SofteningCurve::Linear,
                false => SofteningCurve::Exponential,
            },
            measure: match values[3] == 1.0 {
                true => EquivalentStrain::Energy,
                false => EquivalentStrain::Mazars,
            },
        });
        let local = constants.local(Arc::new(solid));
        let linear = constants.correspondence(values[4], values[5]);
        Arc::new(LocalCorrespondence::new(
            "damage correspondence",
            linear,
            local,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        peridynamics::{
            DeformedFamily, EnergyDensity, Family, Influence, Past, Present, StatePart, bond_force,
            softening::RegularFamily,
        },
        tensor::{Tensor, Vector, strain},
    };

    const LAMBDA: f64 = 1.7;
    const SHEAR: f64 = 1.3;
    const STRENGTH: f64 = 0.1;
    const ENERGY: f64 = 0.01;
    const HORIZON: f64 = 1.1;

    /// A family without any symmetry, in the material of these constants without a zero-energy control.
    struct Case {
        law: Arc<dyn Law<3>>,
        bonds: Vec<Vector<3>>,
        volumes: Vec<f64>,
        omega: Vec<f64>,
        state: StatePart<3>,
    }

    fn case() -> Case {
        let constants = Constants {
            lambda: LAMBDA,
            shear: SHEAR,
            influence: Influence::Gaussian,
            micromodulus: crate::peridynamics::Micromodulus::InverseDistance,
            kinematics: Kinematics::Solid,
            density: 1.0,
            is_heated: false,
        };
        let law =
            DamageCorrespondence::<3>::build(constants, &[STRENGTH, ENERGY, 0.0, 1.0, 0.0, 0.0]);
        let number = |k: usize, j: usize| ((7 * k * k + 3 * j + 5 * k * j + 1) as f64).sin();
        let bonds: Vec<Vector<3>> = (0..14)
            .map(|k| Vector::from_fn(|j, _| 0.6 * number(k, j)))
            .collect();
        let volumes: Vec<f64> = (0..14).map(|k| 0.2 + number(k, 4).abs()).collect();
        let along: Vec<_> = bonds.iter().map(|xi| (*xi, 1.0)).collect();
        let lattice = RegularFamily {
            bonds: &along,
            plane_energy: 1.0,
            horizon: HORIZON,
        };
        let law = law.calibrate().unwrap().to_lattice(&lattice).unwrap();
        let (mut pair, mut omega) = (vec![0.0; 14], vec![0.0; 14]);
        let family = Family {
            bonds: &bonds,
            volumes: &volumes,
            factors: &[1.0; 14],
            horizon: HORIZON,
            bond_horizons: &[],
            materials: None,
        };
        let state = law
            .linearised()
            .coefficients(&family, &mut pair, &mut omega);
        Case {
            law,
            bonds,
            volumes,
            omega,
            state: state.unwrap().unwrap(),
        }
    }

    impl Case {
        /// The band of the calibration: twice the farthest layer.
        fn band(&self) -> f64 {
            let along = self.bonds.iter().map(|xi| xi[0].abs());
            2.0 * along.fold(0.0, f64::max)
        }

        /// Force state, energies and history after a step from `past` to the differences of displacement `eta`.
        fn respond(
            &self,
            eta: &[Vector<3>],
            past: &[f64],
        ) -> (Vec<Vector<3>>, EnergyDensity, Vec<f64>) {
            let count = self.bonds.len();
            let (mut present, mut force) = (past.to_vec(), vec![Vector::zeros(); count]);
            let direction: Vec<Vector<3>> = self.bonds.iter().map(|xi| xi.normalize()).collect();
            let family = DeformedFamily {
                bonds: &self.bonds,
                volumes: &self.volumes,
                pair: &vec![0.0; count],
                omega: &self.omega,
                state: Some(&self.state),
                difference: eta,
                extension: &vec![0.0; count],
                direction: &direction,
                is_whole: true,
                damage: 0.0,
                carried: None,
                keeps_damage: false,
                material: 0,
                kinematics: bond_force::BondKinematics::Linear,
            };
            let past = Past {
                point: past,
                bonds: &[],
            };
            let out = Present {
                point: &mut present,
                bonds: &mut [],
                principal_stress: None,
            };
            let states = self.law.force_state().unwrap();
            let energy = states.respond(&family, 1.0, past, out, &mut force);
            (force, energy, present)
        }

        /// `ψ₀(F̄)` of (6.30), in matrices of its own.
        fn undamaged(&self, eta: &[Vector<3>]) -> f64 {
            let (mut sum, mut shape) = (Tensor::<3>::zeros(), Tensor::<3>::zeros());
            for (k, xi) in self.bonds.iter().enumerate() {
                let weight = self.omega[k] * self.volumes[k];
                sum += (xi + eta[k]) * xi.transpose() * weight;
                shape += xi * xi.transpose() * weight;
            }
            let e = strain(&(sum * shape.try_inverse().unwrap() - Tensor::identity()));
            0.5 * LAMBDA * e.trace().powi(2) + SHEAR * e.norm_squared()
        }
    }

    /// `∫ Z dD` of the exponential curve up to κ by the midpoint rule, with `Z = ½ E κ²`.
    fn spent(young: f64, onset: f64, kappa: f64, decay: f64) -> f64 {
        let steps = 20_000;
        let curve = |k: f64| 1.0 - onset / k * (-(k - onset) / decay).exp();
        let part = |s: i32| {
            let at = |part: f64| onset + (kappa - onset) * (f64::from(s) + part) / f64::from(steps);
            0.5 * young * at(0.5).powi(2) * (curve(at(1.0)) - curve(at(0.0)))
        };
        (0..steps).map(part).sum()
    }

    #[test]
    fn it_is_the_classical_damage_model_of_section_6_2_6() {
        let case = case();
        let eta: Vec<Vector<3>> = (case.bonds.iter().enumerate())
            .map(|(k, xi)| {
                let turned =
                    Vector::<3>::new(0.08 * xi[0] + 0.02 * xi[1], -0.03 * xi[2], 0.05 * xi[0]);
                turned + Vector::from_fn(|j, _| 4e-3 * ((5 * k + j) as f64).cos())
            })
            .collect();
        let (force, energy, history) = case.respond(&eta, &[0.0; 4]);
        let volume: f64 = case.volumes.iter().sum();
        let tau = 1.0 / volume;
        let damage = history[0];
        assert!(damage > 0.2 && damage < 0.95, "{damage}");

        // (6.28) with τ = 1/V and the damage state φ⟨ξ⟩ = D, (6.29): W(Y, φ) = W_local(F̄, τ • φ)
        let peridynamic = |eta: &[Vector<3>], phi: &[f64]| {
            let d: f64 = phi
                .iter()
                .zip(&case.volumes)
                .map(|(phi, v)| tau * phi * v)
                .sum();
            (1.0 - d) * case.undamaged(eta)
        };
        let phi = vec![damage; case.bonds.len()];
        let stored = peridynamic(&eta, &phi);
        assert!((energy.stored - stored).abs() < 1e-12 * stored);

        // (6.32): T⟨ξ⟩ is the Fréchet derivative of W by Y, with the damage held
        let largest = force.iter().fold(0.0f64, |m, f| m.max(f.amax()));
        for k in 0..case.bonds.len() {
            for a in 0..3 {
                let moved = |by: f64| {
                    let mut eta = eta.clone();
                    eta[k][a] += by;
                    peridynamic(&eta, &phi)
                };
                let slope = (moved(1e-5) - moved(-1e-5)) / (2e-5 * case.volumes[k]);
                assert!((slope - force[k][a]).abs() < 1e-8 * largest, "{k} {a}");
            }
        }

        // (6.16), (6.27), (6.31): z = −W_φ = Z τ, and Z = z • 1 is the energy of the undamaged material
        let z = |k: usize| {
            let moved = |by: f64| {
                let mut phi = phi.clone();
                phi[k] += by;
                peridynamic(&eta, &phi)
            };
            -(moved(1e-3) - moved(-1e-3)) / (2e-3 * case.volumes[k])
        };
        let force_of_damage = case.undamaged(&eta);
        for k in 0..case.bonds.len() {
            assert!((z(k) - force_of_damage * tau).abs() < 1e-9 * force_of_damage);
        }
        let sum: f64 = (0..case.bonds.len()).map(|k| z(k) * case.volumes[k]).sum();
        assert!((sum - force_of_damage).abs() < 1e-9 * force_of_damage);

        // the failure surface S_local(Z, D) = D(√(2 Z/E)) − D = 0, by the formula of the exponential curve
        let young = SHEAR * (3.0 * LAMBDA + 2.0 * SHEAR) / (LAMBDA + SHEAR);
        let (onset, kappa) = (STRENGTH / young, (2.0 * force_of_damage / young).sqrt());
        let decay = ENERGY / (case.band() * STRENGTH) - 0.5 * onset;
        let expected = 1.0 - onset / kappa * (-(kappa - onset) / decay).exp();
        assert!((damage - expected).abs() < 2e-6, "{damage} {expected}");
        // (6.13): what is dissipated is ∫ z • dφ = ∫ Z dD > 0
        let spent = spent(young, onset, kappa, decay);
        let off = energy.dissipated / spent - 1.0;
        assert!(off.abs() < 1e-5, "{} {spent}", energy.dissipated);
        // inside of the surface nothing is damaged further
        let back: Vec<Vector<3>> = eta.iter().map(|eta| eta * 0.9).collect();
        let (_, energy, unloaded) = case.respond(&back, &history);
        assert_eq!((energy.dissipated, unloaded[0]), (0.0, damage));
    }

    #[test]
    fn a_horizon_whose_band_would_snap_back_is_refused() {
        let law = case().law;
        let bonds = [(Vector::<3>::new(4.0, 0.0, 0.0), 1.0)];
        let lattice = RegularFamily {
            bonds: &bonds,
            plane_energy: 1.0,
            horizon: 4.0,
        };
        let why = law.calibrate().unwrap().to_lattice(&lattice);
        let why = why.unwrap_err().to_string();
        // 2 E G/f² = 6.673, the band 8
        assert!(why.contains("below 3.33"), "{why}");
    }
}
