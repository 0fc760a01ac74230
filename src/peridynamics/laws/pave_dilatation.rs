//! Dilatational response of a position-aware viscoelastic solid.

use super::Constants;
use crate::{
    material::{Kinematics, PronySeries, PronyStep},
    peridynamics::EnergyDensity,
};

/// Names of the history variables of a point of a plate or a long body, as many as there are arms, and one.
macro_rules! of_arms {
    ($($arm:literal)*) => {
        const HISTORY: [&str; PronySeries::ARMS + 1] = [
            "deviatoric strain across",
            $(concat!("deviatoric strain across of the spring in arm ", $arm),)*
        ];
    };
}
of_arms!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16);

/// The mean stress of a body by its dilatation θ, where the shear modulus of its solid relaxes.
///
/// In a solid it is `κ θ`, elastic. In two dimensions θ is a growth of area: with the strain `ε_z` out of the body the deviator of the solid has the part `z = (2 ε_z − θ)/3` across and `−z/2` in each direction of the plane, and with `μ*` the series of the shear modulus
///
/// ```text
/// σ_m = K (θ + ε_z) − μ* z ,     σ_z = K (θ + ε_z) + 2 μ* z ,     W = ½ K (θ + ε_z)² + 3/2 μ* z²
/// ```
///
/// where `ε_z = 0` in plane strain and `σ_z = 0` in plane stress. At once `σ_m` is `κ θ` with κ of two dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Dilatation {
    /// Elastic, with κ \[Pa\].
    Solid { bulk: f64 },
    /// Of a body in two dimensions, with K and μ of its solid \[Pa\].
    Plane {
        bulk: f64,
        shear: f64,
        /// True in plane stress: no stress acts across.
        is_free: bool,
    },
}

impl Dilatation {
    /// Of a body of these constants, whose κ is `bulk` \[Pa\].
    pub fn new(constants: &Constants, bulk: f64) -> Self {
        let shear = constants.shear;
        match constants.kinematics {
            Kinematics::PlaneStress | Kinematics::PlaneStrain => Self::Plane {
                bulk: constants.solid_lambda() + 2.0 / 3.0 * shear,
                shear,
                is_free: constants.kinematics == Kinematics::PlaneStress,
            },
            // the law is not offered for bars, whose bonds have no deviator
            Kinematics::Solid | Kinematics::Bar => Self::Solid { bulk },
        }
    }

    /// The names of the history variables of a point.
    pub fn history(&self, series: &PronySeries) -> &'static [&'static str] {
        match self {
            Self::Solid { .. } => &[],
            Self::Plane { .. } => &HISTORY[..series.remembered()],
        }
    }

    /// `σ_m + σ_m + σ_z = 3 K θ` of a long body at the dilatation θ \[Pa\], by which its volume resists whatever has relaxed; none of another body.
    pub fn stress_trace(&self, theta: f64) -> Option<f64> {
        match self {
            Self::Plane {
                bulk,
                is_free: false,
                ..
            } => Some(3.0 * bulk * theta),
            Self::Plane { is_free: true, .. } | Self::Solid { .. } => None,
        }
    }

    /// `σ_m` \[Pa\] and the energies at the end of a step; overwrites `present`.
    pub fn respond(
        &self,
        theta: f64,
        series: &PronyStep,
        past: &[f64],
        present: &mut [f64],
    ) -> (f64, EnergyDensity) {
        let elastic = |bulk: f64, theta: f64| EnergyDensity {
            stored: 0.5 * bulk * theta * theta,
            dissipated: 0.0,
        };
        let (bulk, shear, is_free) = match *self {
            Self::Solid { bulk } => return (bulk * theta, elastic(bulk, theta)),
            Self::Plane {
                bulk,
                shear,
                is_free,
            } => (bulk, shear, is_free),
        };
        let z = match is_free {
            false => -theta / 3.0,
            true => {
                // σ_z = 3/2 K (z + θ) + 2 μ* z, which is linear in z
                let rest = series.follow(0.0, |i| past[i], |_, _| {}).strain;
                -(1.5 * bulk * theta + 2.0 * shear * rest)
                    / (1.5 * bulk + 2.0 * shear * series.slope())
            }
        };
        let whole = match is_free {
            false => theta,
            true => 1.5 * (z + theta),
        };
        let found = series.follow(z, |i| past[i], |i, x| present[i] = x);
        let mut energy = elastic(bulk, whole);
        energy.stored += 3.0 * shear * found.stored;
        energy.dissipated += 3.0 * shear * found.dissipated;
        (bulk * whole - shear * found.strain, energy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        material::{GeneralisedMaxwell, LocalLaw, Reduced},
        peridynamics::Influence,
        tensor::Tensor,
    };
    use std::sync::Arc;

    /// A dilatation that grows, is held, falls beyond where it began and comes back to nothing, in steps of any length.
    const PATH: [(f64, f64); 7] = [
        (0.0, 0.01),
        (0.3, 0.012),
        (2.0, 0.012),
        (0.01, -0.007),
        (0.5, -0.002),
        (1.0, 0.0),
        (9.0, 0.0),
    ];

    #[test]
    fn it_is_the_mean_stress_of_the_local_law_in_every_body() {
        fn follows<const D: usize>(kinematics: Kinematics, constants: Constants) {
            let series = PronySeries::new(vec![(0.3, 0.5), (0.6, 4.0)]);
            let constants = Constants {
                kinematics,
                ..constants
            };
            let solid =
                GeneralisedMaxwell::new(constants.solid_lambda(), constants.shear, series.clone());
            let law = Reduced::<D>::new(Arc::new(solid), kinematics);
            let mut known = vec![0.0; law.history().len()];
            let bulk = constants.lambda + 2.0 / 3.0 * constants.shear;
            let dilatation = Dilatation::new(&constants, bulk);
            let mut past = vec![0.0; dilatation.history(&series).len()];
            for (step, theta) in PATH {
                let (mut present, mut after) = (past.clone(), known.clone());
                let (stress, energy) =
                    dilatation.respond(theta, &series.over(step), &past, &mut present);
                let gradient = Tensor::<D>::identity() * (theta / D as f64);
                let found = law.respond(&gradient, step, &known, &mut after);
                let name = format!("{kinematics:?} {step} {theta}");
                let is_near = |a: f64, b: f64| (a - b).abs() < 1e-14;
                assert!(is_near(found.stress[(0, 0)], stress), "{name}: {stress}");
                assert!(is_near(found.stored, energy.stored), "{name}");
                assert!(is_near(found.dissipated, energy.dissipated), "{name}");
                assert!(energy.dissipated >= 0.0, "{name}");
                (past, known) = (present, after);
            }
        }
        // λ of plane stress, whose solid is that of the others
        let (solid, shear) = (1.7, 1.3);
        let constants = |lambda: f64| Constants {
            lambda,
            shear,
            influence: Influence::Gaussian,
            micromodulus: crate::peridynamics::Micromodulus::InverseDistance,
            kinematics: Kinematics::Solid,
            density: 1.0,
            is_heated: false,
        };
        follows::<3>(Kinematics::Solid, constants(solid));
        follows::<2>(Kinematics::PlaneStrain, constants(solid));
        let plate = 2.0 * shear * solid / (solid + 2.0 * shear);
        follows::<2>(Kinematics::PlaneStress, constants(plate));
    }
}
